"""What the schema of scenarios says, and what no number may be."""

from dataclasses import replace

import numpy as np
import pytest

from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.checks import _undefined_start, check
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.motion import sample_reference
from ttwmr_mj.scenario.schema import AtRest, Scenario


def test_the_schema_describes_every_shipped_key() -> None:
    schema = Scenario.model_json_schema()
    assert schema["properties"]["duration_s"]["minimum"] == 1e-12
    assert schema["additionalProperties"] is False
    assert {"Tractor", "Servo", "Circle", "ContactOptions"} <= set(schema["$defs"])


def test_every_number_has_limits_and_none_is_next_to_zero() -> None:
    """Such as 5e-324, whose inverse is infinite."""
    entries = [Scenario.model_json_schema()]
    for entry in entries:
        inner = [value for value in entry.values() if isinstance(value, dict)]
        lists = [value for value in entry.values() if isinstance(value, list)]
        entries += inner + [one for values in lists for one in values if isinstance(one, dict)]
    numbers = [entry for entry in entries if entry.get("type") in ("number", "integer")]
    assert len(numbers) > 250
    for number in numbers:
        if "const" in number:
            continue
        assert {"minimum", "exclusiveMinimum"} & set(number), number
        assert {"maximum", "exclusiveMaximum"} & set(number), number
        assert number.get("exclusiveMinimum") != 0, number


def test_a_table_of_several_kinds_says_which_where_the_program_takes_none_for_granted() -> None:
    schema = Scenario.model_json_schema()
    for key in ("reference", "controller", "initial", "sensing"):
        for kind, ref in schema["properties"][key]["discriminator"]["mapping"].items():
            table = schema["$defs"][ref.removeprefix("#/$defs/")]
            granted = kind in ("at_rest", "truth")
            assert ("kind" in table.get("required", [])) is not granted, kind
            assert ("default" in table["properties"]["kind"]) is granted, kind
    for key in ("reference", "controller"):
        with pytest.raises(InputError, match=rf"{key}\.kind: missing"):
            load_scenario("lab_circle", [f"{key}={{}}"])


def test_a_truth_value_is_no_number() -> None:
    with pytest.raises(InputError, match=r"supersampling: got True; allowed: a whole number"):
        load_scenario("lab_circle_camera", ["sensing.camera.supersampling=true"])


def test_what_stands_still_is_no_place_to_start() -> None:
    scenario = load_scenario("outer_circle")
    path = sample_reference(scenario)
    assert path is not None
    assert list(_undefined_start(scenario, path)) == []
    (fault,) = _undefined_start(scenario, replace(path, theta=np.full_like(path.theta, np.nan)))
    assert "stands still, and has no heading" in str(fault)


@pytest.mark.parametrize("rate", ["0.0", "1e-170", "-9e-13"])
@pytest.mark.parametrize(
    "curve", ['kind="flat_circle", radius_m=0.5', 'kind="flat_ellipse", half_axes_m=[0.5, 0.4]']
)
def test_what_stands_still_is_no_flat_reference(curve: str, rate: str) -> None:
    given = f"reference={{{curve}, angular_rate_rad_s={rate}}}"
    with pytest.raises(InputError, match=r"angular_rate_rad_s: got .*; at least 1e-12 rad/s"):
        load_scenario("lab_circle", [given, "plant.kind=analytic"])


def test_a_reference_that_has_no_position_somewhere_is_refused() -> None:
    scenario = load_scenario("outer_circle", ['controller={kind="feedforward"}'])
    still = scenario.reference.model_copy(update={"angular_rate_rad_s": 0.0})
    at_rest = AtRest(x_m=0.0, y_m=0.0)
    (fault,) = check(scenario.model_copy(update={"reference": still, "initial": at_rest}), [])
    assert "reference: has no position of P, or not its rates, at 0 s" in str(fault)


def test_an_editor_can_say_what_each_key_of_these_tables_does() -> None:
    schema = Scenario.model_json_schema()
    tables = """Tractor Trailer Hitch Servo Casters RobotParameters AtRest OnReference
        AnalyticOptions PushOptions PlantOptions ControlOptions OutputOptions BeliefOptions"""
    for table in (schema, *(schema["$defs"][name] for name in tables.split())):
        assert table["description"]
        for key, entry in table["properties"].items():
            assert key == "kind" or "$ref" in entry or entry["description"], key
