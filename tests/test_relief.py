"""Ground that is not flat: its heights, robots on it, and what is said when they do not stand."""

from pathlib import Path

import cv2
import mujoco
import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.floor.terrain import Kerb, Terrain
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.robot import Hitch, RobotParameters
from ttwmr_mj.robot.outdoor import OUTDOOR_SCALE
from ttwmr_mj.runs.batch import run_batch
from ttwmr_mj.state import RobotState

ROLLING = Terrain(rms_height_m=0.004, correlation_length_m=0.4, half_size_m=2.0, seed=3)
COARSE = ContactOptions(timestep_s=0.001, contact_time_constant_s=0.002)
HILLS = """
name = "hills"
duration_s = 1.0
[initial]
kind = "at_rest"
[reference]
kind = "none"
[controller]
kind = "open_loop"
segments = [{duration_s = 1.0, wheel_right_rad_s = 0.0, wheel_left_rad_s = 0.0}]
[ground.terrain]
rms_height_m = 0.005
half_size_m = 1.0
png_path = "hills.png"
"""


def test_random_terrain_has_the_height_and_the_correlation_it_is_asked_for() -> None:
    wide = Terrain(rms_height_m=0.01, correlation_length_m=0.5, half_size_m=15.0, seed=1)
    heights = wide.heights_m()
    assert np.sqrt((heights**2).mean()) == pytest.approx(0.01, rel=1e-12)
    assert heights.mean() == pytest.approx(0.0, abs=1e-12)
    lag = round(0.5 / (30.0 / wide.cells))
    for a, b in ((heights[:, lag:], heights[:, :-lag]), (heights[lag:], heights[:-lag])):
        # 3600 patches of a correlation length: two per cent, and the lag is rounded to the grid
        assert (a * b).mean() / 1e-4 == pytest.approx(np.exp(-1.0), abs=0.08)
    assert np.array_equal(heights, wide.heights_m())
    other = wide.model_copy(update={"seed": 2}).heights_m()
    assert abs((other * heights).mean()) < 2e-5


def test_the_model_has_the_terrain_and_the_kerbs() -> None:
    kerb = Kerb(height_m=0.003, x_m=1.0, y_m=0.5, length_m=0.4, width_m=0.1, angle_rad=0.5 * np.pi)
    ground = Ground(terrain=ROLLING, kerbs=(kerb,))
    model = build_model(RobotParameters(), COARSE, ground)
    relief, grid = Relief(model), ROLLING.heights_m()
    nodes = np.linspace(-2.0, 2.0, ROLLING.cells + 1)
    x, y = np.meshgrid(nodes, nodes)
    points = np.stack([x, y], axis=-1)
    on = (np.abs(x - 1.0) <= 0.05) & (np.abs(y - 0.5) <= 0.2)
    assert on.any()
    # single precision in the model
    expected = np.where(on, np.maximum(grid, 0.003), grid)
    assert relief.at(points) == pytest.approx(expected, abs=1e-8)
    assert (relief.lowest_m, relief.highest_m) == pytest.approx((grid.min(), expected.max()))
    assert relief.at(np.array([[2.01, 0.0], [0.0, -3.0]])).tolist() == [relief.lowest_m] * 2
    middle = 0.25 * (grid[3, 4] + grid[3, 5] + grid[4, 4] + grid[4, 5])
    between = np.array([nodes[4] + nodes[5], nodes[3] + nodes[4]]) / 2.0
    assert relief.at(between) == pytest.approx(middle, abs=1e-8)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geom = np.zeros(1, dtype=np.int32)
    for point in ([0.31, -0.72], [1.02, 0.55], [-1.3, 1.1]):
        start = np.array([*point, 1.0])
        down, group = np.array([0.0, 0.0, -1.0]), np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)
        fall = mujoco.mj_ray(model, data, start, down, group, 1, -1, geom)
        # triangles against the bilinear surface between the same nodes, 5 cm apart
        assert 1.0 - fall == pytest.approx(float(relief.at(np.array(point))), abs=2e-4)
    assert Relief(build_model(RobotParameters(), COARSE)).flat


def test_a_picture_is_terrain(tmp_path: Path) -> None:
    picture = np.zeros((20, 30), dtype=np.uint8)
    picture[:, 15:] = 200  # the east is high
    picture[:5] += 40  # and the north a little
    cv2.imwrite(str(tmp_path / "hills.png"), picture)
    (tmp_path / "hills.toml").write_text(HILLS)
    scenario = tt.load_scenario(tmp_path / "hills.toml")
    model = build_model(scenario.robot, COARSE, scenario.ground)
    relief = Relief(model)
    east, west, north = (relief.at(np.array(p)) for p in ([0.9, -0.5], [-0.9, -0.5], [0.9, 0.9]))
    assert float(east - west) > 0.008
    assert north > east
    assert np.sqrt((relief.heights_m**2).mean()) == pytest.approx(0.005, rel=1e-5)
    (tmp_path / "hills.png").write_bytes(b"no picture")
    with pytest.raises(InputError, match="png_path"):
        build_model(scenario.robot, COARSE, scenario.ground)


