"""What no command foresees ends in one line and an exit code: real processes, real faults."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from sweeps import SMALL
from ttwmr_mj.cli import last_resort
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import printable

TTWMR = [sys.executable, "-m", "ttwmr_mj"]
GONE = "mkdir gone; cd gone; rmdir ../gone;"
PLAIN = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def shell(line: str, cwd: Path, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", line.replace("ttwmr", " ".join(TTWMR))],
        cwd=cwd,
        capture_output=True,
        text=True,
        errors="backslashreplace",
        timeout=120,
        check=False,
        env=os.environ | more,
    )


def one_line(text: str) -> str:
    """The error, which must be one line."""
    assert "Traceback" not in text
    assert text.startswith("ttwmr: ")
    assert text.count("\n") == 1
    return text


@pytest.mark.parametrize(
    ("line", "code", "told"),
    [
        ("ttwmr export-schema > /dev/full", 1, "No space left on device"),
        ("ttwmr --version > /dev/full", 1, "No space left on device"),
        ("ttwmr export-schema | head -1 >/dev/null", 0, ""),
        ("ttwmr run lab_circle --set plant.kind=analytic --set duration_s=1.0 | :", 0, ""),
        ("ttwmr runn 2>&-", 2, ""),
        ("ttwmr --help >&-", 0, ""),
        ("ttwmr --help >&- 2>&- <&-", 0, ""),
        (f"{GONE} ttwmr --version", 0, ""),
        (f"{GONE} ttwmr export-schema --out schema.json", 2, "the working directory is gone"),
        ("ttwmr validate lab_circle --set description=$(printf '\\377')", 2, "not UTF-8: "),
    ],
)
def test_streams_and_words(line: str, code: int, told: str, tmp_path: Path) -> None:
    done = shell(line, tmp_path)
    assert done.returncode == code, done.stderr
    if told:
        assert told in one_line(done.stderr)
    else:
        assert done.stderr == ""


@pytest.fixture
def unread() -> Iterator[int]:
    """A pipe whose reader has left."""
    source, end = os.pipe()
    os.close(source)
    yield end
    os.close(end)


TALKS = """
import sys
from ttwmr_mj.cli.commands.doctor import Doctor
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import RunError

def fails(self):
    print("x" * 100_000)  # more than is kept until the end
    raise RunError("the work went on")

Doctor.__call__ = fails
sys.argv[1:] = ["doctor"]
sys.exit(main())
"""


def test_a_reader_that_leaves_changes_no_exit_code(unread: int) -> None:
    command = [sys.executable, "-c", TALKS]
    done = subprocess.run(command, stdout=unread, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, "ttwmr: the work went on\n")
    assert subprocess.run(command, stdout=unread, stderr=unread, check=False).returncode == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "controller", ["", 'controller={kind="custom",target="misbehaving:Broken"}']
)
def test_a_verdict_decides_though_nobody_reads_it(
    controller: str, tmp_path: Path, unread: int
) -> None:
    """One law is the user's, in a process that is watched, and would break at a later sample."""
    words = "run lab_circle --require followed --out out --set plant.kind=analytic"
    command = [*TTWMR, *words.split(), "--set", "duration_s=0.1", "--set", controller or "seed=1"]
    done = subprocess.run(
        command,
        stdout=unread,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
    )
    assert done.returncode == 1
    assert "was required to be 'followed' and is not" in one_line(done.stderr)


@pytest.mark.slow
def test_work_goes_on_though_nobody_hears_of_it(tmp_path: Path, unread: int) -> None:
    (tmp_path / "mine.toml").write_text(SMALL)
    command = [*TTWMR, "sweep", "mine.toml", "--out", "out"]
    done = subprocess.run(command, stdout=unread, stderr=unread, check=False, cwd=tmp_path)
    assert done.returncode == 0
    assert (tmp_path / "out" / "report.html").is_file()


@pytest.mark.slow
def test_an_ascii_locale_prints_escapes_and_reads_words(tmp_path: Path) -> None:
    done = shell("ttwmr export-schema", tmp_path, **PLAIN)
    assert (done.returncode, done.stderr) == (0, "")
    assert "\\u03b8" in done.stdout  # θ, which that locale lacks
    words = "ttwmr validate lab_circle --set description='größer'"
    assert shell(words, tmp_path, **PLAIN).returncode == 0
    done = shell("ttwmr validate größer.toml", tmp_path, **PLAIN)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


