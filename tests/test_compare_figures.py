"""The figures of a comparison show its numbers."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from drawn import drawn, labels
from matplotlib.axes import Axes

from ttwmr_mj.results.curves import trailer_com
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.compare.explain.attribution import Contribution
from ttwmr_mj.studies.compare.figures import write_compare_figures
from ttwmr_mj.studies.compare.fit.fit import Gain
from ttwmr_mj.studies.compare.study import Pair, run_pair


@pytest.fixture(scope="module")
def pair() -> Pair:
    return run_pair(load_scenario("open_loop_turn", ["duration_s=0.5"]))


def row(name: str, contribution: float, share: float | None) -> Contribution:
    return Contribution(name, contribution, 0.0, contribution, share, contribution)


def test_paths_deviations_slip_and_residuals_are_drawn(
    pair: Pair, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    curves = drawn(monkeypatch)
    write_compare_figures(pair, tmp_path, "turn")
    assert set(curves) == {"paths", "deviation", "slip", "residuals"}
    off, rest = pair.deviation, pair.residuals
    contact, analytic = pair.contact.trajectory.q[:, 0], pair.analytic.q[:, 0]

    def y(figure: str, curve: str) -> list[float]:
        return curves[figure][curve][1]

    np.testing.assert_array_equal(y("paths", "P, contact physics"), contact[:, 1])
    np.testing.assert_array_equal(y("paths", "analytic model"), analytic[:, 1])
    com = trailer_com(contact, pair.contact.robot)
    np.testing.assert_array_equal(curves["paths"]["COM of the trailer"], com.T)
    for name, values in (
        ("distance", off.position_m),
        ("ahead", off.position_curves["ahead"]),
        ("aside", off.position_curves["aside"]),
        ("θ1", off.q[:, 2]),
        ("θ2", off.q[:, 3]),
        ("hitch", off.q[:, 3] - off.q[:, 2]),
    ):
        np.testing.assert_array_equal(y("deviation", name), 1e3 * values)
    for where, slip in (("along", rest.slip_along_m_s), ("aside", rest.slip_aside_m_s)):
        for wheel, name in enumerate(("right", "left")):
            shown = y("slip", f"wheel slip\n{where} [µm/s] {name}")
            np.testing.assert_array_equal(shown, 1e6 * slip[:, wheel])
    for curve, values in (
        ("Eq. 3: side slip\nof P [mm/s]", 1e3 * rest.lateral_speed_m_s),
        ("Eq. 17: torque\nmissing [µN·m]", 1e6 * rest.trailer_torque_n_m),
        ("energy\nlost [mJ]", 1e3 * rest.energy_lost_j),
    ):
        np.testing.assert_array_equal(y("residuals", f"{curve} _child0"), values)
    assert {"turn: contact physics less analytic model", "angles [mrad]", "time [s]"} <= set(
        labels(tmp_path / "deviation.svg")
    )


ROWS = [
    row("servo", 0.003, 0.75),
    row("rest", -1e-9, -2.5e-7),  # nothing, and no minus sign either
    row("total", 0.004, 1.0),
]
EMPTY = [row("servo", 0.0, None), row("rest", 0.0, None), row("total", 0.0, None)]
NAMES = ("position_deviation_max_m", "theta1_deviation_max_rad", "theta2_deviation_max_rad")
CONVERGENCE = SimpleNamespace(
    timestep_s=np.array([0.002, 0.001]),
    deviations={name: (k + 1) * np.array([2e-3, 1e-3]) for k, name in enumerate(NAMES)},
    orders={NAMES[0]: 1.0, NAMES[1]: None, NAMES[2]: 0.987},
)
FITTED = [f"{q}_deviation_rms_{unit}" for q, unit in (("position", "m"), ("theta1", "rad"))]
FITTED += ["position_deviation_max_m", "theta2_deviation_rms_rad", "theta2_deviation_max_rad"]
FIT = SimpleNamespace(
    training=Gain("seen", dict.fromkeys(FITTED, 12.0), dict.fromkeys(FITTED, 1.0)),
    validation=Gain("unseen", dict.fromkeys(FITTED, 7.0), dict.fromkeys(FITTED, 1.0)),
)


class Studies(NamedTuple):
    """Figures of a comparison with all its studies, and what was drawn."""

    folder: Path
    curves: dict[str, dict[str, tuple[list, list]]]
    widths: list[list[float]]


@pytest.fixture(scope="module")
def studies(pair: Pair, tmp_path_factory: pytest.TempPathFactory) -> Studies:
    folder, widths, barh = tmp_path_factory.mktemp("studies"), [], Axes.barh

    def spy(axes: Axes, names: list[str], width: list[float], **looks: Any) -> Any:
        widths.append(width)
        return barh(axes, names, width, **looks)

    stack = {"servo": np.array([1e-3, 2e-3]), "rest": np.array([-1e-3, 0.0])}
    stack["total"] = stack["servo"] + stack["rest"]
    attribution = SimpleNamespace(
        tables={"position": ROWS, "theta2": EMPTY},
        curves={"position": stack, "theta2": stack},
        time_s=np.array([0.0, 0.1]),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Axes, "barh", spy)
        curves = drawn(patch)
        write_compare_figures(pair, folder, "turn", attribution, CONVERGENCE, FIT)
    return Studies(folder, curves, widths)


def test_bars_say_what_contributes(studies: Studies) -> None:
    assert studies.widths[:2] == [[4.0, 0.0, 3.0], [0.0, 0.0, 0.0]]
    texts = labels(studies.folder / "attribution.svg")
    assert "rms deviation of P [mm]" in texts
    assert "rms deviation of θ2 [mrad]" in texts
    assert [text for text in texts if text.endswith(" %")] == ["100.0 %", "0.0 %", "75.0 %"]
    assert "unexplained remainder" in texts
    assert "total (rms)" in texts


def test_contributions_are_stacked_below_what_was_measured(studies: Studies) -> None:
    for label in ("deviation of P\n[mm]", "deviation of θ2\n[mrad]"):
        measured = studies.curves["contributions"][f"{label} what was measured"]
        assert measured == ([0.0, 0.1], [0.0, 2.0])
    texts = labels(studies.folder / "contributions.svg")
    assert {"servo lag and droop", "unexplained remainder"} <= set(texts)


def test_the_study_of_convergence_is_a_line_per_angle_and_position(studies: Studies) -> None:
    assert studies.curves["convergence"] == {
        "P: order 1.00": ([2.0, 1.0], [2.0, 1.0]),
        "θ1": ([2.0, 1.0], [4.0, 2.0]),
        "θ2: order 0.99": ([2.0, 1.0], [6.0, 3.0]),
    }
    # each unit has its own axes
    texts = labels(studies.folder / "convergence.svg")
    assert {"largest deviation of P [mm]", "largest deviation of angles [mrad]"} <= set(texts)


def test_the_fit_is_held_against_a_factor_of_five(studies: Studies) -> None:
    ((_, level),) = studies.curves["fit"].values()
    assert level == [5.0, 5.0]
    texts = labels(studies.folder / "fit.svg")
    assert texts.count("12") == texts.count("7") == 5
    assert {"fitted on seen", "validated on unseen"} <= set(texts)
