"""A recording survives chunks, exceptions and kill -9, and refuses what it cannot hold."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from recordings import Recording, analytic, circle_reference, contact_run, record, recorder

from ttwmr_mj.errors import MachineError, RunError


@pytest.mark.parametrize("plant", ["contact", "analytic"])
def test_chunks_equal_one_piece(plant: str, tmp_path: Path) -> None:
    run = contact_run()
    reference = circle_reference()
    rows = analytic(run) if plant == "analytic" else run
    rows = replace(rows, ref_q=rows.ref_q.copy(), est_q=rows.est_q + 0.01)
    rows.ref_q[20:31, :, 3] = np.nan  # θ2 undefined for a while, across a cut
    whole = Recording(record(tmp_path / "whole.rrd", reference, rows))
    parts = Recording(record(tmp_path / "parts.rrd", reference, rows, cuts=(1, 20, 25, 60)))
    assert whole.temporal() == parts.temporal()
    gap = dict(whole.entities["/plots/theta2/reference"]["Scalars:scalars"])
    assert gap[20 * 33_000_000] == []  # ends the line
    assert 21 * 33_000_000 not in gap


def test_an_exception_leaves_a_complete_file(tmp_path: Path) -> None:
    run = contact_run()
    reference = circle_reference()
    path = tmp_path / "run.rrd"
    recording = recorder(path, reference)

    def fail() -> None:
        with recording:
            recording.append(run.rows(0, 20))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    with warnings.catch_warnings(action="error"):  # a missing footer warns
        read = Recording(path)
    assert len(read.times_ns("/plots/x/true", "Scalars:scalars")) == 20


def test_no_recording_begins_before_1970(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ttwmr_mj.recording.stream.rrd_file.time", lambda: -1.0)
    with pytest.raises(MachineError, match=r"before 1970.*set the clock.*output\.recording=false"):
        recorder(tmp_path / "run.rrd", circle_reference())
    assert list(tmp_path.iterdir()) == []


def test_nothing_can_be_added_after_closing(tmp_path: Path) -> None:
    run = contact_run()
    reference = circle_reference()
    recording = recorder(tmp_path / "run.rrd", reference)
    recording.close()
    recording.close()
    with pytest.raises(ValueError, match="closed"):
        recording.append(run)
    with pytest.raises(ValueError, match="closed"):
        recording.finish("late")


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    reference = circle_reference()
    with pytest.raises(RunError, match="nowhere: the folder is gone"):
        recorder(tmp_path / "nowhere" / "run.rrd", reference)


KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.recording.run_recorder import RunRecorder
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.results.trajectory import Trajectory

robot = RobotParameters()
rows = Trajectory.empty(0.033 * np.arange(90), 1)
for values in (rows.q, rows.wheel_speed_rad_s, rows.wheel_command_rad_s):
    values[:] = np.linspace(0.0, 1.0, 90)[:, None, None]
recording = RunRecorder(
    Path(sys.argv[1]),
    model=build_model(robot, ContactOptions()),
    robot=robot,
    reference=None,
    name="killed",
    summary_markdown="",
)
for start in (0, 30, 60):
    recording.append(rows.rows(start, start + 30))
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_kill_9_loses_no_appended_row(tmp_path: Path) -> None:
    path = tmp_path / "killed.rrd"
    died = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert died.returncode == -signal.SIGKILL
    read = Recording(path)
    expected = [33_000_000 * k for k in range(90)]
    assert read.times_ns("/plots/hitch_angle/true", "Scalars:scalars") == expected
    assert read.times_ns("/world/trailer", "Transform3D:translation") == expected


def test_importing_the_package_does_not_import_rerun() -> None:
    code = "import sys, ttwmr_mj.recording; sys.exit('rerun' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, env=dict(os.environ))
