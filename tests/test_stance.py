"""How robots stand: wheels on the ground, slip, and robots that stand no longer."""

from pathlib import Path

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.assets import models_folder
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.footing import FLOWN_M
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.joints import HEIGHT, W, X
from ttwmr_mj.plants.stance import LOADS, NORMALS
from ttwmr_mj.results.metrics import score
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import RobotState

COARSE_STEPS = ["plant.contact.timestep_s=0.01", "control.sampling_time_s=0.03"]


@pytest.mark.parametrize(
    ("changes", "verdict", "words"),
    [
        (["plant.contact.contact_time_constant_s=0.02", *COARSE_STEPS], "tipped_over", "tilted by"),
        (COARSE_STEPS, "off_the_ground", "P rose by"),
        (
            [
                "robot.servo.velocity_gain_n_m_s_rad=1e4",
                "robot.servo.stall_torque_n_m=1000.0",
                "robot.servo.acceleration_limit_rad_s2=1e5",
            ],
            "diverged",
            "left the ground",
        ),
    ],
)
def test_robots_that_no_longer_stand_are_told(changes: list[str], verdict: str, words: str) -> None:
    """Physics steps too coarse for the contacts, and a servo that throws the robot."""
    scenario = tt.load_scenario("sim_circle", ["duration_s=3.0", *changes])
    result = tt.simulate(scenario)
    assert result.verdicts[0].name == verdict
    assert words in result.verdicts[0].what
    metrics, rows = score(result.trajectory, scenario.robot)[0], result.trajectory
    assert metrics["tilt_max_rad"] == rows.tilt_rad.max()
    assert metrics["height_max_m"] == rows.height_m.max()
    assert metrics["airborne_share"] == (rows.wheels_on_floor < 2).mean()
    assert metrics["slipping_share"] == (rows.wheel_slip_m_s > 0.03).mean()


def test_a_robot_that_falls_stands_on_nothing(tmp_path: Path) -> None:
    """It starts beside the floor of a stranger's scene, and falls without turning over."""
    scene = (models_folder() / "scene.xml").read_text()
    scene = scene.replace('"ttwmr.xml"', f'"{models_folder() / "ttwmr.xml"}"')
    scene = scene.replace(
        'type="plane" size="0 0 0.05"', 'type="box" size="0.3 0.3 0.05" pos="0 0 -0.05"'
    )
    (tmp_path / "scene.xml").write_text(scene)
    given = ["duration_s=3.0", f"plant.contact.model_path='{tmp_path / 'scene.xml'}'"]
    result = tt.simulate(tt.load_scenario("straight_line", given))
    (outcome,), rows = result.outcomes, result.trajectory
    assert outcome.status == "diverged"
    assert outcome.reason.endswith("m below the ground (limit 0.3 m)")
    assert rows.wheels_on_floor[-1, 0] == 0
    assert score(rows, result.scenario.robot)[0]["airborne_share"] > 0.5


def test_free_fall_is_told_from_standing() -> None:
    """Upright, under a floor that holds nothing."""
    plant = ContactPlant(RobotParameters(), ContactOptions())
    plant.reset(RobotState(np.zeros((1, 4)), np.zeros((1, 4))))
    standing = plant.stance()
    for fallen_m, wheels in ((0.0, 2), (0.1, 0), (0.29, 0), (0.31, 0)):
        stance = standing.copy()
        stance[:, HEIGHT] -= fallen_m
        if fallen_m:
            stance[:, LOADS] = 0.0
        footing = plant.footing(stance)
        assert footing.wheels_on_floor.tolist() == [wheels]
        assert footing.gone.tolist() == [fallen_m > FLOWN_M]
        assert plant.sound(stance) == (fallen_m < FLOWN_M)


