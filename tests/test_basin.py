"""The map of a basin of attraction: refined at its edge, right where it is not simulated."""

from __future__ import annotations

import basin
import numpy as np
import pytest
from basin import map_basin

from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.file import load_scenario


@pytest.mark.parametrize("coarsest", [1, 2, 8])
def test_only_the_edge_is_simulated(coarsest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A round basin of known size; inside, the time grows evenly along the first axis."""
    asked = []

    def caught_after(_: object, offsets: list[np.ndarray], __: object) -> np.ndarray:
        x, y = offsets
        asked.append(len(x))
        return np.where(np.hypot(x, y) < 0.7, 1.0 + x, np.nan)

    monkeypatch.setattr(basin, "_caught_after", caught_after)
    axis = np.linspace(-1.0, 1.0, 33)
    found = map_basin(None, axis, axis, coarsest)  # type: ignore[arg-type]  # not looked at
    x, y = np.meshgrid(axis, axis, indexing="ij")
    np.testing.assert_array_equal(found.caught, np.hypot(x, y) < 0.7)
    np.testing.assert_allclose(found.caught_after_s[found.caught], 1.0 + x[found.caught])
    assert found.simulated.sum() == sum(asked)
    assert sum(asked) < {1: 1090, 2: 600, 8: 500}[coarsest]


def test_a_grid_must_fit_its_stride() -> None:
    axis = np.linspace(-1.0, 1.0, 9)
    with pytest.raises(InputError, match="9 x 9 starts"):
        map_basin(load_scenario("inverted_trailer"), axis, axis, 3)


@pytest.mark.slow
def test_catching_is_what_a_single_run_does() -> None:
    """The edge of the law's basin on the analytic model; each start as a run of its own."""
    alone_with_it = 'controller={kind="flatness", recovery="own"}'
    scenario = load_scenario(
        "inverted_trailer",
        ["duration_s=6.0", "plant.kind=analytic", "initial.x_offset_m=0.0", alone_with_it],
    )
    position, angle = np.array([0.0, 0.02, 0.3]), np.array([-1.5, 0.0, 0.2])
    together = map_basin(scenario, position, angle).caught_after_s
    assert np.isfinite(together[:2, 1:]).all()
    assert np.isnan(together[2, 0])
    assert together[0, 1] == 0.0  # it starts there and stays
    alone = map_basin(scenario, position[1:2], angle[2:3]).caught_after_s
    assert alone[0, 0] == together[1, 2]
