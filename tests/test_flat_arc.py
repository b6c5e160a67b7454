"""An arc whose acceleration never vanishes: exact ends, exact derivatives, followed by the law."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from ttwmr_mj.dynamics.hybrid import trailer_acceleration
from ttwmr_mj.errors import InputError
from ttwmr_mj.references.flat_arc import FlatArc
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.shared.feasibility import check_feasibility
from ttwmr_mj.results.metrics import score
from ttwmr_mj.robot import RobotParameters, Servo
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario

ROBOT = RobotParameters(servo=Servo(preset="fast"))
ARC = FlatArc(
    radius_m=0.6,
    angles_rad=(0.5, -3.0),
    rest_rate_rad_s=0.5,
    peak_rate_rad_s=1.0,
    centre_m=(0.1, -0.2),
    side="inside",
)
SCENARIO = [
    'reference={kind="flat_arc", radius_m=0.6, angles_rad=[0.0, 4.0], rest_rate_rad_s=0.5, '
    "peak_rate_rad_s=1.1}",
    "plant.kind=analytic",
    "duration_s=10.0",
]


def test_it_runs_from_one_angle_to_the_other_and_slowly_on() -> None:
    times = np.array([0.0, ARC.duration_s, ARC.duration_s + 2.0])
    flat = ARC.flat_derivatives(times)
    angles = np.array([0.5, -3.0, -4.0])
    expected = np.stack([0.1 + 0.6 * np.cos(angles), -0.2 + 0.6 * np.sin(angles)], axis=-1)
    assert flat[:, 0] == pytest.approx(expected, abs=1e-12)
    # there and from there on it is a circle at the rate of the ends, to the sixth derivative
    circle = FlatCircle(radius_m=0.6, angular_rate_rad_s=-0.5, phase_rad=-3.0, centre_m=(0.1, -0.2))
    assert flat[1:] == pytest.approx(circle.flat_derivatives(times[1:] - times[1]), abs=1e-12)
    middle = ARC.flat_derivatives(0.5 * times[1:2])
    assert np.hypot(*middle[0, 1]) == pytest.approx(0.6 * 1.0, rel=1e-12)


@pytest.mark.parametrize(("start", "stop"), [(3.0, 0.5), (-3.0, -0.5), (0.2, 0.9), (-0.2, -0.9)])
def test_the_order_of_the_angles_gives_the_sense(start: float, stop: float) -> None:
    arc = ARC.model_copy(update={"angles_rad": (start, stop), "centre_m": (0.0, 0.0)})
    position = arc.flat_derivatives(np.linspace(0.0, arc.duration_s, 50))[:, 0]
    angle = np.unwrap(np.arctan2(position[:, 1], position[:, 0]))
    assert angle[[0, -1]] == pytest.approx([start, stop], abs=1e-12)
    assert (np.sign(stop - start) * np.diff(angle) > 0.0).all()


def test_every_derivative_is_the_derivative_of_the_one_before() -> None:
    step = 1e-3
    # short of the ends, where the seventh derivative of the angle jumps
    flat = ARC.flat_derivatives(np.arange(0.05, ARC.duration_s - 0.05, step))
    for lower, higher in pairwise(np.moveaxis(flat, 1, 0)):
        central = (lower[2:] - lower[:-2]) / (2.0 * step)
        # second order: step²/6 of the derivative two higher, up to 500 times this one
        np.testing.assert_allclose(central, higher[1:-1], atol=1e-4 * np.abs(higher).max())


def test_a_free_trailer_can_follow_it() -> None:
    path = ARC.sample(np.arange(0.0, ARC.duration_s + 3.0, 0.033), ROBOT)
    free = trailer_acceleration(path.theta2_rad, path.acceleration_m_s2, ROBOT)
    assert path.theta_acceleration[..., 1] == pytest.approx(free, abs=1e-11)
    assert check_feasibility(path, ROBOT).feasible
    acceleration = np.hypot(*np.moveaxis(ARC.flat_derivatives(path.time_s)[:, 2], -1, 0))
    assert acceleration.min() >= 0.6 * 0.5**2 * (1 - 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "offset_m", "allowed_m"),
    # flatness samples |F''| as it falls to 0.15 m/s²; on so little it catches small offsets only
    [("flatness", 0.0, 4e-3), ("tvlqr", 0.05, 5e-4)],
)
def test_laws_follow_it(law: str, offset_m: float, allowed_m: float) -> None:
    start = [f"initial.x_offset_m={offset_m}", f"initial.theta2_offset_rad={4.0 * offset_m}"]
    scenario = load_scenario("outer_circle", [*SCENARIO, *start, f'controller={{kind="{law}"}}'])
    metrics = score(Experiment(scenario).run().trajectory, scenario.robot)[0]
    error = metrics["steady_centre_of_oscillation_rmse_m"]
    assert error is not None
    assert error < allowed_m


def test_an_arc_of_no_angle_is_refused() -> None:
    with pytest.raises(InputError, match=r"angles_rad: got .*; two different angles are needed"):
        load_scenario("outer_circle", [*SCENARIO, "reference.angles_rad=[1.0, 1.0]"])
