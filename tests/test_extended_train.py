"""The extended model of trains: as for one trailer, as the kinetic model, and in its limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from comparisons import open_loop

from ttwmr_mj.composite import wheel_inertia
from ttwmr_mj.dynamics import kinematics, kinetics, train
from ttwmr_mj.dynamics.extended.one_trailer import ExtendedModel
from ttwmr_mj.dynamics.extended.parameters import ExtendedParameters
from ttwmr_mj.dynamics.extended.train import ExtendedTrain, extended_model
from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.servo import Stretches
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.extended import ExtendedPlant
from ttwmr_mj.robot import Hitch, RobotParameters, Trailer
from ttwmr_mj.runs.build import make_plant
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.fit.fit import fit
from ttwmr_mj.studies.compare.motion import run_contact
from ttwmr_mj.studies.compare.variants import changed

RNG = np.random.default_rng(5)
N = 12
HITCH = Hitch(stiffness_n_m_rad=0.1, damping_n_m_s_rad=0.02)
SLOPE = Ground(slope_rad=0.02, downhill_rad=0.4)
WHEELS, WHEELS_RATE = RNG.uniform(-6.0, 6.0, (N, 2)), RNG.uniform(-50.0, 50.0, (N, 2))
LEAD_S = RNG.uniform(0.0, 1e-3, (N, 2))
LAG_S = 1e-9  # so small that what it changes is proportional to it


def robot_with(trailers: int, lateral_m: float = 0.01) -> RobotParameters:
    """Trailers that differ, the first with a load off its axis."""
    towing = [
        Trailer(mass_kg=0.4 - 0.05 * i, next_hitch_offset_m=0.23 + 0.02 * i)
        for i in range(trailers - 1)
    ]
    parts = [*towing, Trailer(mass_kg=0.3)]
    parts[0] = parts[0].model_copy(update={"com_lateral_m": lateral_m})
    return RobotParameters(trailers=tuple(parts), hitches=(HITCH,) * trailers)


def state_of(trailers: int) -> FloatArray:
    """(3 + 2n, N)."""
    return np.vstack([RNG.normal(size=(2, N)), RNG.uniform(-3.0, 3.0, (1 + 2 * trailers, N))])


def bare(robot: RobotParameters, **values: float) -> ExtendedTrain:
    """A robot that has nothing beyond its own numbers but these, on a slope."""
    ideal = dict.fromkeys(ExtendedParameters.model_fields, 0.0)
    ideal["wheel_radius_m"] = robot.tractor.wheel_radius_m
    ideal["track_width_m"] = robot.tractor.track_width_m
    ideal["hitch_damping_n_m_s_rad"] = HITCH.damping_n_m_s_rad
    return ExtendedTrain(robot, {**ideal, **values}, 0.0, SLOPE)


def test_with_one_trailer_it_is_the_model_of_one() -> None:
    robot, state = robot_with(1), state_of(1)
    parameters = ExtendedParameters(
        wheel_radius_m=0.0261,
        track_width_m=0.12,
        servo_time_constant_s=1e-3,
        hitch_damping_n_m_s_rad=3e-3,
        hitch_coulomb_friction_n_m=1e-3,
        caster_mass_kg=5e-3,
    )
    one, many = (kind.of(robot, parameters, SLOPE) for kind in (ExtendedModel, ExtendedTrain))
    moved = WHEELS, WHEELS_RATE, LEAD_S
    np.testing.assert_allclose(many.rate(state, *moved), one.rate(state, *moved), rtol=1e-11)
    stretch = Stretches(np.full(N, 0.02), WHEELS, WHEELS_RATE, LEAD_S)
    np.testing.assert_allclose(many.step(state, stretch), one.step(state, stretch), rtol=1e-11)
    # rolling resistance drags P by the middle of the two balls there, by each of them here
    resisting = parameters.model_copy(update={"rolling_resistance_m": 1e-4})
    one, many = (kind.of(robot, resisting, SLOPE) for kind in (ExtendedModel, ExtendedTrain))
    ours, theirs = many.rate(state, *moved), one.rate(state, *moved)
    np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=1e-3)
    assert np.abs(ours[-1] - one.rate(state, *moved)[-1]).max() < 1e-3
    assert [extended_model(robot_with(n)) for n in (1, 2)] == [ExtendedModel, ExtendedTrain]


@pytest.mark.parametrize("trailers", [2, 3])
def test_without_extras_it_is_the_kinetic_model(trailers: int) -> None:
    robot, state = robot_with(trailers), state_of(trailers)
    q, rates = state[: 3 + trailers].T, state[3 + trailers :].T
    twist = kinematics.twist_from_wheels(WHEELS, robot)
    twist_rate = kinematics.twist_from_wheels(WHEELS_RATE, robot)
    xi = np.column_stack([twist, rates])
    hitches = np.diff(q[:, 2:], axis=1), np.diff(xi[:, 1:], axis=1)
    torque = train.hitch_torques(*hitches, robot)
    # Eq. 23 of a train, on a slope: M·ξ̈ + bias + Sᵀ·G = E·u + hitches
    mass, known = kinetics.reduced_mass_matrix(q, robot), kinetics.reduced_bias(q, xi, robot)
    weight = kinetics.gravity(q, SLOPE.gravity_m_s2, robot)
    known = known + np.einsum("nji,nj->ni", kinematics.null_space(q), weight)
    known = known + np.einsum("nij,nj->ni", mass[:, :, :2], twist_rate)
    load = train.on_trailers(torque) - known[:, 2:]
    swing = np.linalg.solve(mass[:, 2:, 2:], load[..., None])[..., 0]
    force = known[:, :2] + np.einsum("nij,nj->ni", mass[:, :2, 2:], swing)
    force[:, 1] += torque[:, 0]

    still = np.zeros((N, 2))
    got = bare(robot).rate(state, WHEELS, WHEELS_RATE, still)
    np.testing.assert_allclose(got[2], twist[:, 1], rtol=1e-12)
    np.testing.assert_array_equal(got[3 : 3 + trailers].T, rates)
    np.testing.assert_allclose(got[3 + trailers :].T, swing, rtol=1e-9, atol=1e-9)
    # what the wheels push with, from what a lag of 1 ns, seen with some seven digits, costs
    lagging = bare(robot, servo_time_constant_s=LAG_S)
    short = lagging.rate(state, WHEELS, WHEELS_RATE, still) - got
    ahead = short[0] * np.cos(q[:, 2]) + short[1] * np.sin(q[:, 2])
    late = kinematics.wheels_from_twist(np.stack([ahead, short[2]], axis=-1), robot)
    inertia = wheel_inertia(robot)[0] + robot.servo.reflected_inertia_kg_m2
    pushed = -(late / LAG_S + WHEELS_RATE) * inertia / robot.tractor.wheel_radius_m
    spin = robot.half_track_m * (pushed[:, 0] - pushed[:, 1])
    np.testing.assert_allclose(pushed.sum(axis=1), force[:, 0], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(spin, force[:, 1], rtol=1e-4, atol=1e-4)


def test_rolling_balls_are_masses_that_gravity_does_not_pull() -> None:
    robot, state, mass = robot_with(3, lateral_m=0.0), state_of(3), 0.05
    balls = 2.0 * 0.4 * mass  # 2/5 of the mass of each
    heavier = tuple(
        trailer.model_copy(
            update={
                "mass_kg": trailer.mass_kg + balls,
                "yaw_inertia_kg_m2": trailer.yaw_inertia_kg_m2
                + balls * robot.casters.trailer_half_spacing_m**2,
            }
        )
        for trailer in robot.trailers
    )
    same = robot.model_copy(update={"trailers": heavier})
    level = Ground()
    still = np.zeros((N, 2))
    got = replace(bare(robot, caster_mass_kg=mass), ground=level)
    expected = replace(bare(same), ground=level).rate(state, WHEELS, WHEELS_RATE, still)
    np.testing.assert_allclose(
        got.rate(state, WHEELS, WHEELS_RATE, still), expected, rtol=1e-9, atol=1e-9
    )
    # on the slope what gravity does to each is that of the robot without them
    pulled = bare(robot, caster_mass_kg=mass).rate(state, WHEELS, WHEELS_RATE, still)[6:]
    weighed = replace(bare(same), ground=SLOPE).rate(state, WHEELS, WHEELS_RATE, still)[6:]
    assert np.abs(pulled - weighed).max() > 0.1 * np.abs(weighed - expected[6:]).max()


def test_rolling_resistance_slows_every_trailer() -> None:
    """Its torques do as much work as is lost: in time, what is in the trailers falls."""
    robot, state = robot_with(2), state_of(2)
    still, size = np.zeros((N, 2)), 1e-4
    turned = bare(robot, rolling_resistance_m=size).rate(state, still, still, still)
    turned = turned - bare(robot).rate(state, still, still, still)
    theta, rates = state[3:5].T, state[5:].T
    work = np.einsum("ni,nij,nj->n", rates, train.swing_matrix(theta, robot), turned[5:].T)
    assert np.all(work < 0.0)


def test_the_swing_rates_and_their_kicks_are_one_motion() -> None:
    """With wheels ahead by a time, rates are others by what the jump of P's velocity gives them."""
    robot, state, lead, step = robot_with(3), state_of(3), 1e-3, 1e-6
    model, ahead = bare(robot), np.full((N, 2), lead)
    q, swing = state[:6].T, state[6:].T
    got = model.rate(state, WHEELS, WHEELS_RATE, ahead)
    jump = lead * kinematics.twist_from_wheels(WHEELS_RATE, robot)[:, 0]

    def kick(now: FloatArray) -> FloatArray:
        """(N, n) of q (N, 6): an impulse of P's velocity along the tractor."""
        velocity = np.stack(kinematics.to_world(now[:, 2], jump, 0.0 * jump), axis=-1)
        moment = train.pivot_torque(now[:, 3:], velocity, robot)
        return np.linalg.solve(train.swing_matrix(now[:, 3:], robot), moment[..., None])[..., 0]

    np.testing.assert_allclose(got[3:6].T, swing + kick(q), rtol=1e-9, atol=1e-12)
    # the rate that moves on is that of the wheels as they are; its kick's change goes off again
    moving = np.vstack([state[:6], got[3:6]])
    plain = model.rate(moving, WHEELS + lead * WHEELS_RATE, WHEELS_RATE, np.zeros((N, 2)))
    turn = got[:6].T
    change = (kick(q + step * turn) - kick(q - step * turn)) / (2.0 * step)
    # P's acceleration turns with its heading: that part is in both, so that only the change counts
    np.testing.assert_allclose(got[6:].T, plain[6:].T - change, rtol=1e-6, atol=1e-6)


