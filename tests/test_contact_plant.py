"""The contact plant: the same physics as a plain MuJoCo loop, in any batch, mirrored and turned."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ttwmr_mj.dynamics.servo import ramp
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.contact_readings import read_contacts
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.robot import Casters, Hitch, RobotParameters, Servo, Tractor
from ttwmr_mj.state import RobotState

START = RobotState.at_rest(0.3, -0.2, 1.1, 0.4)
GRAVITY = 9.81
STEPS = 66  # of 0.5 ms in a control period of 33 ms


def commands(n: int, nsim: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-6, 6, (n, nsim, 2))


def drive(plant: ContactPlant, wheel_commands: np.ndarray) -> np.ndarray:
    return np.stack([_advanced(plant, command) for command in wheel_commands])


def _advanced(plant: ContactPlant, command: np.ndarray) -> np.ndarray:
    plant.advance(command, STEPS)
    state = plant.state()
    return np.concatenate([state.q, state.q_rate], axis=1)


def test_it_is_a_plain_mj_step_loop() -> None:
    """Bit for bit: the batch, the servo's ramp and the recording change nothing in the physics."""
    robot = RobotParameters()
    plant = ContactPlant(robot, ContactOptions())
    plant.reset(START)
    data = mujoco.MjData(plant.model)
    data.qpos[:] = plant.joint_positions()[0]
    mujoco.mj_forward(plant.model, data)
    time = plant.time_step_s * np.arange(1, STEPS + 1)
    setpoint = np.zeros((1, 2))
    for command in commands(20, 1):
        profile = ramp(setpoint, command, robot.servo, time)
        for control in profile[0]:
            data.ctrl[:] = control
            mujoco.mj_step(plant.model, data)
        setpoint = profile[:, -1]
        plant.advance(command, STEPS)
        assert np.array_equal(plant.joint_positions()[0], data.qpos)


def test_a_batch_is_its_single_runs_at_any_thread_count() -> None:
    wish = commands(15, 3)
    robot, options = RobotParameters(), ContactOptions()
    starts = RobotState(q=START.q + np.arange(3)[:, None], q_rate=np.zeros((3, 4)))
    together = []
    for nthread in (1, 2):
        plant = ContactPlant(robot, options, nsim=3, nthread=nthread)
        plant.reset(starts)
        together.append(drive(plant, wish))
    assert np.array_equal(*together)
    for i in range(3):
        alone = ContactPlant(robot, options)
        alone.reset(RobotState(q=starts.q[i : i + 1], q_rate=starts.q_rate[i : i + 1]))
        assert np.array_equal(drive(alone, wish[:, i : i + 1])[:, 0], together[0][:, i])


def test_a_second_run_repeats_the_first() -> None:
    plant = ContactPlant(RobotParameters(), ContactOptions())
    runs = []
    for _ in range(2):
        plant.reset(START)
        runs.append(drive(plant, commands(15, 1)))
    assert np.array_equal(*runs)


def test_mirrored_commands_give_the_mirrored_motion() -> None:
    plant = ContactPlant(RobotParameters(), ContactOptions())
    wish = commands(60, 1)
    plant.reset(RobotState.at_rest(0, 0, 0, 0.3))
    path = drive(plant, wish)
    plant.reset(RobotState.at_rest(0, 0, 0, -0.3))
    mirrored = drive(plant, wish[:, :, ::-1])
    mirrored[..., [1, 2, 3, 5, 6, 7]] *= -1
    # not bitwise: the solver sums the mirrored contacts in another order, and slip amplifies it
    assert np.abs(mirrored - path).max() < 1e-6


def swapped(robot: RobotParameters) -> RobotParameters:
    """The mirrored robot: what is declared first, and driven by the first command, is on the left.

    No scenario can say so; the bodies' lateral positions only change their sign.
    """
    track, spacing = -robot.tractor.track_width_m, -robot.casters.trailer_half_spacing_m
    tractor = robot.tractor.model_copy(update={"track_width_m": track})
    casters = robot.casters.model_copy(update={"trailer_half_spacing_m": spacing})
    return robot.model_copy(update={"tractor": tractor, "casters": casters})


