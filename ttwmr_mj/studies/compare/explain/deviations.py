"""How far the plants are apart in a variant of a scenario, driven as in the comparison."""

from collections.abc import Callable
from functools import partial

from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.measures.deviation import Deviation
from ttwmr_mj.studies.compare.motion import (
    follow_wheels,
    replay_analytic,
    replay_contact,
    replay_contact_run,
)


def deviation_under(commands: FloatArray, *, real_wheels: bool) -> Callable[[Scenario], Deviation]:
    """How to find a variant's deviation.

    Args:
        commands: wheel speeds (n, 2) (right, left), one per control period [rad/s], which drive
            contact physics and, without `real_wheels`, the analytic model.
        real_wheels: drive the analytic model with the actual wheel speeds of the variant.
    """
    return partial(_by_real_wheels if real_wheels else _by_commands, commands)


def _by_commands(commands: FloatArray, variant: Scenario) -> Deviation:
    contact = replay_contact(variant, commands)
    return Deviation.between(contact, replay_analytic(variant, commands))


def _by_real_wheels(commands: FloatArray, variant: Scenario) -> Deviation:
    contact = replay_contact_run(variant, commands)
    return Deviation.between(contact.trajectory, follow_wheels(contact))
