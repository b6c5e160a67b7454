"""A law of the user's may raise and return anything: its run ends with the reason."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from ttwmr_mj.errors import InputError
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import check_scenario, set_value

LAW = """
import numpy as np
from ttwmr_mj.controllers.base import Command, Controller

class Mute(Exception):
    def __str__(self):
        raise RuntimeError("never")

class Leave(BaseException):
    pass

{at_import}

class Law(Controller):
    def __init__(self):
        {at_making}

    def start(self, task):
        {at_start}

    def command(self, k, estimate):
        one, no = np.ones((1, 2)), np.zeros(1, dtype=bool)
        {at_command}
"""
SCENARIO = """
name = "mine"
duration_s = 0.2
plant.kind = "analytic"
reference.kind = "none"
controller = {kind = "custom", target = "TARGET:Law"}
"""


def made(folder: Path, place: str, code: str, *changes: str) -> Experiment:
    """A scenario with changes whose law has this code at that place."""
    parts = dict.fromkeys(("at_import", "at_making", "at_start"), "pass")
    parts["at_command"] = "return Command(one, no, no)"
    target = f"hostile_{abs(hash((place, code)))}"
    (folder / f"{target}.py").write_text(LAW.format(**parts | {place: code}))
    data = tomllib.loads(SCENARIO.replace("TARGET", target))
    for change in changes:
        set_value(data, change)
    scenario = check_scenario(data, "mine")
    return Experiment(scenario, folder)


@pytest.mark.parametrize("place", ["at_import", "at_making"])
@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("raise SystemExit(0)", "raised SystemExit: 0"),
        ("raise Leave('x')", "raised Leave: x"),
        ("raise Mute", r"raised Mute \(whose text raised RuntimeError\)"),
    ],
)
def test_what_cannot_be_made_is_an_input_error(
    place: str, code: str, told: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=told):
        made(tmp_path, place, code)


def test_a_class_that_makes_no_controller_is_an_input_error(tmp_path: Path) -> None:
    code = "pass\n\n    def __new__(cls):\n        return None"
    with pytest.raises(InputError, match="raised TypeError: it must make a Controller"):
        made(tmp_path, "at_making", code)


@pytest.mark.parametrize(
    ("place", "code", "told"),
    [
        ("at_start", "raise Leave('x')", "controller.start() raised Leave: x"),
        ("at_start", "raise Mute", "controller.start() raised Mute (whose text"),
        ("at_command", "raise Leave('x')", "controller.command() raised Leave: x"),
        ("at_command", "raise Mute", "controller.command() raised Mute (whose text"),
        ("at_command", "raise GeneratorExit", "controller.command() raised GeneratorExit"),
        ("at_command", "return Command(one, one, no)", "saturated has shape (1, 2), allowed: (1,)"),
        ("at_command", "return Command(one, no, None)", "near_singular has shape ()"),
        ("at_command", "return Command(one + 0j, no, no)", "wheel speeds are not real numbers"),
        ("at_command", "return Command(one > 0, no, no)", "wheel speeds are not real numbers"),
        (
            "at_command",
            "return None",
            "the answer is of the type NoneType; allowed: a ttwmr_mj.Comm",
        ),
        (
            "at_command",
            "return one",
            "the answer is of the type ndarray; allowed: a ttwmr_mj.Comman",
        ),
    ],
)
def test_the_run_ends_with_the_reason(place: str, code: str, told: str, tmp_path: Path) -> None:
    (outcome,) = made(tmp_path, place, code).run().outcomes
    assert outcome.status == "failed"
    assert told in outcome.reason


def test_a_law_of_ones_own_tows_trains(tmp_path: Path) -> None:
    code = "assert estimate.state.q.shape == (1, 5); return Command(one, no, no)"
    train = "robot.trailers=[{next_hitch_offset_m=0.3},{}]"
    experiment = made(tmp_path, "at_command", code, train, "robot.hitches=[{},{}]")
    (outcome,) = experiment.run().outcomes
    assert outcome.status == "ok", outcome.reason
