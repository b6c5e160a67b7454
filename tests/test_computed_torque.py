"""Runs that wheel torques drive: computed torque inside any law, and laws of one's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.controllers.shared.computed_torque import WantedWheels
from ttwmr_mj.dynamics.torques import spun_mass_matrix
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.metrics import score
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.compare.measures.residuals import Residuals
from ttwmr_mj.studies.compare.motion import run_contact
from ttwmr_mj.studies.compare.pair import run_pair
from ttwmr_mj.studies.compare.study import Options, compare_scenario

COMPUTED = "control.inner_loop=computed_torque"
ON_IT = 'initial={kind="on_reference"}'  # nothing to work off
LAW = """
import numpy as np
from ttwmr_mj.controllers.base import Command, Controller

class Push(Controller):
    def start(self, task):
        self.nsim = task.nsim

    def command(self, k, estimate):
        clear = np.zeros(self.nsim, dtype=bool)
        return Command(np.zeros((self.nsim, 2)), clear, clear, {}, TORQUE)
"""


def drive(name: str, *overrides: str, folder: Path | None = None, nsim: int = 1) -> Result:
    return Experiment(load_scenario(name, list(overrides)), folder, nsim).run()


def numbers(result: Result) -> dict:
    (found,) = score(result.trajectory, result.scenario.robot)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["contact", "analytic"])
def test_the_inverted_trailer_is_held_as_well_as_by_velocity_servos(plant: str) -> None:
    sets = ["duration_s=18.0", ON_IT, f"plant.kind={plant}"]
    servo, torque = (numbers(drive("inverted_trailer", *sets, *more)) for more in ([], [COMPUTED]))
    # what is left of the start after 9 s: 3 µm at most on a circle of 0.6 m, fading by 0.5 1/s
    for found in (servo, torque):
        assert found["steady_centre_of_oscillation_rmse_m"] < 5e-6
        assert found["steady_theta2_rmse_rad"] < 1e-5


@pytest.mark.slow
def test_motors_with_an_encoder_of_0_3_degrees_hold_it_too() -> None:
    found = numbers(
        drive("inverted_trailer", "duration_s=12.0", ON_IT, COMPUTED, "robot.servo.motor={}")
    )
    # measured 0.085 mm; feedback of speeds alone, in steps of 0.5 rad/s, gave 4 mm
    assert found["steady_centre_of_oscillation_rmse_m"] < 3e-4


@pytest.mark.parametrize(("share", "stable"), [(1.3, True), (1.5, False)])
def test_wheels_return_to_where_they_shall_be_below_the_stated_gain(
    share: float, stable: bool
) -> None:
    """λT < 1.40: a wheel of unit inertia that obeys, 0.1 rad from where it shall be."""
    period, none = 0.033, np.zeros((1, 2), dtype=np.bool_)
    wanted = WantedWheels(np.zeros((1, 2)), np.ones((1, 2)), period)
    angle, speed, errors = np.full((1, 2), 0.1), np.ones((1, 2)), []
    for _ in range(100):
        rate = wanted.rate(angle, np.ones((1, 2)), share / period)
        wanted.move(angle, np.ones((1, 2)), none)
        angle = angle + period * speed + 0.5 * period**2 * rate
        speed = speed + period * rate
        errors.append(abs(float(speed[0, 0]) - 1.0))
    assert (max(errors[-10:]) < 0.1 * max(errors[:10])) == stable


def test_a_wheel_whose_torque_was_cut_owes_no_angle() -> None:
    wanted = WantedWheels(np.zeros((1, 2)), np.zeros((1, 2)), 0.1)
    wanted.move(np.zeros((1, 2)), np.full((1, 2), 2.0), np.array([[True, False]]))
    wanted.move(np.array([[0.05, 0.05]]), np.full((1, 2), 2.0), np.array([[True, False]]))
    angle, speed = np.array([[0.25, 0.3]]), np.full((1, 2), 2.0)
    # the right one is where it was plus what it shall turn since; the left one shall be at 0.3
    np.testing.assert_allclose(wanted.rate(angle, speed, 2.0), [[0.0, -1.0]], atol=1e-12)


def test_wheels_arrive_where_the_law_wants_them_at_the_period_s_end() -> None:
    rows = drive("lab_circle", COMPUTED, "duration_s=4.0", "plant.kind=analytic").trajectory
    wanted, reached = rows.wheel_command_rad_s[:-1, 0], rows.wheel_speed_rad_s[1:, 0]
    assert np.abs(wanted).max() > 3.0
    calm = slice(60, None)  # the first seconds turn at full reach, where the bias changes most
    assert np.abs(wanted - reached)[calm].max() < 0.01


def test_the_torques_are_logged_and_within_stall() -> None:
    signals = drive("lab_circle", COMPUTED, "duration_s=2.0").trajectory.signals
    torque = np.concatenate(
        [signals["wheel_torque_right_n_m"], signals["wheel_torque_left_n_m"]], axis=1
    )
    assert 0.001 < np.abs(torque).max() < 1.62


def test_friction_that_is_not_believed_leaves_the_wheels_behind() -> None:
    """By what it takes of their acceleration over λ²/4, straight ahead at constant speed."""
    segment = "{duration_s=4.0, wheel_right_rad_s=3.0, wheel_left_rad_s=3.0}"
    straight = f'controller={{kind="open_loop", segments=[{segment}]}}'
    sets = ["duration_s=3.96", COMPUTED, "robot.servo.motor={}", straight]
    unaware = "belief.robot.servo.motor.gear_friction_n_m=0.0"
    runs = [drive("open_loop_turn", *sets, *more) for more in ([], [unaware])]
    ends = [run.trajectory.q[-1, 0] for run in runs]
    robot = runs[0].scenario.robot
    motor, radius = robot.servo.motor, robot.tractor.wheel_radius_m
    assert motor is not None
    inertia = 0.5 * radius**2 * spun_mass_matrix(ends[0], robot)[0, 0]
    behind = motor.gear_friction_n_m / inertia / (0.25 * 20.0**2)
    # an encoder count is 0.13 mm at the rim, and the back-EMF is known late
    assert np.hypot(*(ends[0] - ends[1])[:2]) == pytest.approx(radius * behind, rel=0.1)


def test_a_batch_under_torques_is_its_single_runs() -> None:
    sets = ["duration_s=1.0", COMPUTED, "robot.servo.motor={}"]
    many, one = drive("inverted_trailer", *sets, nsim=3), drive("inverted_trailer", *sets)
    for i in range(3):
        assert np.array_equal(many.trajectory.q[:, i], one.trajectory.q[:, 0])


def test_both_plants_agree_under_torques() -> None:
    """In open loop the analytic plant gets the contact run's torques."""
    pair = run_pair(load_scenario("lab_circle", [COMPUTED, "duration_s=5.0"]))
    found = pair.numbers
    # 0.7 mm in 10 s are the inertia of the balls, a thousandth of the robot's, integrated twice
    assert found["position_deviation_max_m"] < 1e-3
    assert found["theta2_deviation_max_rad"] < 5e-3