LONG = "x" * 300


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["validate", f"{LONG}.toml"], "no such scenario file"),
        (["view", LONG], "File name too long"),
        (["run", "lab_circle", "--out", LONG], "File name too long"),
        (["export-schema", "--out", f"{LONG}"], "File name too long"),
        (["export-schema", "--out", "no/folder/schema.json"], "No such file or directory"),
        (["export-schema", "--out", "file/schema.json"], "Not a directory"),
        (["validate", "lab_circle", "--fragment", "folder"], "Is a directory"),
        (["validate", "a\0b.toml"], ""),
    ],
)
def test_names_that_cannot_be_used(
    words: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    assert main(words) == 2
    err = capsys.readouterr().err
    assert told in one_line(err)
    assert len(err) < 1000


@pytest.mark.parametrize("words", [["sweep", "lab"], ["bench", "quick"]])
@pytest.mark.parametrize("number", ["-1", "0", "two", "9" * 5000])
def test_counts_are_whole_and_positive(
    words: list[str], number: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main([*words, f"--workers={number}"])
    assert left.value.code == 2
    assert "workers" in capsys.readouterr().err


def of_empty_folder(name: str) -> AttributeError:
    """What Python says of a library whose folder is there and empty."""
    library = ModuleType(name)
    library.__file__ = None  # as importing such a folder leaves it
    return AttributeError(f"module {name!r} has no attribute 'Opti'", name="Opti", obj=library)


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        (OSError(28, "No space left on device", "a/b"), 1, "a/b: No space left on device; files"),
        (PermissionError(13, "Permission denied", "a"), 2, "a: Permission denied"),
        (OSError("odd"), 1, "odd"),
        (MemoryError(), 1, "out of memory"),
        (RecursionError("deep"), 2, "nested too deeply"),
        (ModuleNotFoundError("No module", name="cv2.x"), 2, "cv2 is missing; `ttwmr doctor` says"),
        (ImportError("libGL.so.1", name="cv2"), 2, "cv2 cannot be imported: libGL.so.1; `ttwmr"),
        (of_empty_folder("casadi"), 2, "casadi cannot be imported: its folder holds no code; `ttw"),
        (
            ImportError("no name", name="ttwmr_mj.cli"),
            1,
            "unexpected ImportError: no name; --debug",
        ),
        (KeyboardInterrupt(), 1, "stopped"),
        (ZeroDivisionError("a\nb"), 1, "unexpected ZeroDivisionError: a; --debug"),
    ],
)
def test_any_exception_is_one_line(
    error: BaseException,
    code: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr("ttwmr_mj.scenario.file.load_scenario", fails)
    monkeypatch.setattr(last_resort, "strangers", [])  # of other tests
    assert main(["validate", "lab_circle"]) == code
    assert told in one_line(capsys.readouterr().err)
    if isinstance(error, Exception):
        with pytest.raises(type(error)):
            main(["validate", "lab_circle", "--debug"])


def test_what_a_terminal_obeys_is_printed_as_escapes(capsys: pytest.CaptureFixture[str]) -> None:
    assert printable("θ − ×\n\t") == "θ − ×\n\t"
    assert printable("\x1b[2J\x9b\r\u202e\udcff") == "\\x1b[2J\\x9b\\r\\u202e\\udcff"
    assert main(["validate", "lab_circle", "--set", "\x1b]0;title\x07=1"]) == 2
    assert "\x1b" not in capsys.readouterr().err


def test_libraries_do_not_comment_on_numbers(tmp_path: Path) -> None:
    """A hitch this stiff overflows the model that `tvlqr` predicts with."""
    words = "--set robot.hitch.stiffness_n_m_rad=1e4 --set duration_s=0.2 --out out"
    ended = shell(f"ttwmr run double_inverted {words}", tmp_path)
    assert ended.returncode == 1
    assert "Warning" not in ended.stderr
    assert "controller.start() found no gains" in ended.stderr
    assert all(line.startswith("ttwmr: ") for line in ended.stderr.splitlines())


def test_a_law_without_gains_says_so(tmp_path: Path) -> None:
    words = "--set robot.hitch.coulomb_friction_n_m=1000.0 --set duration_s=0.2 --out out"
    ended = shell(f"ttwmr run double_inverted {words}", tmp_path)
    assert ended.returncode == 1
    assert "controller.start() found no gains for these numbers of robot and ref" in ended.stderr


ENDING = """
import os, signal, sys
from ttwmr_mj.cli.main import main
from ttwmr_mj.cli.commands import {command}

def rings(number, then=0):
    os.kill(os.getpid(), number)
    return then

{command}.{kind}.__call__ = {call}
sys.argv[1:] = {words}
if {late}:
    import atexit
    atexit.register(rings, {late})
sys.exit(main())
"""
EARLY = """
import os, signal, sys

class Rings:
    def find_spec(self, name, path, target=None):
        if name == "{module}":
            os.kill(os.getpid(), signal.{signal})

sys.meta_path.insert(0, Rings())
from ttwmr_mj.cli.main import main
sys.argv[1:] = ["--version"]
sys.exit(main())
"""


@pytest.mark.parametrize("module", ["argparse", "ttwmr_mj.cli.supervisor"])
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_signal_before_all_is_imported_is_told_in_a_line(module: str, name: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", EARLY.format(module=module, signal=name)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "ttwmr: stopped\n")


IN_TEXT = "lambda self: exec('import os; os.kill(os.getpid(), 2)')"


@pytest.mark.parametrize(
    ("call", "late", "code"),
    [
        (IN_TEXT, "0", 1),  # where dataclasses are made
        ("lambda self: 0", "signal.SIGTERM", 0),
        ("lambda self: 0", "signal.SIGINT", 0),
        ("lambda self: rings(signal.SIGTERM)", "signal.SIGTERM", 1),
    ],
)
def test_a_signal_anywhere_ends_with_the_exit_code_of_what_was_done(
    call: str, late: str, code: int
) -> None:
    program = ENDING.format(command="doctor", kind="Doctor", call=call, late=late, words=["doctor"])
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (code, "ttwmr: stopped\n" if code else "")