def test_dry_friction_holds_what_it_can_and_slows_the_rest() -> None:
    robot, state = robot_with(3), state_of(3)
    state[6:] = 0.5  # as fast as the tractor turns: hitches at rest
    turn, h, limit = np.full(N, 0.5), 1e-6, 0.02
    wheels = kinematics.wheels_from_twist(np.stack([0.0 * turn, turn], axis=-1), robot)
    stretch = Stretches(np.full(N, h), wheels, 0.0 * wheels, 0.0 * wheels)
    after, free = (
        bare(robot, hitch_coulomb_friction_n_m=friction).step(state, stretch)
        for friction in (limit, 0.0)
    )
    sliding = np.diff(after[6:].T, axis=1, prepend=turn[:, None])
    held = np.abs(sliding) < 1e-15  # of accelerations of 0.1 rad/s² and more
    assert held.any()
    assert (~held).any()
    matrix = train.swing_matrix(state[3:6].T, robot)
    between = np.eye(3) - np.eye(3, k=-1)
    torque = np.einsum("nij,nj->ni", matrix, (after[6:] - free[6:]).T / h) @ np.linalg.inv(between)
    # the halves of a hitch get opposite torques: within the limit, and at it where it slides
    assert np.abs(torque[held]).max() < limit
    np.testing.assert_allclose(np.abs(torque[~held]), limit, rtol=1e-4)
    assert np.all((torque * sliding)[~held] < 0.0)
    # a hitch that is held stays as it is over a step, however its halves move and pull
    strong = bare(robot, hitch_coulomb_friction_n_m=5.0)
    end = strong.step(state, Stretches(np.full(N, 0.01), wheels, 0.0 * wheels, 0.0 * wheels))
    np.testing.assert_allclose(np.diff(end[2:6], axis=0), np.diff(state[2:6], axis=0), atol=1e-15)
    np.testing.assert_allclose(end[6:], 0.5, rtol=1e-9)


