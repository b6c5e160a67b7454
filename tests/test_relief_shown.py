"""Uneven ground in recordings and videos, and the page about it."""

import re
from pathlib import Path

import numpy as np
import pytest
from recordings import Recording

import ttwmr_mj as tt
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.joints import HEIGHT, Joints
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.recording.video.cameras import chase
from ttwmr_mj.recording.video.footage import Footage
from ttwmr_mj.recording.video.stage import Stage
from ttwmr_mj.robot import RobotParameters

PAGE = Path(__file__).resolve().parent.parent / "docs" / "howto" / "ground.md"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("outdoors") / "run"
    sets = ["duration_s=0.7", "ground.terrain.rms_height_m=0.01", "output.figures=false"]
    tt.run(tt.load_scenario("outdoor_circle", sets), folder)
    return folder


def relief_of(folder: Path) -> Relief:
    scenario = tt.load_scenario(folder / "scenario.resolved.toml")
    return Relief(build_model(scenario.robot, scenario.plant.contact, scenario.ground))


def test_a_recording_draws_the_ground_and_lays_grid_and_paths_over_it(run: Path) -> None:
    read, relief = Recording(run / "run.rrd"), relief_of(run)
    ((_, mesh),) = read.entities["/world/floor"]["Mesh3D:vertex_positions"]
    points = np.array(mesh)
    assert np.ptp(points[:, 2]) > 0.03
    # single precision
    assert points[:, 2] == pytest.approx(relief.at(points[:, :2]), abs=1e-6)
    ((_, lines),) = read.entities["/world/floor/grid"]["LineStrips3D:strips"]
    line = np.array(lines[3])
    assert line[:, 2] - relief.at(line[:, :2]) == pytest.approx(3e-4, abs=1e-6)
    ((_, band),) = read.entities["/world/reference/tractor"]["Mesh3D:vertex_positions"]
    corners = np.array(band)
    assert corners[:, 2] - relief.at(corners[:, :2]) == pytest.approx(1.2e-3, abs=1e-6)


def test_a_video_stands_the_robot_on_the_ground(run: Path) -> None:
    footage = Footage.of(run, 10.0, 1.0, 0.0, None)
    stage = Stage(footage, (320, 240))
    relief = relief_of(run)
    place = Joints(build_model(RobotParameters(preset="outdoor"), ContactOptions())).free_qpos
    above = stage._qpos[:, place + HEIGHT] - relief.at(footage.q[:, :2])
    assert above == pytest.approx(0.060, abs=1e-9)
    stage.show(0)
    picture = stage.picture(chase(footage)(0), 320, 240)
    assert picture.std() > 5.0
    stage.close()


def test_the_pages_scenario_is_one(tmp_path: Path) -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "over_the_field.toml").write_text(text)
    scenario = tt.load_scenario(tmp_path / "over_the_field.toml")
    assert scenario.ground.terrain is not None
    assert scenario.ground.kerbs[0].height_m == 0.001
    assert scenario.robot.tractor.wheel_radius_m == pytest.approx(0.06)
