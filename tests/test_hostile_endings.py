"""A law whose code goes on after its run, or that spoils the end of its process: real processes."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import ANY

import pytest
from recordings import Recording
from test_hostile_processes import BARE, FAST, TTWMR, law_in, ttwmr

from ttwmr_mj.results.trajectory import Trajectory

JOINS = """
        type(self).__del__ = lambda self: threading.Event().wait()"""
SWALLOWS = """
        def forever(self):
            while True:
                try:
                    time.sleep(0.1)
                except BaseException:
                    pass
        type(self).__del__ = forever"""


@pytest.mark.slow
@pytest.mark.parametrize("code", [JOINS, SWALLOWS])
def test_the_end_of_a_law_is_not_waited_for(code: str, tmp_path: Path) -> None:
    law_in(tmp_path, "at_start", code)
    done = ttwmr(tmp_path, "run", "--out", "out", changes=BARE)
    assert (done.returncode, done.stderr) == (0, "")
    assert "run folder: out" in done.stdout
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["status"] == "ok"
    done = ttwmr(tmp_path, "validate", "--load", "mine.toml", changes=[])  # two laws
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("pool", ["", "self.pool = P(1); self.pool.submit(print); "])
def test_what_a_law_has_not_written_yet_is_written(pool: str, tmp_path: Path) -> None:
    log = "self.log = open('log.txt', 'w'); self.log.write('started')"
    pools = "from concurrent.futures import ThreadPoolExecutor as P; "
    law_in(tmp_path, "at_start", f"{pools}{pool}{log}")
    assert ttwmr(tmp_path, "run", "--out", "out", changes=BARE).returncode == 0
    assert (tmp_path / "log.txt").read_text() == "started"


@pytest.mark.parametrize(
    "code",
    [
        "import builtins; builtins.hasattr = None",
        "import builtins; builtins.getattr = None",
        "import atexit; k or atexit.register(lambda: 1 / 0); k and 1 / 0",
    ],
)
def test_what_a_law_did_to_the_interpreter_is_told_in_one_line(code: str, tmp_path: Path) -> None:
    law_in(tmp_path, "at_command", code)
    done = ttwmr(tmp_path, "run", "--out", "out", changes=BARE)
    assert done.returncode == 1
    assert done.stderr.startswith("ttwmr: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("hook", ["setprofile", "settrace"])
def test_a_hook_for_threads_is_none_of_ours(hook: str, tmp_path: Path) -> None:
    law_in(tmp_path, "at_making", f"threading.{hook}(lambda *a: 1 / 0)")
    changes = [*FAST, "output.figures=false"]
    done = ttwmr(tmp_path, "run", "--out", "out", changes=changes)
    assert (done.returncode, done.stderr) == (0, "")
    assert Recording(tmp_path / "out" / "run.rrd").entities


@pytest.mark.parametrize(
    "code",
    [
        "os.replace = os.rename = lambda *a, **k: None",
        "import pathlib; pathlib.Path.replace = lambda *a, **k: None",
        "import json; json.dumps = lambda *a, **k: '{}'",
    ],
)
def test_files_are_whole_whatever_a_law_puts_in_place_of_functions(
    code: str, tmp_path: Path
) -> None:
    law_in(tmp_path, "at_command", code)
    done = ttwmr(tmp_path, "run", "--out", "out", changes=BARE)
    assert done.returncode == 0
    assert json.loads((tmp_path / "out" / "metrics.json").read_text())["status"] == "ok"
    assert len(Trajectory.read(tmp_path / "out" / "trajectory.parquet")) > 1
    assert not list(tmp_path.rglob("*.part"))


def test_a_run_without_its_result_is_no_success(tmp_path: Path) -> None:
    nothing = "lambda *a, **k: None"
    law_in(tmp_path, "at_command", f"import ttwmr_mj.runs.metrics as m; m.write_json = {nothing}")
    done = ttwmr(tmp_path, "run", "--out", "out", changes=BARE)
    assert done.returncode == 1
    assert "out/metrics.json cannot be read" in done.stderr


def test_what_a_process_that_dies_has_written_half_goes(tmp_path: Path) -> None:
    half = "out/trajectory.parquet.12.0123abcd.part"
    law_in(tmp_path, "at_start", f"open({half!r}, 'w'); os.kill(os.getpid(), 9)")
    (tmp_path / "out.tar.part").touch()
    (tmp_path / "out" / "mine").mkdir(parents=True)
    (tmp_path / "out" / "mine" / "film.mkv.part").touch()
    done = ttwmr(tmp_path, "run", "--out", "out", "--force", changes=BARE)
    assert done.returncode == 1
    assert "by SIGKILL before it was over" in done.stderr
    assert "nothing was recorded" in done.stderr
    left = {path.name for path in tmp_path.rglob("*.part")}
    assert left == {"out.tar.part", "film.mkv.part"}


def test_a_run_that_a_law_was_to_replace_is_there_again_where_it_ends_its_process(
    tmp_path: Path,
) -> None:
    law_in(tmp_path, "at_start", "pass")
    assert ttwmr(tmp_path, "run", "--out", "out", changes=BARE).returncode == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    before[".lock"] = ANY  # nobody holds it any more
    law_in(tmp_path, "at_start", "os._exit(0)")
    done = ttwmr(tmp_path, "run", "--out", "out", "--force", changes=BARE)
    assert done.returncode == 1
    assert "nothing was recorded" in done.stderr
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


@contextmanager
def on_a_terminal(folder: Path, **changed: int) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """A run of mine.toml as a terminal's foreground, and our end of that terminal."""
    ours, theirs = os.openpty()
    words = termios.tcgetattr(theirs)
    words[3] |= changed.get("lflag", 0)
    termios.tcsetattr(theirs, termios.TCSANOW, words)
    line = [*TTWMR, "run", "mine.toml", "--quiet", "--out", "out", *(f"--set={c}" for c in BARE)]
    with subprocess.Popen(
        line,
        cwd=folder,
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # one thread
    ) as run:
        os.close(theirs)
        try:
            yield run, ours
        finally:
            run.kill()
            os.close(ours)


