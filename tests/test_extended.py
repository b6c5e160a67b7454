"""The extended model: its forces against the kinetic model and against virtual power."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.api import simulate
from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics import hitch, kinematics, kinetics
from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.dynamics.floor.ground import GRAVITY_M_S2
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.extended import ExtendedPlant
from ttwmr_mj.robot import Hitch, RobotParameters
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import FloatArray, RobotState
from ttwmr_mj.studies.compare.variants import changed

ROBOT = RobotParameters(hitch=Hitch(stiffness_n_m_rad=0.3, damping_n_m_s_rad=0.02))
RNG = np.random.default_rng(7)
N = 20
STATE = np.vstack([RNG.normal(size=(2, N)), RNG.uniform(-3.0, 3.0, (2, N)), RNG.normal(size=N)])
WHEELS, WHEELS_RATE = RNG.uniform(-6.0, 6.0, (N, 2)), RNG.uniform(-50.0, 50.0, (N, 2))
Q = STATE[:4].T
HITCH = Q[:, 3] - Q[:, 2]
TWIST = kinematics.twist_from_wheels(WHEELS, ROBOT)
TWIST_RATE = kinematics.twist_from_wheels(WHEELS_RATE, ROBOT)
LAG_S = 1e-9  # so small that what it changes is proportional to it


def rate(
    lead_s: float = 0.0, state: FloatArray = STATE, wheels: FloatArray = WHEELS, **values: float
) -> FloatArray:
    """(5, N) rates of a robot that has nothing beyond Table I but these."""
    ideal = dict.fromkeys(ExtendedParameters.model_fields, 0.0)
    ideal |= {"wheel_radius_m": ROBOT.tractor.wheel_radius_m}
    ideal |= {"track_width_m": ROBOT.tractor.track_width_m}
    ideal |= {"hitch_damping_n_m_s_rad": ROBOT.hitch.damping_n_m_s_rad}
    model = ExtendedModel(ROBOT, {**ideal, **values}, 0.0)
    return model.rate(state, wheels, WHEELS_RATE, np.full((N, 2), lead_s))


def push(**values: float) -> FloatArray:
    """(N, 2) force f and torque τ that the wheels push with, from what they lag behind by."""
    short = rate(servo_time_constant_s=LAG_S, **values) - rate(**values)
    ahead = short[0] * np.cos(Q[:, 2]) + short[1] * np.sin(Q[:, 2])
    wheels = kinematics.wheels_from_twist(np.stack([ahead, short[2]], axis=-1), ROBOT)
    inertia = wheel_inertia(ROBOT)[0] + ROBOT.servo.reflected_inertia_kg_m2
    force = -(wheels / LAG_S + WHEELS_RATE) * inertia / ROBOT.tractor.wheel_radius_m
    return np.stack([force.sum(axis=1), ROBOT.half_track_m * (force[:, 0] - force[:, 1])], axis=-1)


def resistance(
    resistance_m: float, spacing_m: float, aside: FloatArray | float = 0.0
) -> FloatArray:
    """(N, 3) generalized force over (s, θ1, θ2) of the balls' resistance, by virtual power.

    Returns −Σ |F|·∂|v|/∂ξ̇ with the speeds of the balls from their places; P slips aside [m/s].
    """
    casters, trailer, tractor = ROBOT.casters, ROBOT.trailer, ROBOT.tractor
    nose = tractor.mass_kg * tractor.com_offset_m / casters.tractor_position_m
    balls = [(Q[:, 2], 1, (casters.tractor_position_m, 0.0), nose)]
    for side in (-1.0, 1.0):
        place = (-trailer.com_offset_m, side * spacing_m)
        balls.append((Q[:, 3], 2, place, 0.5 * trailer.mass_kg))

    def power(workspace_rate: FloatArray) -> FloatArray:
        total = np.zeros(N)
        for angle, column, (x, y), mass in balls:
            cos, sin = np.cos(angle), np.sin(angle)
            turn, speed = workspace_rate[:, column], workspace_rate[:, 0]
            vx, vy = kinematics.to_world(Q[:, 2], speed, aside)
            vx, vy = vx - turn * (x * sin + y * cos), vy + turn * (x * cos - y * sin)
            total -= mass * GRAVITY_M_S2 * resistance_m / casters.radius_m * np.hypot(vx, vy)
        return total

    xi, step = np.column_stack([TWIST, STATE[4]]), 1e-6
    columns = [
        (power(xi + step * unit) - power(xi - step * unit)) / (2.0 * step) for unit in np.eye(3)
    ]
    return np.stack(columns, axis=-1)


def kinetic_force() -> tuple[FloatArray, FloatArray]:
    """f, τ (N, 2) and θ̈2 (N,) of Eq. 23 for the commanded motion."""
    xi = np.column_stack([TWIST, STATE[4]])
    torque = hitch.spring_damper_torque(HITCH, xi[:, 2] - xi[:, 1], ROBOT.hitch)
    mass, bias = kinetics.reduced_mass_matrix(Q, ROBOT), kinetics.reduced_bias(Q, xi, ROBOT)
    known = np.einsum("nij,nj->ni", mass[:, :, :2], TWIST_RATE) + bias
    swing = (torque - known[:, 2]) / mass[:, 2, 2]
    force = known[:, :2] + mass[:, :2, 2] * swing[:, None]
    force[:, 1] += torque
    return force, swing


def test_without_extras_it_is_the_kinetic_model() -> None:
    force, swing = kinetic_force()
    got = rate()
    np.testing.assert_allclose(got[:2].T, kinematics.q_rate(Q, np.c_[TWIST, STATE[4]])[:, :2])
    np.testing.assert_allclose(got[2], TWIST[:, 1], rtol=1e-12)
    np.testing.assert_array_equal(got[3], STATE[4])
    np.testing.assert_allclose(got[4], swing, rtol=1e-10, atol=1e-10)
    # a lag of 1 ns is seen with some seven digits
    np.testing.assert_allclose(push(), force, rtol=1e-4, atol=1e-4)


def test_rolling_resistance_does_the_power_it_should() -> None:
    size = 1e-4
    generalized = resistance(size, ROBOT.casters.trailer_half_spacing_m)
    inertia = ROBOT.swing_inertia_kg_m2
    turned = rate(rolling_resistance_m=size)[4] - rate()[4]
    # velocities fade below 1e-4 m/s: of 0.1 m/s, one in a million
    np.testing.assert_allclose(turned, generalized[:, 2] / inertia, rtol=1e-3, atol=1e-3)
    # what the wheels push against; the trailer's two balls are taken together there
    more = push(rolling_resistance_m=size) - push()
    tail = ROBOT.trailer.mass_kg * ROBOT.trailer.com_offset_m
    reaction = tail * np.sin(HITCH) * generalized[:, 2] / inertia
    pushed = reaction - resistance(size, 0.0)[:, 0]
    np.testing.assert_allclose(more[:, 0], pushed, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(more[:, 1], -generalized[:, 1], atol=1e-4)


def test_rolling_resistance_acts_along_the_slip_as_well() -> None:
    size, slip = 1e-4, 0.5  # s; P slips aside about as fast as it goes ahead
    aside = -slip * TWIST[:, 0] * TWIST[:, 1]
    generalized = resistance(size, ROBOT.casters.trailer_half_spacing_m, aside)
    turned = rate(rolling_resistance_m=size, slip_time_s=slip)[4] - rate(slip_time_s=slip)[4]
    expected = generalized[:, 2] / ROBOT.swing_inertia_kg_m2
    np.testing.assert_allclose(turned, expected, rtol=1e-3, atol=1e-3)  # as without slip


def test_balls_add_the_inertia_of_their_rolling() -> None:
    mass, casters = 0.05, ROBOT.casters
    balls = 2.0 * 0.4 * mass  # 2/5 of the mass, rolling on the floor at its place
    length = ROBOT.trailer.com_offset_m
    inertia = ROBOT.swing_inertia_kg_m2 + balls * (length**2 + casters.trailer_half_spacing_m**2)
    pull = (ROBOT.trailer.mass_kg + balls) * length
    sway = TWIST[:, 0] * TWIST[:, 1] * np.cos(HITCH) - TWIST_RATE[:, 0] * np.sin(HITCH)
    torque = hitch.spring_damper_torque(HITCH, STATE[4] - TWIST[:, 1], ROBOT.hitch)
    expected = (pull * sway + torque) / inertia
    np.testing.assert_allclose(rate(caster_mass_kg=mass)[4], expected, rtol=1e-10, atol=1e-10)


def test_side_slip_moves_p_outward_and_the_trailer_with_it() -> None:
    slip, step = 1e-3, 1e-6

    def velocity(time_s: float) -> FloatArray:
        """(N, 2) of P: ahead at u1 and aside at −s·u1·u2, a moment later."""
        u1, u2 = (TWIST + time_s * TWIST_RATE).T
        heading = Q[:, 2] + time_s * u2
        return np.stack(kinematics.to_world(heading, u1, -slip * u1 * u2), axis=-1)

    got = rate(slip_time_s=slip)
    np.testing.assert_allclose(got[:2].T, velocity(0.0), rtol=1e-12)
    acceleration = (velocity(step) - velocity(-step)) / (2.0 * step)
    cos, sin = np.cos(Q[:, 3]), np.sin(Q[:, 3])
    sway = acceleration[:, 1] * cos - acceleration[:, 0] * sin
    torque = hitch.spring_damper_torque(HITCH, STATE[4] - TWIST[:, 1], ROBOT.hitch)
    expected = sway / ROBOT.swing_length_m + torque / ROBOT.swing_inertia_kg_m2
    np.testing.assert_allclose(got[4], expected, rtol=1e-6, atol=1e-6)


def test_the_swing_rate_and_its_kick_are_one_motion() -> None:
    """With wheels ahead by a time, θ̇2 is another by the impulse that their jump gives."""
    lead = 1e-3
    jump = lead * TWIST_RATE[:, 0]
    pull = ROBOT.trailer.mass_kg * ROBOT.trailer.com_offset_m / ROBOT.swing_inertia_kg_m2
    got = rate(lead_s=lead)
    np.testing.assert_allclose(got[3], STATE[4] - pull * jump * np.sin(HITCH), rtol=1e-12)
    np.testing.assert_allclose(got[2], TWIST[:, 1] + lead * TWIST_RATE[:, 1], rtol=1e-9)
    # the swing rate is θ̇2 + pull·jump·sin φ, so its own rate is θ̈2 + pull·jump·cos φ·φ̇
    moving = rate(state=np.vstack([STATE[:4], got[3]]), wheels=WHEELS + lead * WHEELS_RATE)
    turned = pull * jump * np.cos(HITCH) * (got[3] - got[2])
    np.testing.assert_allclose(got[4], moving[4] + turned, rtol=1e-9)


RUBBING = "{damping_n_m_s_rad=1e-3, coulomb_friction_n_m=5e-5}"


def turned(name: str, step_s: float, *, extended: bool, duration_s: float = 8.0) -> FloatArray:
    """(n, trailers) angles under wheels that turn, of hitches that turn round, stop and stick."""
    hitches = f"hitch={RUBBING}" if name == "open_loop_turn" else f"hitches=[{RUBBING}, {RUBBING}]"
    table = (
        "plant.analytic.extended={wheel_radius_m=0.026, track_width_m=0.119, physics_step_s=0.0, "
        "hitch_damping_n_m_s_rad=1e-3, hitch_coulomb_friction_n_m=5e-5}"
    )
    changes = [f"duration_s={duration_s}", f"robot.{hitches}", "plant.kind=analytic"]
    changes += [f"plant.analytic.max_step_s={step_s}", *[table] * extended]
    return simulate(load_scenario(name, changes)).trajectory.q[:, 0, 3:]


@pytest.mark.parametrize(
    ("name", "off_rad"),
    [("open_loop_turn", 1e-6), pytest.param("two_trailers_turn", 1e-4, marks=pytest.mark.slow)],
)
def test_dry_friction_is_in_long_steps_what_the_other_model_has_in_short_ones(
    name: str, off_rad: float
) -> None:
    exact = turned(name, 0.001, extended=False)
    assert np.abs(exact).max() > 0.1
    assert np.abs(turned(name, 0.033, extended=True) - exact).max() < off_rad


def test_next_to_no_dry_friction_does_next_to_nothing() -> None:
    """A fit starts there: where hitches turn round, and where one starts from rest."""
    scenario = load_scenario("lab_circle", ["plant.kind=analytic", "duration_s=3.0"])
    none, little = (
        simulate(
            changed(
                scenario,
                {
                    "plant.analytic.extended": ExtendedParameters(
                        wheel_radius_m=0.026,
                        track_width_m=0.119,
                        hitch_coulomb_friction_n_m=friction_n_m,
                    ).model_dump()
                },
            )
        ).trajectory.q
        for friction_n_m in (0.0, 1e-12)
    )
    # 1e-12 N·m on 7.3e-3 kg·m² turn it by 6e-10 rad in 3 s, and steps cut in two are other steps
    np.testing.assert_allclose(little, none, atol=5e-9)


@pytest.mark.parametrize(("stiffness", "damping"), [(300.0, 0.0), (0.5, 2.0), (0.0, 2.0)])
def test_steps_beyond_the_stability_limit_are_rejected(stiffness: float, damping: float) -> None:
    robot = RobotParameters(hitch=Hitch(stiffness_n_m_rad=stiffness))
    expected = ExtendedParameters.expected(robot).model_copy(
        update={"hitch_damping_n_m_s_rad": damping, "hitch_coulomb_friction_n_m": 0.0}
    )
    model = ExtendedModel.of(robot, expected)
    inertia = float(model.swing_inertia_kg_m2)
    linear = np.array([[0.0, 1.0], [-stiffness / inertia, -damping / inertia]])
    longest_s = 2.6 / float(np.abs(np.linalg.eigvals(linear)).max())
    with pytest.raises(InputError, match="too stiff") as error:
        ExtendedPlant(model, 1, 0.033, 1.001 * longest_s)
    assert error.value.faults[0].key == ("plant", "analytic", "max_step_s")
    plant = ExtendedPlant(model, 1, 0.033, 0.999 * longest_s)
    plant.reset(RobotState(q=np.array([[0.0, 0.0, 0.0, 0.5]]), q_rate=np.zeros((1, 4))))
    for _ in range(10):
        plant.advance(np.zeros((1, 2)), 1)
    assert abs(plant.state().q[0, 3]) <= 0.51  # never beyond its start


@pytest.mark.parametrize(
    ("name", "lever_m"),
    [
        ("open_loop_turn", 1e-4),
        ("open_loop_turn", 1e-2),
        pytest.param("two_trailers_turn", 1e-4, marks=pytest.mark.slow),
    ],
)
def test_balls_that_resist_bring_the_trailers_to_rest(name: str, lever_m: float) -> None:
    """With steps of 33 ms a ball nearly at rest would be thrown to and fro for ever."""
    extended = f"{{wheel_radius_m=0.026, track_width_m=0.119, rolling_resistance_m={lever_m}}}"
    changes = ["plant.kind=analytic", f"plant.analytic.extended={extended}", "duration_s=25.0"]
    run = simulate(load_scenario(name, [*changes, "plant.analytic.max_step_s=0.033"])).trajectory
    still = np.diff(run.wheel_speed_rad_s[:, 0], axis=0).any(axis=1).nonzero()[0][-1] + 300
    assert still < len(run.time_s) - 30
    assert np.abs(run.q_rate[still:, 0, 3:]).max() < 1e-9
    assert np.ptp(run.q[still:, 0], axis=0).max() < 1e-8