@pytest.mark.slow
def test_hitches_that_stick_and_slip_do_so_in_long_steps_as_in_short_ones() -> None:
    """From where every hitch is at rest, on circles that hold some of them and turn others."""
    robot = robot_with(2, lateral_m=0.0).model_copy(update={"hitches": (Hitch(),) * 2})
    frictional = {"hitch_damping_n_m_s_rad": 0.0, "hitch_coulomb_friction_n_m": 3e-3}
    model = replace(bare(robot, **frictional), ground=Ground())
    rng, n = np.random.default_rng(3), 40
    turn = rng.uniform(-1.0, 1.0, n)
    twist = np.stack([rng.uniform(0.05, 0.2, n), turn], axis=-1)
    wheels = kinematics.wheels_from_twist(twist, robot)
    start = np.vstack([np.zeros((3, n)), rng.uniform(-1.0, 1.0, (2, n)), turn, turn])

    def after(steps: int) -> FloatArray:
        state, still = start, 0.0 * wheels
        for _ in range(steps):
            state = model.step(state, Stretches(np.full(n, 0.6 / steps), wheels, still, still))
        return state

    fine = after(600)
    stuck = np.diff(fine[2:5], axis=0) == np.diff(start[2:5], axis=0)
    assert 0.1 < stuck.mean() < 0.9
    # of second order in the step: 42 µrad at worst in steps of 33 ms
    off = np.abs(after(18) - fine)[3:5]
    assert off.max() < 1e-4
    assert np.median(off) < 1e-8


