"""Looking on while studies run: both robots of a comparison, a tracked video, another's viewer."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from recordings import Recording

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.cli.main import main
from ttwmr_mj.recording.stream.live import LiveView
from ttwmr_mj.recording.stream.viewer import Viewer, free_port, listens, running_viewer
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.closed_loop.pace import Pace
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.compare import Options, compare_scenario
from ttwmr_mj.studies.track.track import track

COPY = "import sys; open(sys.argv[1], 'wb').write(sys.stdin.buffer.read())"
CALIBRATION = scenarios_folder() / "calibration" / "lab_camera.yaml"
FAST = Options(attribute=False, figures=False)


def copier(path: Path) -> Viewer:
    return Viewer((sys.executable, "-c", COPY, str(path)))


@pytest.mark.parametrize(
    ("mode", "name"), [("open_loop", "open_loop_turn"), ("closed_loop", "lab_circle")]
)
def test_both_robots_are_seen_while_they_run(mode: str, name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name, ["duration_s=2.0"])
    options = Options(mode=mode, attribute=False, figures=False)  # type: ignore[arg-type]
    folders = [tmp_path / "plain", tmp_path / "live"]
    for folder in folders:
        folder.mkdir()
    compare_scenario(scenario, folders[0], options)
    with LiveView(copier(tmp_path / "seen")) as live:
        compare_scenario(scenario, folders[1], options, live=live, pace=Pace(5.0, 0.05))
    for file in ("contact.parquet", "analytic.parquet"):
        plain, seen = (pq.read_table(folder / file) for folder in folders)
        for column in plain.column_names:
            np.testing.assert_array_equal(plain[column].to_numpy(), seen[column].to_numpy())
    assert (tmp_path / "seen").read_bytes() == (folders[1] / "run.rrd").read_bytes()
    plain, seen = (Recording(folder / "run.rrd").entities for folder in folders)
    for robot in ("/world/tractor", "/world/analytic/tractor", "/world/analytic/trailer"):
        for component in ("Transform3D:translation", "Transform3D:quaternion"):
            assert seen[robot][component] == plain[robot][component]
    for plot in ("position", "angles"):
        rows = seen[f"/plots/{plot}/true"]["Scalars:scalars"]
        assert rows == plain[f"/plots/{plot}/true"]["Scalars:scalars"]
        assert len(rows) == scenario.periods + 1


def test_a_video_is_seen_while_it_is_tracked(tmp_path: Path) -> None:
    scenario = load_scenario("lab_circle_camera", ["duration_s=0.5", "sensing.latency_s=0.0"])
    experiment = Experiment(scenario, scenarios_folder())
    video = tmp_path / "lab.avi"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (640, 480))

    def film(rows: Trajectory) -> None:
        del rows
        for record in experiment.sensor.drain_log():  # type: ignore[union-attr]
            writer.write(record.frame.image)

    experiment.run(film)
    writer.release()
    for name in ("plain", "live"):
        (tmp_path / name).mkdir()
    robot = scenario.robot
    track(str(video), CALIBRATION, tmp_path / "plain", robot)
    started_s = time.perf_counter()
    with LiveView(copier(tmp_path / "seen")) as live:
        done = track(str(video), CALIBRATION, tmp_path / "live", robot, live=live, pace=Pace(0.5))
    assert time.perf_counter() - started_s > (done.frames - 1) / 30.0 / 0.5
    plain, seen = (pq.read_table(tmp_path / n / "poses.parquet") for n in ("plain", "live"))
    assert plain.num_rows == seen.num_rows == done.frames
    for column in plain.column_names:
        np.testing.assert_array_equal(plain[column].to_numpy(), seen[column].to_numpy())
    assert (tmp_path / "seen").read_bytes() == (tmp_path / "live" / "track.rrd").read_bytes()


@pytest.mark.slow
def test_a_viewer_that_runs_already_gets_every_row(tmp_path: Path) -> None:
    """Another's viewer is a server of Rerun here; what it has received is asked for again."""
    port = free_port(0)
    url = f"rerun+http://127.0.0.1:{port}/proxy"
    program = running_program()
    server = [program, "--serve-grpc", "--bind", "127.0.0.1", "--port", str(port)]
    with subprocess.Popen(server, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as running:
        try:
            _until(lambda: listens(port))
            assert running_viewer(url).command[-4:] == ("--bind", "127.0.0.1", "--port", str(port))
            words = ["run", "lab_circle", f"--live={url}", "--pace", "0", "--quiet"]
            words += ["--set", "duration_s=2.0", "--set", "output.figures=false"]
            assert main([*words, "--out", str(tmp_path / "run")]) == 0
            sent = Recording(tmp_path / "run" / "run.rrd").entities
            got = _received(program, url, tmp_path / "received.rrd")
            for entity in ("/world/tractor", "/plots/x/true"):
                for component, rows in sent[entity].items():
                    assert got[entity][component] == rows, (entity, component)
            assert running.poll() is None  # it is not ours to end
        finally:
            running.kill()


def running_program() -> str:
    from ttwmr_mj.recording.stream.viewer import window

    return window().command[0]


def _received(program: str, url: str, path: Path) -> dict:
    """What a server of Rerun hands out to those who come late."""
    command = [program, url, "--save", str(path), "--bind", "127.0.0.1"]
    command += ["--port", str(free_port(0))]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as client:
        sizes: list[int] = []

        def complete() -> bool:
            sizes.append(path.stat().st_size if path.exists() else 0)
            return len(sizes) > 10 and sizes[-1] == sizes[-10] > 50_000

        _until(complete)
        client.send_signal(signal.SIGINT)
        try:
            client.wait(30)
        except subprocess.TimeoutExpired:
            client.kill()
    return Recording(path).entities


def _until(condition, limit_s: float = 90.0) -> None:
    give_up_s = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < give_up_s
        time.sleep(0.2)
