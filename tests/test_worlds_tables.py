"""Tables of the documents, in every world: what they run is valid, and what a cell says."""

from __future__ import annotations

import numpy as np
import pytest
import worlds
from worlds_tables import TABLES, Cell

from ttwmr_mj.scenario.file import load_scenario

CELLS = {cell for table in TABLES.values() for row in table.rows.values() for cell in row if cell}


@pytest.mark.parametrize("name", TABLES)
def test_a_table_has_a_cell_or_none_under_each_head(name: str) -> None:
    table = TABLES[name]
    assert all(len(row) == len(table.heads) for row in table.rows.values())


def test_every_cell_is_a_valid_scenario() -> None:
    for cell in CELLS:
        found = load_scenario(cell.scenario, [*cell.sets, *worlds.WORLDS["lab"]])
        assert found.world == "lab"


@pytest.mark.parametrize("kind", worlds.LEARNING)
def test_laws_that_learn_learn_in_the_laboratory(kind: str) -> None:
    sets = [f"controller.kind={kind}", *worlds.WORLDS["lab, learning"]]
    found = load_scenario("inverted_trailer", sets).controller
    assert len(found.learn) == 4  # type: ignore[attr-defined]


def test_what_is_measured_is_what_the_run_says() -> None:
    shifted = 'initial={kind="on_reference", x_offset_m=0.02}'
    still = ("duration_s=0.033", shifted, "plant.kind=analytic")
    scenario = worlds.scenario_of("kind", Cell("rest_to_rest", still))
    assert scenario is not None
    at_end, steady = worlds.driven([scenario, scenario], ["end", "FP"])
    # a robot that is 20 mm to one side, with everything on it
    np.testing.assert_allclose(at_end.values, [20.0, 20.0, 0.0], atol=1.0)
    np.testing.assert_allclose(steady.values, [20.0, 20.0], atol=1.0)


def test_a_law_that_cannot_learn_has_no_such_run() -> None:
    assert worlds.scenario_of("lab, learning", Cell("lab_circle")) is None
    assert worlds.scenario_of("kind", None) is None


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (worlds.Found((0.01234,), "followed"), "0.012"),
        (worlds.Found((33.61, 36.1), "lost"), "34 (36), lost"),
        (worlds.Found((3.6,), "tractor_follows_trailer_lost"), "3.6, trailer lost"),
        (worlds.Found((1.0,), "blind"), "blind"),
    ],
)
def test_a_cell_says_how_it_went(found: worlds.Found, said: str) -> None:
    assert str(found) == said
