"""Every shipped scenario does on contact physics what its [accept] says."""

from __future__ import annotations

import pytest

from ttwmr_mj.assets import scenarios_folder, shipped_scenarios
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario

# their starts are worked off by then, and with a camera a second takes one
SHORTENED = {
    "inverted_trailer_camera": 10.0,
    "flat_figure_eight_camera": 12.0,
    "lab_servo_inverted": 12.0,
}
IN_CAMERA_LOOP = {  # driven in full by test_camera_loop.py, and held there
    "lab_circle_camera",
    "camera_dropped",
    "camera_blackout",
    "camera_occluder",
    "camera_distractor",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped_scenarios().keys() - IN_CAMERA_LOOP))
def test_a_shipped_scenario_does_what_it_says(name: str) -> None:
    overrides = [f"duration_s={SHORTENED[name]}"] if name in SHORTENED else []
    scenario = load_scenario(name, overrides)
    assert "verdict" in scenario.accept.model_fields_set, "it does not say"
    (verdict,) = Experiment(scenario, scenarios_folder()).run().verdicts
    assert verdict.name == scenario.accept.verdict, str(verdict)
