"""Bodies of trains that lie in each other."""

from __future__ import annotations

import numpy as np
import pytest
from trains import train

from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.overlap import overlaps_m
from ttwmr_mj.runs.judgement.foresight import foretold
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import FloatArray

OUT, IN = np.pi, 0.0  # where trailers point that are radial, P on the x axis


def on_circle(*theta: float) -> FloatArray:
    return np.array([[0.6, 0.0, 0.5 * np.pi, *theta]])


@pytest.mark.parametrize("theta", [(OUT, OUT), (IN, IN), (OUT, OUT, IN)])
def test_trains_that_lie_behind_each_other_have_room(theta: tuple[float, ...]) -> None:
    assert not overlaps_m(train(len(theta)), ContactOptions(), on_circle(*theta))


def test_a_folded_trailer_lies_in_the_tractor() -> None:
    """Half the tractor's width and the bed's far end less the hitch, 0.062 + 0.202 m − d."""
    ((bodies, depth_m),) = overlaps_m(train(2), ContactOptions(), on_circle(IN, OUT)).items()
    assert bodies == ("tractor", "trailer_2")
    assert depth_m == pytest.approx(0.062 + 0.202 - 0.23, abs=2e-3)  # hulls are a little smaller
    assert not overlaps_m(train(2, 0.28), ContactOptions(), on_circle(IN, OUT))


def test_it_is_foretold() -> None:
    folded = load_scenario("double_inverted", ["reference.side=['inside', 'outside']"])
    (told,) = foretold(folded)
    assert "robot.trailers: tractor and trailer_2 overlap by 3" in told
    assert "a larger next_hitch_offset_m" in told
    assert not foretold(load_scenario("double_inverted"))