def test_a_wheel_of_a_leaning_robot_is_as_near_as_its_lowest_point() -> None:
    """Rolled about P's axis ahead, so that the right wheel is below the left one."""
    robot = RobotParameters()
    plant = ContactPlant(robot, ContactOptions())
    plant.reset(RobotState(np.zeros((1, 4)), np.zeros((1, 4))))
    radius_m, half_width_m = robot.tractor.wheel_radius_m, robot.tractor.wheel_half_width_m
    lean = 0.4
    depth_m = np.hypot(radius_m * np.cos(lean), half_width_m * np.sin(lean))
    for gap_m, wheels in ((0.9e-4, 1), (1.1e-4, 0)):
        stance = plant.stance()
        stance[:, LOADS] = 0.0
        stance[:, [W, X]] = np.cos(0.5 * lean), np.sin(0.5 * lean)
        stance[:, HEIGHT] = 0.5 * robot.tractor.track_width_m * np.sin(lean) + depth_m + gap_m
        assert plant.footing(stance).wheels_on_floor.tolist() == [wheels]


def test_a_wall_carries_no_wheel() -> None:
    plant = ContactPlant(RobotParameters(), ContactOptions())
    plant.reset(RobotState(np.zeros((1, 4)), np.zeros((1, 4))))
    stance = plant.stance()
    assert (stance[:, NORMALS] == -1.0).all()
    stance[:, HEIGHT] += 1e-3
    for normal, wheels in ((-1.0, 2), (0.0, 0)):
        stance[:, LOADS], stance[:, NORMALS] = 100.0, normal
        assert plant.footing(stance).wheels_on_floor.tolist() == [wheels]


def test_a_plate_of_a_scene_of_ones_own_is_ground(tmp_path: Path) -> None:
    """Tyres on it chatter, as they do on the floor; they are on it at every sample."""
    scene = (models_folder() / "scene.xml").read_text()
    scene = scene.replace('"ttwmr.xml"', f'"{models_folder() / "ttwmr.xml"}"')
    plate = '<geom name="plate" type="box" size="1 1 0.001" pos="1.3 0 -0.0008"/>'
    (tmp_path / "scene.xml").write_text(scene.replace("</worldbody>", f"{plate}</worldbody>"))
    given = [
        "duration_s=6.0",
        f"plant.contact.model_path='{tmp_path / 'scene.xml'}'",
        "initial={kind='at_rest',x_m=0.05,y_m=0.0}",
        "reference={kind='straight_line',start_m=[0.0,0.0],heading_rad=0.0,speed_m_s=0.15}",
    ]
    result = tt.simulate(tt.load_scenario("straight_line", given))
    assert result.verdicts[0].name == "followed"
    place_m, wheels = result.trajectory.q[:, 0, 0], result.trajectory.wheels_on_floor[:, 0]
    on = place_m > 0.3
    assert on.sum() > 60
    assert wheels[on | (place_m < 0.2)].min() == 2
    assert wheels[~on].min() == 0  # the ball in front is on the plate, and lifts both wheels


def test_wide_tyres_do_not_slip() -> None:
    """Wider than they are high: their radius is still what they roll on."""
    overrides = ["duration_s=1.0", "robot.tractor.wheel_half_width_m=0.03"]
    rows = tt.simulate(tt.load_scenario("outer_circle", overrides)).trajectory
    assert rows.wheel_slip_m_s.max() < 0.01


@pytest.mark.slow
def test_a_trailer_that_lifts_a_wheel_is_told() -> None:
    overrides = ["robot.trailer.mass_kg=10.0", "duration_s=5.0"]
    (verdict,) = tt.simulate(tt.load_scenario("inverted_trailer", overrides)).verdicts
    assert verdict.name == "off_the_ground"
    # how often, another processor's rounding decides
    assert verdict.number > verdict.limit == 0.3
    share = f"{100 * verdict.number:.3g} % of the samples (limit 30 %)"
    assert verdict.what == f"a wheel was off the ground at {share}"