def test_a_terminal_that_stops_who_prints_in_its_background_stops_no_run(tmp_path: Path) -> None:
    """`stty tostop`: the law's process is no group of the terminal's foreground."""
    law_in(tmp_path, "at_start", "pass")
    with on_a_terminal(tmp_path, lflag=termios.TOSTOP) as (run, _):
        assert run.wait(timeout=60) == 0  # it was ended after 90 s, with exit code 1


@pytest.mark.slow
@pytest.mark.parametrize("code", ["input()", "breakpoint()", "os.read(0, 1)"])
def test_a_law_that_reads_from_the_terminal_is_told_at_once(code: str, tmp_path: Path) -> None:
    """A terminal stops who reads from it in its background."""
    law_in(tmp_path, "at_command", code)
    with on_a_terminal(tmp_path) as (run, _):
        assert run.wait(timeout=60) == 1  # it was ended after 150 s
    said = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert said["status"] == "failed"
    assert ("Input/output error" if "os" in code else "tt.simulate lets it read") in said["reason"]


@pytest.mark.slow
def test_a_law_reads_what_is_piped_to_it(tmp_path: Path) -> None:
    law_in(tmp_path, "at_start", "assert input() == 'a word'")
    line = [*TTWMR, "run", "mine.toml", "--quiet", "--out", "out", *(f"--set={c}" for c in BARE)]
    subprocess.run(line, cwd=tmp_path, input=b"a word\n", check=True)


@pytest.mark.slow
def test_a_law_stops_and_goes_on_with_its_command(tmp_path: Path) -> None:
    """Ctrl-Z in a shell reaches the command, and its law's process is a group of its own."""
    here = "open('law', 'w').write(str(os.getpid())); time.sleep(0.2)"
    law_in(tmp_path, "at_command", here)
    line = [*TTWMR, "run", "mine.toml", "--quiet", "--out", "out", *(f"--set={c}" for c in BARE)]
    with subprocess.Popen(line, cwd=tmp_path) as run:
        while not (tmp_path / "law").is_file() or not (tmp_path / "law").read_text():
            assert run.poll() is None
        law = Path("/proc") / (tmp_path / "law").read_text()
        run.send_signal(signal.SIGTSTP)
        assert os.waitid(os.P_PID, run.pid, os.WSTOPPED) is not None
        while "State:\tT" not in (law / "status").read_text():  # at once, or never
            assert law.is_dir()
        run.send_signal(signal.SIGCONT)
        assert run.wait(timeout=60) == 0