@pytest.mark.parametrize("command", [["validate"], ["run", "--out", "out"]])
@pytest.mark.parametrize(
    ("rows", "columns", "levels", "problem"),
    [
        (5478, 5478, 250, "cannot be read as a picture of 2×2 pixels to 30 megapixels"),
        (40, 1, 250, "cannot be read as a picture of 2×2 pixels to 30 megapixels"),
        (50, 50, 1, "is of one grey level, which would be level ground"),
    ],
)
def test_a_picture_that_is_no_terrain_is_refused(
    rows: int,
    columns: int,
    levels: int,
    problem: str,
    command: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hills.toml").write_text(HILLS)
    height = 5 + np.arange(rows) % levels
    cv2.imwrite("hills.png", np.repeat(height[:, None], columns, axis=1).astype(np.uint8))
    assert main([*command, "hills.toml"]) == 2
    told = capsys.readouterr().err
    for part in ("ground.terrain.png_path", problem, "leave the key out for random terrain"):
        assert part in told


def test_robots_start_at_rest_on_rolling_ground_where_they_are_told() -> None:
    robot = RobotParameters(preset="outdoor")
    plant = ContactPlant(robot, COARSE, 3, ground=Ground(terrain=ROLLING))
    start = RobotState.at_rest(0.0, 0.0, 0.0, 0.0, 3)
    start.q[:] = [[0.3, 0.2, 1.0, 1.4], [-0.6, 0.4, -2.0, -1.0], [0.0, -0.9, 0.3, 2.0]]
    plant.reset(start)
    assert plant.state().q == pytest.approx(start.q, abs=1e-6)
    footing = plant.footing(plant.stance())
    assert footing.wheels_on_floor.tolist() == [2, 2, 2]
    # the tractor stands across 0.27 m of heights that differ by a few mm
    assert np.abs(footing.height_m).max() < 0.006
    assert footing.tilt_rad.max() < 0.05
    plant.advance(np.zeros((3, 2)), 200)
    # nothing falls or rattles: it may creep downhill with free balls, at a few mm/s
    assert np.abs(plant.state().q - start.q)[:, :3].max() < 0.005
    readings = plant.contact_readings()
    assert (readings[:, 2:, 0] > 0).mean() > 0.6


def test_gimballed_and_rigid_hitches_are_the_same_on_a_plane() -> None:
    ends = []
    for gimballed in (False, True):
        hitch = Hitch(gimballed=gimballed)
        plant = ContactPlant(RobotParameters(hitch=hitch), COARSE)
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.5))
        plant.advance(np.array([[4.0, 2.0]]), 600)
        ends.append(plant.state().q[0])
    # soft contacts of a body in one piece and of two
    assert ends[0] == pytest.approx(ends[1], abs=2e-3)


def test_the_outdoor_robot_is_table_i_by_similarity() -> None:
    small, large, scale = RobotParameters(), RobotParameters(preset="outdoor"), OUTDOOR_SCALE
    assert large.tractor.wheel_radius_m == pytest.approx(0.060)
    assert large.casters.radius_m == 0.040
    assert large.swing_length_m == pytest.approx(scale * small.swing_length_m)
    assert large.swing_inertia_kg_m2 == pytest.approx(scale**5 * small.swing_inertia_kg_m2)
    # Froude: speed over the square root of gravity times length
    speeds = [r.servo.speed_limit_rad_s * r.tractor.wheel_radius_m for r in (small, large)]
    fast = 40.0 / 6.5
    assert speeds[1] == pytest.approx(fast * speeds[0] * np.sqrt(scale))
    weight = large.tractor.mass_kg / small.tractor.mass_kg
    torque = large.servo.stall_torque_n_m / small.servo.stall_torque_n_m
    assert torque == pytest.approx(weight * scale)
    given = RobotParameters.model_validate({"preset": "outdoor", "trailer": {"mass_kg": 5.0}})
    assert given.trailer.mass_kg == 5.0
    assert given.trailer.com_offset_m == large.trailer.com_offset_m
    model = build_model(large, COARSE)
    label = model.site("label_trailer_rear").pos[0]
    assert label == pytest.approx(-0.195 * scale)