def test_tyres_that_slide_are_on_the_ground() -> None:
    """They touch it at every other step, micrometres above it."""
    overrides = ["plant.contact.floor_friction=0.02", "duration_s=2.0"]
    rows = tt.simulate(tt.load_scenario("sim_circle", overrides)).trajectory
    assert rows.wheels_on_floor.min() == 2
    assert rows.wheel_slip_m_s.max() > 0.3


def test_slip_is_how_much_faster_the_rim_is_than_the_axle() -> None:
    """At every sample, though a sliding tyre touches the floor at every other step."""
    segment = "{duration_s=2.0,wheel_right_rad_s=20.0,wheel_left_rad_s=12.0}"
    overrides = [
        "robot.servo.preset='fast'",
        "plant.contact.floor_friction=0.02",
        "robot.hitch.gimballed=true",
        f"controller={{kind='open_loop',segments=[{segment}]}}",
    ]
    result = tt.simulate(tt.load_scenario("open_loop_turn", ["duration_s=2.0", *overrides]))
    rows, tractor = result.trajectory, result.scenario.robot.tractor
    rates, heading = rows.q_rate[:, 0], rows.q[:, 0, 2]
    forward = rates[:, 0] * np.cos(heading) + rates[:, 1] * np.sin(heading)
    aside = rates[:, 1] * np.cos(heading) - rates[:, 0] * np.sin(heading)
    ahead = rates[:, 2, None] * 0.5 * tractor.track_width_m * np.array([1.0, -1.0])
    along = tractor.wheel_radius_m * rows.wheel_speed_rad_s[:, 0] - forward[:, None] - ahead
    slip = np.hypot(along, aside[:, None]).max(axis=1)
    assert slip[1:].min() > 0.03
    # a deck that nods by a tenth of a millimetre in a step moves the wheels by some mm/s
    assert np.abs(rows.wheel_slip_m_s[:, 0] - slip).max() < 0.01


def test_a_robot_that_stands_is_not_told_of() -> None:
    result = tt.simulate(tt.load_scenario("sim_circle", ["duration_s=2.0"]))
    rows = result.trajectory
    assert rows.tilt_rad.max() < 1e-3
    assert np.abs(rows.height_m).max() < 1e-5
    assert rows.wheels_on_floor.min() == 2
    assert rows.wheel_slip_m_s.max() < 0.01
    analytic = tt.simulate(
        tt.load_scenario("sim_circle", ["duration_s=0.5", "plant.kind='analytic'"])
    )
    assert np.isnan(analytic.trajectory.tilt_rad).all()
    assert score(analytic.trajectory, analytic.scenario.robot)[0]["airborne_share"] is None


def test_wheels_that_slip_or_lift_are_named_with_a_loss() -> None:
    from ttwmr_mj.results.verdict import judge

    result = tt.simulate(tt.load_scenario("sim_circle", ["duration_s=2.0"]))
    rows, robot = result.trajectory, result.scenario.robot
    rows.q[:, :, 0] += 1.0
    rows.wheel_slip_m_s[::2] = 0.05
    rows.wheels_on_floor[::10] = 1.0
    verdict = judge(rows, robot)
    assert verdict.name == "lost"
    assert "wheels slipped at 50.8 % of the samples" in verdict.what
    assert "a wheel was off the ground at 11.5 % of the samples" in verdict.what


def test_older_trajectories_without_a_footing_are_read(tmp_path: Path) -> None:
    import pyarrow.parquet as pq

    rows = tt.simulate(tt.load_scenario("sim_circle", ["duration_s=0.2"])).trajectory
    table = rows.to_table()
    older = table.drop_columns(["tilt_rad", "height_m", "wheels_on_floor", "wheel_slip_m_s"])
    pq.write_table(table, tmp_path / "now.parquet")
    pq.write_table(older, tmp_path / "older.parquet")
    assert np.array_equal(Trajectory.read(tmp_path / "now.parquet").height_m, rows.height_m)
    assert np.isnan(Trajectory.read(tmp_path / "older.parquet").height_m).all()