@pytest.mark.parametrize(
    "robot",
    [
        RobotParameters(),
        RobotParameters(
            tractor=Tractor(wheel_shape="cylinder"),
            hitch=Hitch(damping_n_m_s_rad=1e-3, coulomb_friction_n_m=1e-4, stiffness_n_m_rad=1e-3),
            casters=Casters(rolling_resistance_m=1e-5),
        ),
    ],
    ids=["default", "everything"],
)
@pytest.mark.parametrize("moving", [False, True], ids=["from_rest", "in_motion"])
def test_swapping_left_and_right_mirrors_the_motion_exactly(
    robot: RobotParameters, moving: bool
) -> None:
    """Bit for bit: in the swapped robot every number is the same up to its sign."""
    mirror = [1.0, -1.0, -1.0, -1.0]
    cos, sin = np.cos(1.1), np.sin(1.1)
    rate = np.array([[0.1 * cos, 0.1 * sin, 0.4, -0.3]]) * moving
    start = RobotState(q=START.q, q_rate=rate)
    wish = commands(60, 1)
    paths = []
    for built, initial in (
        (robot, start),
        (swapped(robot), RobotState(q=start.q * mirror, q_rate=start.q_rate * mirror)),
    ):
        plant = ContactPlant(built, ContactOptions())
        plant.reset(initial)
        # the same numbers go to the wheel declared first: left and right have changed places
        paths.append(drive(plant, wish))
    assert plant.model.body("wheel_right").pos[1] > 0.0 > plant.model.body("wheel_left").pos[1]
    assert np.ptp(paths[0][:, 0, 3]) > 0.1  # the trailer swings
    np.testing.assert_array_equal(paths[1], paths[0] * [*mirror, *mirror])


def test_the_floor_carries_the_weight() -> None:
    robot = RobotParameters()
    plant = ContactPlant(robot, ContactOptions())
    plant.reset(START)
    drive(plant, np.zeros((10, 1, 2)))
    contacts = read_contacts(plant.contact_readings())
    weight = (robot.tractor.mass_kg + robot.trailer.mass_kg) * GRAVITY
    # at rest; what is missing of equality is the solver's tolerance
    assert contacts.force_n[0].sum(axis=0) == pytest.approx([0, 0, weight], abs=1e-6)
    assert np.abs(contacts.slip_m_s).max() < 1e-9
    # the trailer's weight is on its own two casters, whose middle is under its COM
    trailer = robot.trailer.mass_kg * GRAVITY
    assert contacts.force_n[0, 3:, 2].sum() == pytest.approx(trailer, rel=0.05)


def test_contact_points_are_under_the_wheels() -> None:
    robot = RobotParameters()
    plant = ContactPlant(robot, ContactOptions())
    plant.reset(START)
    x, y, theta1, _ = START.q[0]
    left = np.array([-np.sin(theta1), np.cos(theta1)])
    right_wheel = np.array([x, y]) - robot.half_track_m * left
    position = read_contacts(plant.contact_readings()).position_m
    # 1 µm: the settled robot tilts by some 1e-7 rad
    assert position[0, 0, :2] == pytest.approx(right_wheel, abs=1e-6)


def test_reset_puts_the_robot_where_it_was_told_in_motion() -> None:
    plant = ContactPlant(RobotParameters(servo=Servo(preset="fast")), ContactOptions())
    heading = 2.5
    rate = np.array([[0.3 * np.cos(heading), 0.3 * np.sin(heading), 0.7, -0.2]])
    # beyond one turn: unwrapped angles are kept
    asked = RobotState(q=np.array([[0.1, 0.2, heading + 4 * np.pi, 9.0]]), q_rate=rate)
    plant.reset(asked)
    got = plant.state()
    assert got.q == pytest.approx(asked.q, abs=1e-12)
    assert got.q_rate == pytest.approx(asked.q_rate, abs=1e-12)
    before = got.q.copy()
    wheels = plant.wheel_speed_rad_s()
    assert wheels[0].mean() * 0.026 == pytest.approx(0.3, abs=1e-12)
    plant.advance(wheels, STEPS)
    # it keeps rolling: 0.3 m/s for 33 ms, less what the swinging trailer takes for a moment
    moved = np.hypot(*(plant.state().q - before)[0, :2])
    assert moved == pytest.approx(0.3 * 0.033, rel=0.01)


