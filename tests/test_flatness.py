"""Flat output, references built on it, the sampled model, the observer and the flatness law."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from ttwmr_mj.controllers.flatness import FlatnessOptions
from ttwmr_mj.controllers.shared.estimation.observer import Observer
from ttwmr_mj.controllers.shared.estimation.steady_kalman import ObserverOptions, kalman_gain
from ttwmr_mj.dynamics.flatness import centre_derivatives, motion_from_flat
from ttwmr_mj.dynamics.hybrid import trailer_acceleration
from ttwmr_mj.dynamics.sampled.one_trailer import SampledModel
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.flat_ellipse import FlatEllipse
from ttwmr_mj.references.shared.flat_reference import FlatReference
from ttwmr_mj.results.metrics import Metrics, score
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

ROBOT = RobotParameters(servo=Servo(preset="fast"))
PERIOD = 0.033
REFERENCES: dict[str, FlatReference] = {
    "outside": FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0),
    "inside": FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0, side="inside"),
    "clockwise": FlatCircle(radius_m=0.5, angular_rate_rad_s=-0.8, phase_rad=1.0),
    "ellipse": FlatEllipse(half_axes_m=(0.6, 0.4), angular_rate_rad_s=0.9, tilt_rad=0.3),
    "ellipse inside": FlatEllipse(half_axes_m=(0.6, 0.5), angular_rate_rad_s=-0.7, side="inside"),
}
CAMERA_LIKE = [
    "sensing.position_noise_m=0.0002",
    "sensing.angle_noise_rad=0.001",
    "sensing.velocity_noise_m_s=0.0086",  # 0.2 mm differentiated over a period
    "sensing.rate_noise_rad_s=0.043",
    "sensing.latency_s=0.033",
]
DRY_HITCH = ["robot.hitch.coulomb_friction_n_m=0.001"]


def scored(name: str, *overrides: str) -> Metrics:
    scenario = load_scenario(name, list(overrides))
    result = Experiment(scenario).run()
    assert result.outcomes[0].status == "ok", result.outcomes[0].reason
    return score(result.trajectory, scenario.robot)[0]


def steady_mm(name: str, *overrides: str) -> float:
    value = scored(name, *overrides)["steady_centre_of_oscillation_rmse_m"]
    assert value is not None
    return 1e3 * value


@pytest.mark.parametrize("name", list(REFERENCES))
def test_there_and_back(name: str) -> None:
    """F to the motion of P and both bodies and back: the same F, to rounding."""
    flat = REFERENCES[name].flat_derivatives(np.linspace(0.0, 9.0, 200))
    sign = 1.0 if REFERENCES[name].side == "outside" else -1.0
    motion = motion_from_flat(flat, sign, ROBOT)
    back = centre_derivatives(motion.position, motion.theta2[..., None], ROBOT)
    assert back.shape[1] >= 4
    assert back == pytest.approx(flat[:, : back.shape[1]], abs=1e-12)


@pytest.mark.parametrize("name", list(REFERENCES))
def test_a_flat_reference_is_a_free_trailers_motion(name: str) -> None:
    path = REFERENCES[name].sample(np.linspace(0.0, 9.0, 500), ROBOT)
    free = trailer_acceleration(path.theta2_rad, path.acceleration_m_s2, ROBOT)
    assert path.theta_acceleration[..., 1] == pytest.approx(free, abs=1e-11)
    heading = np.arctan2(path.velocity_m_s[..., 1], path.velocity_m_s[..., 0])
    assert np.cos(heading - path.theta1_rad) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("name", list(REFERENCES))
def test_every_derivative_is_the_derivative_of_the_one_before(name: str) -> None:
    step = 1e-3
    path = REFERENCES[name].sample(np.arange(0.0, 3.0, step), ROBOT)
    for values in (
        [path.derivatives[:, 0, order] for order in range(5)],
        [path.theta[:, 0], path.theta_rate[:, 0], path.theta_acceleration[:, 0]],
    ):
        for lower, higher in pairwise(values):
            central = (lower[2:] - lower[:-2]) / (2.0 * step)
            # second order: step²/6 of the third derivative
            assert central == pytest.approx(higher[1:-1], abs=2e-5)


def test_the_circle_by_hand() -> None:
    """Outside, P runs at R − k with the trailer at +90 degrees; inside, at R + k and −90."""
    length = ROBOT.swing_length_m
    for side, radius, hitch in (("outside", 0.6 - length, 0.5), ("inside", 0.6 + length, -0.5)):
        path = REFERENCES[side].sample(np.linspace(0.0, 6.0, 50), ROBOT)
        assert np.hypot(*path.position_m[:, 0].T) == pytest.approx(radius, abs=1e-14)
        turn = path.theta2_rad - path.theta1_rad
        assert np.cos(turn - hitch * np.pi) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("hitch", [Hitch(), Hitch(damping_n_m_s_rad=1e-3)])
def test_the_sampled_model_is_the_analytic_plant(hitch: Hitch) -> None:
    robot = ROBOT.model_copy(update={"hitch": hitch})
    plant = AnalyticPlant(robot, 3, 0.001, 0.001)
    model, rng = SampledModel(robot, PERIOD), np.random.default_rng(0)
    body, wheels = np.zeros((3, 5)), np.zeros((3, 2))
    for _ in range(30):
        command = wheels + rng.uniform(-5.0, 5.0, (3, 2))
        plant.advance(command, 33)
        body, wheels = model.advance(body, wheels, command)
    state = plant.state()
    assert wheels == pytest.approx(plant.wheel_speed_rad_s(), abs=1e-12)
    assert body[:, 2] == pytest.approx(state.q[:, 2], abs=1e-12)  # the heading is exact
    assert body[:, :2] == pytest.approx(state.q[:, :2], abs=1e-4)
    assert body[:, 3] == pytest.approx(state.q[:, 3], abs=3e-3)  # second order, hard driving


def test_a_stuck_hitch_turns_rigidly_in_the_sampled_model() -> None:
    robot = ROBOT.model_copy(update={"hitch": Hitch(coulomb_friction_n_m=1.0)})
    model = SampledModel(robot, PERIOD)
    body, wheels = np.zeros((1, 5)), np.zeros((1, 2))
    for _ in range(20):
        body, wheels = model.advance(body, wheels, np.array([[6.0, 4.0]]))
    assert body[0, 3] == pytest.approx(body[0, 2], abs=1e-3)  # one substep of lag


def test_kalman_gain_of_a_random_walk_by_hand() -> None:
    """Scalar: P = (q + √(q² + 4qr))/2, gain P/(P + r)."""
    q, r = 0.3**2, 0.5**2
    P = 0.5 * (q + np.sqrt(q * q + 4 * q * r))
    gain = kalman_gain(np.eye(1), (0.3,), (0.5,))
    assert gain[0, 0] == pytest.approx(P / (P + r), rel=1e-9)


def test_the_observer_predicts_across_latency_exactly() -> None:
    """Perfect but old measurements, and a robot that is the model: the present is known."""
    model = SampledModel(ROBOT, PERIOD)
    observer = Observer(ROBOT, model, ObserverOptions())
    body, wheels = np.array([[0.1, 0.2, 0.3, 0.5, 0.0]]), np.zeros((1, 2))
    past, rng = [], np.random.default_rng(1)
    for k in range(40):
        speed = np.array([[0.0, 0.0, 0.0]])
        turn = (wheels[:, :1] - wheels[:, 1:]) * 0.026 / 0.119
        rate = np.column_stack([model.velocity(body, wheels, speed), turn, body[:, 4:]])
        past.append(RobotState(q=body[:, :4], q_rate=rate))
        late = min(k, 2)
        age = np.array([late * PERIOD])
        seen = observer.update(
            Estimate(past[k - late], age, np.ones(1, dtype=np.bool_), np.full(1, np.nan))
        )
        assert seen.body == pytest.approx(body, abs=1e-9)
        command = wheels + rng.uniform(-2.0, 3.0, (1, 2))
        body, wheels = model.advance(body, wheels, command)
        observer.commanded(command)


def test_a_blind_observer_goes_on_predicting() -> None:
    model = SampledModel(ROBOT, PERIOD)
    observer = Observer(ROBOT, model, ObserverOptions())
    state, blind = RobotState.at_rest(0.0, 0.0, 0.0, 0.0), np.zeros(1, dtype=np.bool_)
    observer.update(Estimate(state, np.zeros(1), ~blind, np.zeros(1)))
    expected = observer.commanded(np.array([[5.0, 4.0]]))
    nonsense = RobotState(np.full((1, 4), 9.0), np.full((1, 4), 9.0))
    seen = observer.update(Estimate(nonsense, np.zeros(1), blind, np.zeros(1)))
    assert np.array_equal(seen.body, expected.body)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["outer_circle", "inverted_trailer"])
def test_the_law_converges_on_the_model(name: str) -> None:
    # the integral's residue is what is left after 15 to 30 s; without latency or noise
    assert steady_mm(name, "plant.kind=analytic") < 0.05


@pytest.mark.slow
def test_it_works_on_an_ellipse() -> None:
    section = FlatEllipse(kind="flat_ellipse", half_axes_m=(0.6, 0.45), angular_rate_rad_s=1.0)
    scenario = load_scenario("outer_circle", ["plant.kind=analytic"])
    scenario = scenario.model_copy(update={"reference": section})
    metrics = score(Experiment(scenario).run().trajectory, scenario.robot)[0]
    assert (metrics["steady_centre_of_oscillation_rmse_m"] or 1.0) < 1e-3


def test_references_it_cannot_follow_are_refused() -> None:
    with pytest.raises(InputError, match="needs a reference of the trailer"):
        Experiment(_with_controller("lab_circle")).run()
    with pytest.raises(InputError, match="hardly accelerates at"):
        Experiment(_with_controller("flat_figure_eight")).run()


def _with_controller(name: str) -> Scenario:
    controller = FlatnessOptions(kind="flatness")
    return load_scenario(name).model_copy(update={"controller": controller})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "truth_mm", "camera_mm", "friction_mm"),
    [("outer_circle", 0.3, 2.0, 3.0), ("inverted_trailer", 0.6, 3.0, 6.0)],
)
def test_contact_physics_meets_the_figures(
    name: str, truth_mm: float, camera_mm: float, friction_mm: float
) -> None:
    assert steady_mm(name) <= truth_mm
    assert steady_mm(name, *CAMERA_LIKE) <= camera_mm
    assert steady_mm(name, *CAMERA_LIKE, *DRY_HITCH) <= friction_mm


@pytest.mark.slow
def test_half_the_grip_changes_little() -> None:
    assert steady_mm("inverted_trailer", "plant.contact.floor_friction=0.45") <= 0.6
