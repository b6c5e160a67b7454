"""Latency of frames that nobody told of, found by the camera's tracker."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.results.metrics import score
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.vision.sensor import CameraSensor

LATE = "sensing.latency_s=0.066"


def drive(learns: bool, *sets: str) -> tuple[float, str, Experiment]:
    """F [m], the verdict and the experiment of a trailer inside the circle."""
    lines = ["belief.latency_s=0.033", f"sensing.tracker.learn_latency={str(learns).lower()}"]
    scenario = load_scenario("inverted_trailer_camera", [*lines, "duration_s=12.0", *sets])
    experiment = Experiment(scenario, scenarios_folder())
    result = experiment.run()
    (numbers,) = score(result.trajectory, scenario.robot)
    centre = numbers["steady_centre_of_oscillation_rmse_m"]
    assert centre is not None
    return centre, result.verdicts[0].name, experiment


@pytest.mark.slow
@pytest.mark.parametrize(
    ("late", "extra_s"),
    [(LATE, 0.033), pytest.param("sensing.latency_s=0.0", -0.033, marks=pytest.mark.slow)],
)
def test_it_is_found_and_made_up_for(late: str, extra_s: float) -> None:
    centre, verdict, experiment = drive(True, late)
    sensor = experiment.sensor
    assert isinstance(sensor, CameraSensor)
    assert sensor.latency is not None
    # a tenth of a period: 2.5 mm of the way of P
    np.testing.assert_allclose(sensor.latency.extra_s, extra_s, atol=0.0033)
    np.testing.assert_allclose(sensor._made_up_s, sensor.latency.extra_s, atol=1e-12)
    assert verdict == "followed"
    assert centre < 5e-3  # without learning 20 and 43 mm


@pytest.mark.slow
def test_without_it_the_trailer_is_lost() -> None:
    centre, verdict, experiment = drive(False, LATE)
    assert isinstance(experiment.sensor, CameraSensor)
    assert experiment.sensor.latency is None
    assert verdict != "followed"
    assert centre > 0.02