def test_a_row_is_the_same_bits_in_any_batch() -> None:
    base = [
        "plant.kind=analytic",
        "plant.analytic.extended={wheel_radius_m=0.026, track_width_m=0.119, slip_time_s=7e-4, "
        "hitch_coulomb_friction_n_m=1e-4, caster_mass_kg=1e-3, rolling_resistance_m=1e-5}",
    ]
    scenario = load_scenario("two_trailers_turn", base)
    damped = changed(scenario, {"plant.analytic.extended.hitch_damping_n_m_s_rad": 1e-3})
    from ttwmr_mj.config import stacked

    def driven(*rows: object) -> FloatArray:
        plant = make_plant(stacked(rows), len(rows))  # type: ignore[arg-type]
        for command in RNG_COMMANDS:
            plant.advance(np.tile(command, (len(rows), 1)), 3)
        return plant.state().q

    together, apart = driven(scenario, damped, scenario), (driven(scenario), driven(damped))
    np.testing.assert_array_equal(together[0], apart[0][0])
    np.testing.assert_array_equal(together[1], apart[1][0])
    np.testing.assert_array_equal(together[2], together[0])
    assert np.abs(together[1] - together[0]).max() > 1e-6


RNG_COMMANDS = np.random.default_rng(1).uniform(1.0, 6.0, (5, 2))


def test_stiff_hitches_are_refused() -> None:
    robot = robot_with(2).model_copy(update={"hitches": (Hitch(stiffness_n_m_rad=300.0),) * 2})
    parameters = ExtendedParameters(wheel_radius_m=0.026, track_width_m=0.119)
    with pytest.raises(InputError, match="too stiff"):
        ExtendedPlant(ExtendedTrain.of(robot, parameters), 1, 0.033, 0.033)
    loose = robot_with(2).model_copy(update={"hitches": (Hitch(),) * 2})
    damped = parameters.model_copy(update={"hitch_damping_n_m_s_rad": 2.0})
    with pytest.raises(InputError, match="too stiff"):
        ExtendedPlant(ExtendedTrain.of(loose, damped), 1, 0.033, 0.033)
    ExtendedPlant(ExtendedTrain.of(loose, parameters), 1, 0.033, 0.033)


@pytest.mark.slow
def test_a_fit_to_two_trailers_finds_what_it_was_not_told() -> None:
    scenario = load_scenario("two_trailers_turn")
    truth = {
        "robot.hitches": [{"damping_n_m_s_rad": 2e-3, "coulomb_friction_n_m": 5e-5}] * 2,
        "robot.tractor.track_width_m": 0.118,
    }
    other = changed(scenario, {"controller.segments": UNSEEN})
    runs = [replace(run_contact(changed(one, truth)), scenario=one) for one in (scenario, other)]
    found = fit(*runs)
    assert found.parameters["track_width_m"].value == pytest.approx(0.118, rel=1e-3)
    # a turn of 8 s hardly tells damping from dry friction, and the intervals say so
    for name, value in {
        "track_width_m": 0.118,
        "slip_time_s": 7.5e-4,  # (contacts' time constant + step)/2
        "hitch_damping_n_m_s_rad": 2e-3,
        "hitch_coulomb_friction_n_m": 5e-5,
    }.items():
        low, high = found.parameters[name].confidence_95
        assert low <= value <= high, name
    factor = found.validation.factor
    assert {"theta2_deviation_rms_rad", "theta3_deviation_rms_rad"} <= set(factor)
    assert min(factor.values()) > 3.0


UNSEEN = open_loop((4.0, 3.0, 4.5), (6.0, 4.5, 3.0)).model_dump()["controller"]["segments"]