@pytest.mark.parametrize(
    ("turn", "hitch"), [(0.0, 0.0), (0.7, np.pi / 2)], ids=["straight", "circle"]
)
def test_the_balls_roll_from_the_start(turn: float, hitch: float) -> None:
    """A steady motion of the model, entered in motion, has no jolt: the balls already roll."""
    robot = RobotParameters(servo=Servo(preset="fast"))
    plant = ContactPlant(robot, ContactOptions())
    heading, speed = 2.5, 0.3
    rate = [speed * np.cos(heading), speed * np.sin(heading), turn, turn]
    start = RobotState(q=np.array([[0.1, 0.2, heading, heading + hitch]]), q_rate=np.array([rate]))
    plant.reset(start)
    slip = read_contacts(plant.contact_readings()).slip_m_s[0, :, :2]
    assert np.abs(slip[2:]).max() < 1e-15  # at 0.3 m/s: rounding
    assert np.abs(slip[:2]).max() < 1e-6  # tyres are pressed flat by 50 nm of 26 mm
    # the servos hold their speed, where a command of zero would brake with 34 N a wheel
    first = read_contacts(plant.contact_readings()).force_n
    plant.advance(plant.wheel_speed_rad_s(), 1)
    np.testing.assert_allclose(read_contacts(plant.contact_readings()).force_n, first, atol=1e-6)
    plant.reset(start)
    plant.advance(plant.wheel_speed_rad_s(), 1)
    change = (plant.state().q_rate - start.q_rate)[0]
    ahead = change[0] * np.cos(heading) + change[1] * np.sin(heading)
    # balls at rest would take 1.1e-5 m/s off P, and 3.1e-3 rad/s off θ2 in the circle
    assert abs(ahead) < 5e-7
    assert np.abs(change[2:]).max() < 1e-6


def test_headings_stay_unwrapped_over_turns() -> None:
    plant = ContactPlant(RobotParameters(), ContactOptions())
    plant.reset(RobotState.at_rest(0, 0, 3.0, 3.0))
    path = drive(plant, np.tile([[6.0, -6.0]], (200, 1, 1)))
    theta1 = path[:, 0, 2]
    assert np.abs(np.diff(theta1)).max() < 0.2
    assert theta1[-1] > 3.0 + 2 * np.pi


def test_a_free_trailer_settles_outside_the_circle() -> None:
    robot = RobotParameters(servo=Servo(preset="fast"), hitch=Hitch(damping_n_m_s_rad=2e-3))
    plant = ContactPlant(robot, ContactOptions())
    for sign in (1.0, -1.0):
        speed, turn = 0.5, sign * 0.5
        wheels = np.array([[speed + robot.half_track_m * turn, speed - robot.half_track_m * turn]])
        wheels /= robot.tractor.wheel_radius_m
        plant.reset(RobotState.at_rest(0, 0, 0, 0))
        plant.advance(wheels, 60_000)
        # what is left of the swing: e^(−c·30 s/2J) = 1.7 % of its start, and the contacts' creep
        hitch = float(plant.state().hitch_angle_rad[0])
        assert hitch == pytest.approx(sign * np.pi / 2, abs=0.02)


def test_broken_physics_is_noticed() -> None:
    plant = ContactPlant(RobotParameters(), ContactOptions(), nsim=2)
    rate = np.zeros((2, 4))
    rate[1, 2] = 1e12  # no robot turns that fast: MuJoCo warns and resets it
    plant.reset(RobotState(q=np.tile(START.q, (2, 1)), q_rate=rate))
    plant.advance(np.zeros((2, 2)), 5)
    assert plant.failed().tolist() == [False, True]
    assert plant.fault(1).startswith("Nan, Inf or huge value in Q")


def test_a_push_gives_the_impulse_it_should() -> None:
    """The braked tractor stands; the trailer swings about P: J·Δθ̇2 = F·l·Δt."""
    robot = RobotParameters()
    plant = ContactPlant(robot, ContactOptions())
    plant.reset(RobotState.at_rest(0, 0, 0, 0))
    force, steps = 0.02, 20
    plant.push({"trailer": np.array([0.0, force])})
    plant.advance(np.zeros((1, 2)), steps)
    rate = plant.state().q_rate[0, 3]
    # the trailer's COM is behind P: a push to the left turns it clockwise
    impulse = -force * robot.trailer.com_offset_m * steps * plant.time_step_s
    # 2 %: the casters' balls roll along, 0.4·m_ball each at the COM's distance, and add to J
    assert rate == pytest.approx(impulse / robot.swing_inertia_kg_m2, rel=0.02)
    plant.push({})
    plant.advance(np.zeros((1, 2)), steps)
    assert plant.state().q_rate[0, 3] == pytest.approx(rate, rel=0.02)
