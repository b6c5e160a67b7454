"""What a message tells as allowed is allowed; what decides is there."""

from __future__ import annotations

import re

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.errors import at_least, at_most
from ttwmr_mj.runs.build import make_plant


def told(error: tt.InputError) -> str:
    """The number in what is allowed."""
    found = re.search(r"[0-9][0-9.e+-]*", error.faults[0].allowed)
    assert found
    return found[0].rstrip(".")


def test_limits_are_rounded_to_the_side_that_is_allowed() -> None:
    assert (at_most(1.26e-4), at_least(0.033)) == ("at most 0.000126", "at least 0.033")
    for value in 10.0 ** np.random.default_rng(0).uniform(-9.0, 9.0, 1000):
        most, least = (float(text.split()[-1]) for text in (at_most(value), at_least(value)))
        assert 0.99 * value <= most <= value <= least <= 1.01 * value


@pytest.mark.parametrize(
    ("values", "key", "more"),
    [
        (["duration_s=1234.5678"], "control.sampling_time_s", 0.0),
        (["control.sampling_time_s=0.012345678912"], "duration_s", 0.0),
        (["robot.casters.mass_kg=0.16543219"], "robot.trailer.mass_kg", 1e-6),
    ],
)
def test_the_smallest_value_told_is_taken(values: list[str], key: str, more: float) -> None:
    values = ['plant.kind="analytic"', *values]
    with pytest.raises(tt.InputError, match=rf"\b{key}: ") as error:
        tt.load_scenario("lab_circle", [*values, f"{key}=0.0001"])
    allowed = float(told(error.value)) + more
    faults = ()
    try:
        tt.load_scenario("lab_circle", [*values, f"{key}={allowed!r}"])
    except tt.InputError as other:
        faults = other.faults
    assert key not in [fault.where for fault in faults]


@pytest.mark.parametrize("latency_s", [0.0002, 0.0005])
def test_a_period_shorter_than_a_step_is_told_the_nearest(latency_s: float) -> None:
    given = ["plant.kind=analytic", "duration_s=0.1", f"control.command_latency_s={latency_s}"]
    near = r"sampling_time_s: got 0\.0002; .* steps of 0\.0005 s .*; nearest: 0\.0005$"
    with pytest.raises(tt.InputError, match=f"(?m){near}"):
        tt.load_scenario("lab_circle", [*given, "control.sampling_time_s=0.0002"])


@pytest.mark.parametrize("damping", [1.0, 3.3, 7.7, 10.0, 150.0])
def test_the_longest_step_told_is_taken(damping: float) -> None:
    values = ['plant.kind="analytic"', f"robot.hitch.damping_n_m_s_rad={damping}"]
    step = "plant.analytic.max_step_s"
    with pytest.raises(tt.InputError, match=step) as error:
        make_plant(tt.load_scenario("lab_circle", [*values, f"{step}=0.1"]))
    make_plant(tt.load_scenario("lab_circle", [*values, f"{step}={told(error.value)}"]))


ELLIPSE = [
    'reference={kind="flat_ellipse",angular_rate_rad_s=10.0,half_axes_m=[1e-3,2.0],side="outside"}',
    "plant.kind=analytic",
    "duration_s=0.2",
]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("hitch", "told"),
    [
        ([], "a reference that is slower, or bends less, asks less"),
        (["robot.hitch.damping_n_m_s_rad=1e-3"], "the hitch's damper decides most"),
        (
            ["robot.hitch.damping_n_m_s_rad=1e-3", "robot.hitch.coulomb_friction_n_m=1e-4"],
            "the hitch's damper and friction decide most",
        ),
    ],
)
def test_a_law_without_gains_names_what_decides_and_warns_of_nothing(
    hitch: list[str], told: str
) -> None:
    run = tt.simulate(
        tt.load_scenario("inverted_trailer", ["controller.kind=tvlqr", *ELLIPSE, *hitch])
    )
    assert run.outcomes[0].status == "failed"
    assert run.outcomes[0].reason.endswith(told)


def test_a_law_of_the_users_warns_as_ever() -> None:
    class Careless(tt.Controller):
        def start(self, task: tt.Task) -> None:
            del task

        def command(self, k: int, estimate: tt.Estimate) -> tt.Command:
            del k
            return self.plain(np.nan_to_num(estimate.state.q[:, :2] / np.zeros(2), posinf=0.0))

    scenario = tt.load_scenario("lab_circle", ["plant.kind=analytic", "duration_s=0.1"])
    with pytest.warns(RuntimeWarning, match="divide by zero"):
        tt.simulate(scenario, controller=Careless())


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("sensing.latency_s", "10.0"),
        ("sensing.latency_s", "0.8"),
        ("sensing.latency_s", "1e-3"),
        ("sensing.latency_jitter_s", "9.9999"),
        ("control.command_jitter_s", "10.0"),
        ("control.sampling_time_s", "9.9999"),
    ],
)
@pytest.mark.parametrize("period_s", ["0.033", "0.01234321"])
def test_the_nearest_steps_told_are_taken(key: str, value: str, period_s: str) -> None:
    values = [f"control.sampling_time_s={period_s}", "duration_s=20.0"]
    own = key == "control.sampling_time_s"  # which counts in steps of contact physics
    values.append("plant.contact.timestep_s=0.0007" if own else "plant.kind=analytic")
    with pytest.raises(tt.InputError, match=rf"{key}: got .* nearest: ") as error:
        tt.load_scenario("inverted_trailer", [*values, f"{key}={value}"])
    (fault,) = error.value.faults
    for near in fault.allowed.partition("nearest: ")[2].split(" and "):
        tt.load_scenario("inverted_trailer", [*values, f"{key}={near}"])
