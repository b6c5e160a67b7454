"""The fit finds what it was not told, imagines nothing, and knows how well it knows."""

from __future__ import annotations

import itertools
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from comparisons import TURN, open_loop

from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare.fit.fit import Fit, fit, freedom, standard_deviation
from ttwmr_mj.studies.compare.fit.shooting import SCALES
from ttwmr_mj.studies.compare.motion import run_contact
from ttwmr_mj.studies.compare.pair import run_pair
from ttwmr_mj.studies.compare.variants import changed


def test_standard_deviations_are_those_of_linear_least_squares() -> None:
    jacobian = np.random.default_rng(0).normal(size=(40, 3))
    residual = np.tile([1.0, 2.0, -1.0, 0.5, -1.0, -2.0, 1.0, -0.5], 5)  # alternating: no memory
    covariance = np.linalg.inv(jacobian.T @ jacobian) * (residual @ residual) / (40 - 3)
    expected = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(standard_deviation(residual, jacobian, 4), expected, rtol=1e-12)
    # neighbours that are correlated by ρ count as (1 − ρ)/(1 + ρ) of their number
    rows = residual.reshape(10, 4)
    slow = np.repeat(rows, 4, axis=0)
    wide = np.repeat(jacobian.reshape(10, 4, 3), 4, axis=0).reshape(160, 3)
    correlation = (slow[1:] * slow[:-1]).sum() / (slow**2).sum()
    freedom = 160 * (1 - correlation) / (1 + correlation) - 3
    covariance = np.linalg.inv(wide.T @ wide) * (slow**2).sum() / freedom
    expected = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(standard_deviation(slow.ravel(), wide, 4), expected, rtol=1e-12)


@pytest.mark.slow
def test_the_fit_finds_what_it_was_not_told_and_predicts_an_unseen_run() -> None:
    believed = open_loop(*TURN, hitch={"damping_n_m_s_rad": 1e-3})
    truth = {
        "robot.hitch.damping_n_m_s_rad": 2e-3,
        "robot.hitch.coulomb_friction_n_m": 5e-5,
        "robot.servo.velocity_gain_n_m_s_rad": 1.0,
        "robot.tractor.wheel_radius_m": 0.0261,
        "robot.tractor.track_width_m": 0.118,
    }
    unseen = open_loop((1.0, 4.0, 5.0), (1.5, 5.5, 4.0), hitch={"damping_n_m_s_rad": 1e-3})
    runs = [
        replace(run_contact(changed(scenario, truth)), scenario=scenario)
        for scenario in (believed, unseen)
    ]
    found = fit(*runs)
    estimates = found.parameters
    assert set(estimates) == set(SCALES)
    assert estimates["wheel_radius_m"].value == pytest.approx(0.0261, rel=1e-4)
    assert estimates["track_width_m"].value == pytest.approx(0.118, rel=1e-3)
    # (wheel + gears)/gain = 2.1e-4 kg·m²/1 N·m·s
    assert estimates["servo_time_constant_s"].value == pytest.approx(2.1e-4, rel=0.1)
    assert estimates["hitch_damping_n_m_s_rad"].value == pytest.approx(2e-3, rel=0.05)
    assert estimates["hitch_coulomb_friction_n_m"].value == pytest.approx(5e-5, rel=0.1)
    assert min(found.validation.factor.values()) > 5.0
    for name, estimate in estimates.items():
        low, high = estimate.confidence_95
        assert low <= estimate.value <= high, name
        assert estimate.pinned == (name == "rolling_resistance_m"), name
    assert estimates["wheel_radius_m"].identified
    friction_n_m = estimates["hitch_coulomb_friction_n_m"]
    assert friction_n_m.identified
    assert friction_n_m.confidence_95[0] > 0.0


def test_the_fit_imagines_no_friction_that_is_not_there() -> None:
    """Truth: no dry friction and no rolling resistance. Both intervals hold zero."""
    scenario = open_loop(*TURN, hitch={"damping_n_m_s_rad": 1e-3})
    run = run_contact(scenario)
    found = fit(run, run)
    assert found.training.fitted.items() <= compared(scenario, found).items()
    for name in ("hitch_coulomb_friction_n_m", "rolling_resistance_m"):
        nothing = found.parameters[name]
        assert (nothing.value, nothing.confidence_95[0], nothing.pinned) == (0.0, 0.0, True)
        assert nothing.confidence_95[1] > 0.0
    for name, truth in {
        "wheel_radius_m": 0.026,
        "track_width_m": 0.119,
        "servo_time_constant_s": 2.1014e-5,  # (wheel + gears)/gain
        "slip_time_s": 7.5e-4,  # (contacts' time constant + step)/2
        "hitch_damping_n_m_s_rad": 1e-3,
        "caster_mass_kg": 1e-3,
    }.items():
        low, high = found.parameters[name].confidence_95
        assert low <= truth <= high, name
        assert not found.parameters[name].pinned


def compared(scenario: Scenario, found: Fit) -> dict[str, float | None]:
    """What a comparison finds of the scenario with the fragment that the fit leaves."""
    tables = tomllib.loads(found.as_toml())
    extended = tables["plant"]["analytic"]["extended"]
    return run_pair(changed(scenario, {"plant.analytic.extended": extended})).numbers


@pytest.mark.slow
@pytest.mark.parametrize("trailers", [1, 2])
def test_what_a_fit_tells_of_dry_friction_is_what_a_comparison_finds(trailers: int) -> None:
    rubbing = {"damping_n_m_s_rad": 1e-3, "coulomb_friction_n_m": 5e-5}
    towing = [{"next_hitch_offset_m": 0.23}] * (trailers - 1)
    robot = {"trailers": [*towing, {}], "hitches": [rubbing] * trailers}
    scenario = open_loop(*TURN, robot=robot)
    unseen = open_loop((1.0, 4.0, 5.0), (1.5, 5.5, 4.0), robot=robot)
    found = fit(run_contact(scenario), run_contact(unseen))
    for driven, gain in ((scenario, found.training), (unseen, found.validation)):
        assert gain.plain.items() <= run_pair(driven).numbers.items()
        assert gain.fitted.items() <= compared(driven, found).items()
    for i in range(trailers):
        assert found.training.factor[f"theta{2 + i}_deviation_rms_rad"] > 20.0
        assert found.validation.factor[f"theta{2 + i}_deviation_rms_rad"] > 2.0


def test_few_independent_samples_make_wide_intervals() -> None:
    """Neighbours correlated by ρ count as (1 − ρ)/(1 + ρ) of their number."""
    rng = np.random.default_rng(1)
    rows = np.empty((4000, 4))
    rows[0] = rng.normal(size=4)
    for before, row in itertools.pairwise(rows):
        row[:] = 0.9 * before + np.sqrt(1.0 - 0.9**2) * rng.normal(size=4)
    assert freedom(rows.ravel(), 3, 4) == pytest.approx(16000 * 0.1 / 1.9 - 3, rel=0.1)
    assert freedom(np.ones(80), 3, 4) == 1.0  # never less than one
    assert freedom(np.tile([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0], 10), 3, 4) == 77.0
