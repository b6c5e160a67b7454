"""Runs that are looked at while they run: same results, real time, a viewer that fails."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from recordings import Recording

from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.recording.stream import viewer
from ttwmr_mj.recording.stream.live import LiveView
from ttwmr_mj.recording.stream.viewer import Viewer, choose_viewer, display, listens, web_viewer
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.closed_loop.pace import BEHIND_S, Pace, behind
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.scenario.file import load_scenario

SHORT = ["duration_s=2.0", "output.figures=false"]
COPY = "import sys; open(sys.argv[1], 'wb').write(sys.stdin.buffer.read())"
DEAF = "import time; time.sleep(600)"


def spy(code: str, *arguments: object) -> Viewer:
    """A viewer that is a piece of Python, for what a real one does not tell."""
    return Viewer((sys.executable, "-c", code, *map(str, arguments)))


def same_rows(one: Path, other: Path) -> None:
    """Two recordings hold the same rows, however they are cut into pieces."""
    a, b = (Recording(path).entities for path in (one, other))
    assert a.keys() == b.keys()
    for entity in a:
        if entity in ("/__properties", "/numbers", "/details"):
            continue
        assert a[entity].keys() == b[entity].keys(), entity
        for component, rows in a[entity].items():
            if component.startswith("TextDocument"):
                continue  # tells wall times
            ours, theirs = (
                [r for r in x if r[1] is not None] for x in (rows, b[entity][component])
            )
            assert repr(ours) == repr(theirs), (entity, component)


def test_a_live_run_leaves_the_same_bits_and_the_viewer_gets_the_file(tmp_path: Path) -> None:
    scenario = load_scenario("lab_circle", SHORT)
    folders = [tmp_path / name for name in ("plain", "live")]
    for folder in folders:
        folder.mkdir()
    run_scenario(scenario, folders[0])
    seen = tmp_path / "seen.rrd"
    with LiveView(spy(COPY, seen)) as live:
        run_scenario(scenario, folders[1], live=live, pace=Pace(0.0, report_every_s=0.02))
    plain, live_rows = (Trajectory.read(f / "trajectory.parquet").to_columns() for f in folders)
    for name, values in plain.items():
        np.testing.assert_array_equal(values, live_rows[name], err_msg=name)
    same_rows(folders[0] / "run.rrd", folders[1] / "run.rrd")
    assert seen.read_bytes() == (folders[1] / "run.rrd").read_bytes()


def test_the_viewer_gets_rows_while_they_are_made(tmp_path: Path) -> None:
    seen = tmp_path / "seen.rrd"
    code = "import sys, os\nwith open(sys.argv[1], 'wb', 0) as f:\n"
    code += "    while piece := os.read(0, 65536): f.write(piece)"
    recording = tmp_path / "run.rrd"
    with LiveView(spy(code, seen)) as live, recording.open("wb") as file:
        live.follow(recording)
        for piece in (b"first", b"second"):
            file.write(piece)
            file.flush()
            give_up_s = time.monotonic() + 60.0
            while not (seen.exists() and seen.read_bytes().endswith(piece)):
                assert time.monotonic() < give_up_s
                time.sleep(0.02)
        live.finish()


@pytest.mark.parametrize("fate", ["deaf", "dead", "killed"])
def test_a_viewer_that_fails_costs_the_run_nothing(fate: str, tmp_path: Path) -> None:
    """Deaf: it never reads, so that its pipe is full after 64 KiB and the file is 700."""
    code = {"deaf": DEAF, "dead": "", "killed": COPY}[fate]
    scenario = load_scenario("lab_circle", ["duration_s=6.0", "output.figures=false"])
    with LiveView(spy(code, tmp_path / "seen")) as live:
        if fate == "killed":
            os.kill(live._process.pid, signal.SIGKILL)
        if fate == "dead":  # before the run, however slow the machine
            live._process.wait(60.0)
        live.finish = live._ended.set  # type: ignore[method-assign]  # no grace at the end
        done = run_scenario(scenario, tmp_path, live=live, pace=Pace(0.0, report_every_s=0.02))
        assert live.alive == (fate == "deaf")
        assert bool(live.fault) == (fate != "dead")
        os.kill(live._process.pid, signal.SIGKILL) if fate == "deaf" else None
    assert done.outcome.status == "ok"
    assert len(Trajectory.read(tmp_path / "trajectory.parquet")) == scenario.periods + 1
    assert len(Recording(tmp_path / "run.rrd").times_ns("/plots/x/true", "Scalars:scalars")) > 100


def test_a_paced_run_takes_its_time(tmp_path: Path) -> None:
    scenario = load_scenario("straight_line", ["duration_s=1.0", "output.figures=false"])
    started_s = time.perf_counter()
    done = run_scenario(scenario, tmp_path, pace=Pace(2.0))
    assert time.perf_counter() - started_s >= 0.5
    assert done.pace.startswith("pace 2 × real time")
    assert done.metrics["real_time_factor"] > 0.0
    states = Recording(tmp_path / "run.rrd").entities["/pace"]["StateChange:state"]
    assert states[0][0] == 0
    assert {state for _, (state,) in states} <= {"kept", "behind"}


def test_a_machine_that_cannot_keep_pace_says_so(tmp_path: Path) -> None:
    scenario = load_scenario("lab_circle", ["duration_s=15.0", "output.figures=false"])
    done = run_scenario(scenario, tmp_path, pace=Pace(1e4))
    assert "too fast for this machine" in done.pace
    recording = Recording(tmp_path / "run.rrd").entities
    assert recording["/pace"]["StateChange:state"][-1][1] == ["behind"]
    assert done.pace in str(recording["/report"]["TextDocument:text"][-1])


def test_pace_is_held_to_the_first_sample() -> None:
    pace = Pace(10.0)
    started_s = time.perf_counter()
    assert all(pace.hold(time_s) for time_s in (0.0, 0.5, 1.0))
    assert time.perf_counter() - started_s >= 0.1
    assert len(pace.lag_s) == 3
    assert behind([0.0, BEHIND_S, 1.01 * BEHIND_S]) == [False, False, True]
    assert Pace().hold(3.0)
    assert Pace().told() == ""


@pytest.mark.parametrize("stopped", [False, True])
def test_time_for_which_the_process_was_stopped_is_not_made_up_for(stopped: bool) -> None:
    """Ctrl-Z and `fg`: only what a shell sends at the end of it is seen."""
    pace, before = Pace(1.0), signal.getsignal(signal.SIGCONT)
    with pace.heeding_stops():
        pace.hold(0.0)
        pace._started_s -= 100.0  # as if so much time had gone by
        if stopped:
            os.kill(os.getpid(), signal.SIGCONT)
        pace.hold(0.033)
    assert (pace.lag_s[-1] == 0.0) == stopped
    assert signal.getsignal(signal.SIGCONT) == before


@pytest.mark.parametrize("speed", ["1e-300", "-1", "inf", "nan"])
def test_a_pace_that_is_none_is_refused(
    speed: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "lab_circle", f"--pace={speed}", "--out", str(tmp_path / "out")]) == 2
    assert "--pace" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "wish",
    [
        *("window", "http://127.0.0.1:9876", "rerun+http://127.0.0.1", "rerun+http://h:p/proxy"),
        "rerun+http://[::1/proxy",
    ],
)
def test_a_viewer_that_is_none_is_refused(wish: str) -> None:
    with pytest.raises(InputError, match=r"--live: got .*allowed: auto, web, or"):
        choose_viewer(wish)


def test_a_viewer_that_does_not_answer_is_refused() -> None:
    with socket.socket() as held:  # bound and not listening: nobody else can answer there
        held.bind(("127.0.0.1", 0))
        with pytest.raises(InputError, match="no viewer answers"):
            choose_viewer(f"rerun+http://127.0.0.1:{held.getsockname()[1]}/proxy")


@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (b"", "."),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "what answers there is no viewer"),
        (None, "timed out"),
    ],
)
def test_a_server_that_is_no_viewer_is_refused(
    answer: bytes | None, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer, "ANSWER_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            connection, _ = server.accept()
            if answer is None:
                connection.recv(1000)  # all it says
                connection.recv(1)
            else:
                connection.sendall(answer)
            connection.close()

        threading.Thread(target=serve, daemon=True).start()
        with pytest.raises(InputError, match=f"no viewer answers: .*{told}"):
            choose_viewer(f"rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy")


def test_a_name_that_can_be_no_hosts_is_refused() -> None:
    with pytest.raises(InputError, match=r"no viewer answers: .*label"):
        choose_viewer(f"rerun+http://{'a' * 64}:9/proxy")


def test_a_pipe_of_a_recordings_name_is_not_waited_for(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no .rrd file in this folder"):
        viewer.find_recording(tmp_path)
    os.mkfifo(tmp_path / "a.rrd")
    for given in (tmp_path, tmp_path / "a.rrd"):
        with pytest.raises(InputError, match=r"a.rrd: is a pipe or a device"):
            viewer.find_recording(given)
    (tmp_path / "b" / "run.rrd").mkdir(parents=True)
    with pytest.raises(InputError, match=r"run.rrd: is a folder"):
        viewer.find_recording(tmp_path / "b")


def test_what_is_not_recorded_cannot_be_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "lab_circle", "--live=web", "--set", "output.recording=false"]) == 2
    assert "output.recording" in capsys.readouterr().err
    assert main(["compare", "lab_circle", "--live=web", "--real-wheels"]) == 2
    assert "--real-wheels" in capsys.readouterr().err


def test_a_display_is_one_that_is_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert display() is None
    monkeypatch.setenv("DISPLAY", ":4711")
    assert display() is None  # named, and nobody is there
    monkeypatch.setenv("DISPLAY", "nonsense")
    assert display() is None
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert display() is None
    (tmp_path / "wayland-0").touch()
    assert display() == "Wayland wayland-0"
    assert choose_viewer("auto").stays
    monkeypatch.delenv("WAYLAND_DISPLAY")
    assert choose_viewer("auto").page.startswith("http://127.0.0.1:")


def test_without_a_display_view_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(viewer, "display", lambda: None)
    (tmp_path / "run.rrd").write_bytes(b"RRF2")
    assert main(["view", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert f"no display to show {tmp_path / 'run.rrd'} on" in said
    assert "--web" in said
    assert "copy the file" in said


def test_a_machine_without_a_viewer_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "PROGRAMS", ("no-such-program",))
    with pytest.raises(MachineError, match="pip install rerun-sdk"):
        web_viewer()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[SimpleNamespace]:
    """`ttwmr view --web` of a short run, in a process of its own."""
    (tmp_path / "run").mkdir()
    run_scenario(load_scenario("lab_circle", SHORT), tmp_path / "run")
    command = [sys.executable, "-m", "ttwmr_mj", "view", "--web", "run"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        line = process.stdout.readline()
        ports = [int(word.rpartition(":")[2]) for word in (line.partition("/?")[0],)]
        ports.append(int(line.partition("%3A")[2].rpartition("%3A")[2].partition("%2F")[0]))
        yield SimpleNamespace(process=process, line=line, ports=ports)
        process.kill()


def test_view_serves_loopback_only_and_ends_with_its_command(served: SimpleNamespace) -> None:
    give_up_s = time.monotonic() + 60.0
    while not all(map(listens, served.ports)):
        assert time.monotonic() < give_up_s, served.line
        time.sleep(0.1)
    assert _listening_at(served.ports) == {"127.0.0.1"}
    served.process.send_signal(signal.SIGINT)
    assert served.process.wait(30) == 0
    assert not any(map(listens, served.ports))


def test_a_viewer_that_ends_ends_its_command(served: SimpleNamespace) -> None:
    give_up_s = time.monotonic() + 60.0
    while not listens(served.ports[0]):
        assert time.monotonic() < give_up_s, served.line
        time.sleep(0.1)
    children = Path(f"/proc/{served.process.pid}/task/{served.process.pid}/children")
    (viewer_of_it,) = map(int, children.read_text().split())
    os.kill(viewer_of_it, signal.SIGKILL)
    assert served.process.wait(30) == 1


def test_two_viewers_at_once_have_ports_of_their_own() -> None:
    room = "ttwmr_mj.recording.stream.viewer"
    code = f"from {room} import free_port as f; print(f(9090), flush=True); input()"
    ask = [sys.executable, "-c", code]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(ask, **pipes) as one, subprocess.Popen(ask, **pipes) as other:
        ports = [process.stdout.readline() for process in (one, other)]
        for process in (one, other):
            process.communicate("\n")
    assert ports[0] != ports[1]


def test_a_server_does_not_outlive_a_killed_command(served: SimpleNamespace) -> None:
    give_up_s = time.monotonic() + 60.0
    while not listens(served.ports[0]):
        assert time.monotonic() < give_up_s, served.line
        time.sleep(0.1)
    served.process.kill()
    while listens(served.ports[0]):
        assert time.monotonic() < give_up_s
        time.sleep(0.1)


def _listening_at(ports: list[int]) -> set[str]:
    """The addresses at which someone listens on these ports."""
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            local, state = line.split()[1], line.split()[3]
            address, port = local.split(":")
            if state == "0A" and int(port, 16) in ports:
                parts = [str(byte) for byte in reversed(bytes.fromhex(address))]
                found.add(".".join(parts) if table == "tcp" else address)
    return found
