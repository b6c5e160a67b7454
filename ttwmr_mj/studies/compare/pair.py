"""The two runs of a comparison."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from ttwmr_mj.plants.mjcf import CONTACTS
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare import motion
from ttwmr_mj.studies.compare.deviation import Deviation, Numbers
from ttwmr_mj.studies.compare.refusal import refuse_unlike
from ttwmr_mj.studies.compare.residuals import Residuals

Mode = Literal["open_loop", "closed_loop"]


@dataclass(frozen=True, slots=True)
class Pair:
    """The two runs that are compared, and what follows from them alone."""

    contact: motion.ContactRun
    analytic: Trajectory
    deviation: Deviation
    residuals: Residuals

    @property
    def numbers(self) -> Numbers:
        """All numbers a tolerance may be given for."""
        return {**self.deviation.numbers(), **self.residuals.numbers()}


def run_pair(
    scenario: Scenario,
    mode: Mode = "open_loop",
    *,
    real_wheels: bool = False,
    scenario_folder: Path | None = None,
) -> Pair:
    """Run a scenario on both plants.

    Args:
        scenario: its plant.kind does not matter.
        mode: as in `study.Options`.
        real_wheels: as in `study.Options`.
        scenario_folder: where a custom controller is looked for first.

    Raises:
        InputError: the plants cannot mean the same thing.
        RunError: a run broke.
    """
    refuse_unlike(scenario)
    contact = motion.run_contact(scenario, scenario_folder)
    if mode == "closed_loop":
        analytic = motion.run_analytic(scenario, scenario_folder)
    elif real_wheels:
        analytic = motion.follow_wheels(contact)
    else:
        analytic = motion.replay_analytic(scenario, contact.commands)
    deviation = Deviation.between(contact.trajectory, analytic)
    return Pair(contact, analytic, deviation, Residuals.of(contact))


def known_numbers() -> list[str]:
    """The keys a tolerance may be given for, before anything has run."""
    zero, contacts = np.zeros(1), np.zeros((1, len(CONTACTS)))
    deviation = Deviation(zero, np.zeros((1, 4)), zero, zero)
    return [*deviation.numbers(), *Residuals(zero, contacts, contacts, zero, zero, zero).numbers()]