def test_the_energy_account_knows_torques_and_motors() -> None:
    sets = ["duration_s=2.0", COMPUTED]
    lost = Residuals.of(run_contact(load_scenario("lab_circle", sets))).energy_lost_j[-1]
    assert 0.0 < lost < 1e-3  # slip
    run = run_contact(load_scenario("lab_circle", ["duration_s=2.0", "robot.servo.motor={}"]))
    lost = Residuals.of(run).energy_lost_j[-1]
    motor, wheels = run.robot.servo.motor, run.physics.wheel_speed_rad_s[1:]
    assert motor is not None
    power = motor.gear_friction_n_m * np.abs(wheels) + motor.gear_damping_n_m_s_rad * wheels**2
    burnt = power.sum() * run.scenario.plant.contact.timestep_s
    assert lost == pytest.approx(burnt, rel=5e-3)


def test_no_torque_acts_before_the_first_one_has_arrived() -> None:
    sets = ["duration_s=0.33", COMPUTED, "control.command_latency_s=0.066", "initial.kind=at_rest"]
    wheels = drive("straight_line", *sets, "plant.kind=analytic").trajectory.wheel_speed_rad_s[:, 0]
    assert not wheels[:3].any()  # sample 0's torques act from 66 ms on
    assert wheels[3].all()


def test_a_model_that_wheel_speeds_drive_is_not_fitted_to_torques(tmp_path: Path) -> None:
    scenario = load_scenario("open_loop_turn", [COMPUTED])
    with pytest.raises(InputError, match="--fit"):
        compare_scenario(scenario, tmp_path, Options(fit=True))


# --- laws that give torques themselves -------------------------------------------------------


def own_law(tmp_path: Path, torque: str) -> Result:
    name = tmp_path.name  # modules are found once by name
    (tmp_path / f"{name}.py").write_text(LAW.replace("TORQUE", torque), encoding="utf-8")
    sets = [f'controller={{kind="custom", target="{name}:Push"}}', "duration_s=0.33"]
    return drive("straight_line", *sets, "control.inner_loop=torque", folder=tmp_path)


def test_a_law_of_one_s_own_may_give_torques(tmp_path: Path) -> None:
    result = own_law(tmp_path, "np.full((self.nsim, 2), 0.01)")
    assert result.outcomes[0].status == "ok"
    assert result.trajectory.wheel_speed_rad_s[-1].min() > 1.0


@pytest.mark.parametrize(
    ("torque", "words"),
    [
        ("None", "there are no wheel torques"),
        ("np.zeros(2)", r"wheel torques have shape (2,), allowed: (1, 2)"),
        ("np.full((1, 2), np.nan)", "wheel torques are not finite"),
    ],
)
def test_a_law_without_sound_torques_ends_the_run(tmp_path: Path, torque: str, words: str) -> None:
    outcome = own_law(tmp_path, torque).outcomes[0]
    assert outcome.status == "failed"
    assert words in outcome.reason