@pytest.mark.parametrize(("length_m", "accepted"), [(2.0, True), (2.001, False), (20.0, False)])
def test_terrain_is_not_alike_all_over(length_m: float, accepted: bool) -> None:
    sets = ["ground.terrain.half_size_m=1.0", f"ground.terrain.correlation_length_m={length_m}"]
    if accepted:
        terrain = tt.load_scenario("outdoor_circle", sets).ground.terrain
        assert terrain is not None
        heights_m = terrain.heights_m()
        assert np.sqrt((heights_m**2).mean()) == pytest.approx(terrain.rms_height_m)
    else:
        with pytest.raises(
            tt.InputError, match=r"correlation_length_m: got .*; allowed: at most 2,"
        ):
            tt.load_scenario("outdoor_circle", sets)


def test_terrains_of_several_seeds_run_in_one_batch() -> None:
    sets = ["duration_s=0.5", "controller={kind='flatness'}"]
    scenarios = [
        tt.load_scenario("outdoor_circle", [*sets, f"ground.terrain.seed={seed}"])
        for seed in (1, 2)
    ]
    together = run_batch(scenarios)
    alone = [tt.simulate(scenario) for scenario in scenarios]
    for one, other in zip(together, alone, strict=True):
        assert np.array_equal(one.trajectory.q, other.trajectory.q)
        assert np.array_equal(one.trajectory.height_m, other.trajectory.height_m)
    assert not np.array_equal(together[0].trajectory.q, together[1].trajectory.q)


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("ground.terrain.rms_height_m=0.002", "ground.terrain"),
        (
            "ground.kerbs=[{height_m=0.002,x_m=0.5,y_m=0.0,length_m=0.3,width_m=0.02}]",
            "ground.kerbs",
        ),
    ],
)
def test_models_without_a_third_dimension_refuse_relief(change: str, key: str) -> None:
    tt.load_scenario("lab_circle", [change])
    with pytest.raises(InputError, match=key):
        tt.load_scenario("lab_circle", [change, "plant.kind='analytic'"])


def test_a_kerb_lifts_the_larger_robot_and_stops_small_balls() -> None:
    """A ball of 8 mm meets a kerb of 3 mm at 51°, one of 40 mm at 22°."""
    kerb = Ground(kerbs=(Kerb(height_m=0.003, x_m=0.5, y_m=0.0, length_m=0.4, width_m=1.0),))
    ends = []
    for robot in (RobotParameters(), RobotParameters(preset="outdoor")):
        plant = ContactPlant(robot, COARSE, ground=kerb)
        plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0))
        over_plane = []
        for _ in range(80):
            plant.advance(np.full((1, 2), 0.2 / robot.tractor.wheel_radius_m), 33)
            x = plant.state().q[0, 0]
            over_plane.append(
                plant.footing(plant.stance()).height_m[0] + (0.003 if 0.3 < x < 0.7 else 0.0)
            )
        ends.append(x)
    assert ends[0] < 0.3
    assert ends[1] > 0.4
    assert max(over_plane) == pytest.approx(0.003, abs=1e-3)


@pytest.mark.parametrize("height_m", [0.01, 0.03])
def test_a_plate_under_all_of_a_train_is_a_floor(height_m: float) -> None:
    """Settled at the origin, in the plate, the train would be thrown out of it."""
    train = tt.load_scenario("double_inverted").robot
    q = np.array([[0.6, 0.0, 1.6, 2.0, 2.4]])
    plate = Kerb(x_m=0.6, y_m=0.0, length_m=10.0, width_m=10.0, height_m=height_m)
    footings = []
    for ground in (Ground(), Ground(kerbs=(plate,))):
        plant = ContactPlant(train, ContactOptions(), ground=ground)
        plant.reset(RobotState(q=q, q_rate=np.zeros_like(q)))
        footings.append(plant.footing(plant.stance()))
        np.testing.assert_allclose(plant.state().q, q, rtol=1e-15)  # let down where it is put
    flat, raised = footings
    assert raised.wheels_on_floor == [2.0]
    for a, b in zip(flat, raised, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-6)


@pytest.mark.parametrize("x_m", [-0.16, 0.04, 0.08])
def test_a_robot_on_the_edge_of_a_plate_slides_off_and_is_not_thrown(x_m: float) -> None:
    """Put back from where it slid to while it was let down, it began inside the plate."""
    plate = Kerb(x_m=0.0, y_m=0.0, length_m=0.2, width_m=0.2, height_m=0.03)
    plant = ContactPlant(RobotParameters(), ContactOptions(), ground=Ground(kerbs=(plate,)))
    q = np.array([[x_m, 0.02, 0.3, 2.0]])
    plant.reset(RobotState(q=q, q_rate=np.zeros_like(q)))
    np.testing.assert_allclose(plant.state().q, q, rtol=1e-15)
    for _ in range(15):
        plant.advance(np.zeros((1, 2)), 33)
        # wheels up there and a ball on the floor, or the other way about: 0.44 rad
        assert plant.footing(plant.stance()).tilt_rad < 0.5
    assert 0.01 < np.abs(plant.state().q - q).max() < 0.3  # off the edge, not away
