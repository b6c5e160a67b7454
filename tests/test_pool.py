"""The pool: every job alone, every end reported, nothing left behind."""

from __future__ import annotations

import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterable, Iterator
from contextlib import closing
from pathlib import Path

import jobs_to_do
import pytest

from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.studies.pool import server
from ttwmr_mj.studies.pool.halves import in_halves
from ttwmr_mj.studies.pool.jobs import SERVER_GONE, Done, Failed, Job, run_jobs


def is_running(pid: int) -> bool:
    """Whether a process is there and no zombie that waits for its parent."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until_gone(pids: list[int]) -> None:
    deadline = time.monotonic() + 30
    while any(is_running(pid) for pid in pids):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_every_job_has_fresh_globals_and_no_more_are_taken_than_there_are_workers() -> None:
    taken = []

    def jobs() -> Iterator[Job]:
        for i in range(6):
            taken.append(i)
            yield Job(str(i), jobs_to_do.count_calls)

    results = {}
    for done, event in enumerate(run_jobs(jobs(), workers=2), start=1):
        assert isinstance(event, Done)
        assert len(taken) <= done + 1  # one more under way
        results[event.job.name] = event.result
    assert results == dict.fromkeys("012345", 1)


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (jobs_to_do.break_off, "ZeroDivisionError: of its own making (jobs_to_do.py:31)"),
        (jobs_to_do.leave, "the process ended with exit code 3: last words"),
        (jobs_to_do.leave_quietly, "the process ended with exit code 0"),
        (jobs_to_do.crash, "the process ended with SIGSEGV"),
    ],
)
def test_what_breaks_is_reported_and_the_rest_goes_on(call: object, line: str) -> None:
    jobs = [Job("bad", call), Job("good", jobs_to_do.count_calls)]  # type: ignore[arg-type]
    events = {event.job.name: event for event in run_jobs(jobs, workers=1)}
    bad = events["bad"]
    assert isinstance(bad, Failed)
    assert bad.reason == line
    assert bad.error is None
    assert not bad.of_machine
    assert events["good"] == Done(jobs[1], 1)


@pytest.mark.parametrize("call", ["close_all", "write_into_pipes", "leave_a_thread"])
def test_what_a_law_does_to_the_pool_is_in_vain(call: str) -> None:
    code = (
        "import jobs_to_do\n"
        "from ttwmr_mj.studies.pool.jobs import Job, run_jobs\n"
        f"jobs = [Job('bad', jobs_to_do.{call}), Job('good', jobs_to_do.count_calls)]\n"
        "print(*(event.result for event in run_jobs(jobs, workers=1)), sep=', ')\n"
    )
    done = subprocess.run(  # whose server has this standard error
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("done all the same, 1\n", "")


@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
def test_a_server_that_was_ended_is_not_held_against_a_job(by: int) -> None:
    jobs = [Job("bad", jobs_to_do.end_the_server, (by,)), Job("good", jobs_to_do.count_calls)]
    bad, good = run_jobs(jobs, workers=1)
    assert isinstance(bad, Failed)
    assert (bad.reason, bad.of_machine) == (SERVER_GONE, True)
    assert good == Done(jobs[1], 1)


@pytest.mark.parametrize("by", [b"", b"\x80\x04", pickle.dumps("nothing that ends a job")])
def test_an_answer_that_is_none_is_a_failure(by: bytes) -> None:
    (event,) = run_jobs([Job("bad", jobs_to_do.damage_the_answer, (by,))])
    assert isinstance(event, Failed)
    assert re.search("its answer was damaged|ended with exit code 0", event.reason)


def test_a_job_that_is_done_leaves_no_child(tmp_path: Path) -> None:
    (event,) = run_jobs([Job("leaves", jobs_to_do.leave_a_child, (tmp_path / "pid",))])
    assert isinstance(event, Done)
    wait_until_gone([int((tmp_path / "pid").read_text())])


def test_an_error_raised_on_purpose_comes_back_whole() -> None:
    (event,) = run_jobs([Job("refused", jobs_to_do.refuse)])
    assert isinstance(event, Failed)
    assert isinstance(event.error, InputError)
    assert event.error.faults[0].key == ("some", "key")
    assert event.reason == "some.key: got 1"


def test_a_result_that_cannot_be_sent_is_a_failure() -> None:
    (event,) = run_jobs([Job("function", jobs_to_do.return_a_function)])
    assert isinstance(event, Failed)
    assert "return_a_function" in event.reason


def test_a_job_that_takes_too_long_is_killed_with_all_it_started(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    jobs = [Job("slow", jobs_to_do.sleep_with_a_child, (pids,), timeout_s=3.0)]
    (event,) = run_jobs(jobs)
    assert event == Failed(jobs[0], "timed out after 3 s", late=True)
    wait_until_gone([int(pid) for pid in pids.read_text().split()])


@pytest.mark.parametrize("place", ["run", "run/a.json"])
def test_of_a_job_that_is_killed_nothing_is_left_half_written(tmp_path: Path, place: str) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "whole.json").write_text("{}")
    file = tmp_path / "run" / "a.json"
    (event,) = run_jobs([Job("bad", jobs_to_do.write_half, (file,), places=(tmp_path / place,))])
    assert isinstance(event, Failed)
    assert [path.name for path in (tmp_path / "run").iterdir()] == ["whole.json"]


@pytest.mark.parametrize(
    ("call", "of_machine"),
    [
        (jobs_to_do.killed, True),
        (jobs_to_do.find_the_disk_full, True),
        (jobs_to_do.miss_opengl, True),
        (jobs_to_do.find_no_room_for_the_answer, True),
        (jobs_to_do.crash, False),
        (jobs_to_do.break_off, False),
        (jobs_to_do.refuse, False),
    ],
)
def test_what_the_machine_did_is_told_from_what_the_job_did(call: object, of_machine: bool) -> None:
    (event,) = run_jobs([Job("bad", call)], workers=1)  # type: ignore[arg-type]
    assert isinstance(event, Failed)
    assert (event.of_machine, event.late) == (of_machine, False)


@pytest.mark.parametrize("bad", [{3}, {0, 1}, {6}, set(range(7))])
def test_a_chunk_that_breaks_is_halved_until_the_piece_is_found(bad: set[int]) -> None:
    started = []

    def compute(
        chunks: Iterable[tuple[int, ...]],
    ) -> Generator[tuple[tuple[int, ...], bool], None, None]:
        for chunk in chunks:
            started.append(chunk)
            yield chunk, bool(bad & set(chunk))

    found = dict(in_halves([(0, 1, 2, 3), (4, 5, 6)], compute, lambda broke: broke))
    assert {chunk[0] for chunk, broke in found.items() if broke} == bad
    assert all(len(chunk) == 1 for chunk, broke in found.items() if broke)
    assert sorted(i for chunk in found for i in chunk) == list(range(7))  # each once
    assert len(started) == len(set(started))


def test_closing_the_events_kills_what_is_under_way(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    jobs = [
        Job("slow", jobs_to_do.sleep_with_a_child, (pids,)),
        Job("quick", jobs_to_do.count_calls),
        *(Job("waits", jobs_to_do.sleep_with_a_child, (tmp_path / "never",)) for _ in range(1)),
    ]
    with closing(run_jobs(jobs, workers=2)) as events:
        assert next(events).job.name == "quick"
        deadline = time.monotonic() + 30
        while not pids.is_file():
            assert time.monotonic() < deadline
            time.sleep(0.02)
    wait_until_gone([int(pid) for pid in pids.read_text().split()])
    assert not (tmp_path / "never").exists()


@pytest.mark.slow
def test_ctrl_c_of_a_terminal_does_not_reach_the_server_while_it_imports(tmp_path: Path) -> None:
    (tmp_path / "slow_import.py").write_text(
        "import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nopen('told', 'a').write('up ')\n"
    )
    code = (
        "import signal, slow_jobs\n"
        "from ttwmr_mj.studies.pool.jobs import Job, run_jobs\n"
        "events = list(run_jobs([Job('one', slow_jobs.ring)], preload=['slow_import']))\n"
        "print(events[0].result)"
    )
    (tmp_path / "slow_jobs.py").write_text(
        "import signal\ndef ring():\n    return signal.pthread_sigmask(signal.SIG_BLOCK, [])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("set()\n", "")  # and a job hears it again
    assert (tmp_path / "told").read_text() == "up "  # once, by the server


def test_what_a_job_prints_is_not_for_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    list(run_jobs([Job("talks", jobs_to_do.leave)]))
    assert capfd.readouterr() == ("", "")


LONG = """
import jobs_to_do
from ttwmr_mj.studies.pool.jobs import Job, run_jobs

if __name__ == "__main__":
    print([event.result for event in run_jobs([Job("one", jobs_to_do.count_calls)])])
"""


def test_a_long_tmpdir_is_no_hindrance(tmp_path: Path) -> None:
    """The names of sockets are shorter than those of files."""
    long = tmp_path / ("x" * 120)
    long.mkdir()
    (tmp_path / "long.py").write_text(LONG)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "long.py")],
        env=os.environ | {"TMPDIR": str(long), "PYTHONPATH": str(Path(__file__).parent)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("[1]\n", "")
    assert not list(long.iterdir())


def test_where_no_socket_can_be_it_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    long = tmp_path / ("x" * 120)
    long.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(long))
    monkeypatch.setattr(server, "SHORT", ())
    with pytest.raises(MachineError, match=r"^TMPDIR has \d+ letters .* a folder of at most 70$"):
        next(run_jobs([]))
    assert tempfile.tempdir == str(long)
