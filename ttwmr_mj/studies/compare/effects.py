"""What contact physics has and the ideal model has not, and how each is switched off."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare.variant import changed

Values = dict[str, Any]

IDEAL_STEPS = 4  # in one step of the scenario: more cost time and shrink the unexplained rest
STEPS_PER_TIME_CONSTANT = 2  # MuJoCo allows no stiffer contact
IDEAL_SERVO_GAIN = 1e3  # N·m·s/rad: the wheels lag by a millionth of a second
IDEAL_STALL_TORQUE_N_M = 1e3  # a stiff servo that saturates would bang from limit to limit
IDEAL_CASTER_MASS_KG = 1e-5


@dataclass(frozen=True, slots=True)
class Effect:
    """One effect.

    Attributes:
        name: as in compare.json.
        text: what it is, for tables.
        off: the scenario's values that switch it off.
        needs: effects that must be on for this one to be on: MuJoCo's contacts cannot be stiffer
            than the step allows, so a coarse step needs soft contacts.
        size: key of a number that the effect is proportional to and that cannot be zero; None
            where off means off.
    """

    name: str
    text: str
    off: Callable[[Scenario], Values]
    needs: tuple[str, ...] = ()
    size: str | None = None

    def present(self, scenario: Scenario) -> bool:
        """Whether the scenario has it at all."""
        return changed(scenario, self.off(scenario)) != scenario

    def reach(self, scenario: Scenario) -> float:
        """The share of the effect that switching it off removes."""
        if self.size is None:
            return 1.0
        left = _value(changed(scenario, self.off(scenario)), self.size)
        return 1.0 - left / _value(scenario, self.size)


def ideal_step_s(scenario: Scenario) -> float:
    """The step of the ideal: a whole fraction of the scenario's."""
    return scenario.plant.contact.timestep_s / IDEAL_STEPS


def _ideal_servo(scenario: Scenario) -> Values:
    del scenario
    return {
        "robot.servo.velocity_gain_n_m_s_rad": IDEAL_SERVO_GAIN,
        "robot.servo.stall_torque_n_m": IDEAL_STALL_TORQUE_N_M,
    }


def _stiff_contact(scenario: Scenario) -> Values:
    ideal = STEPS_PER_TIME_CONSTANT * ideal_step_s(scenario)
    now = scenario.plant.contact.contact_time_constant_s
    return {"plant.contact.contact_time_constant_s": min(now, ideal)}


EFFECTS = (
    Effect("servo", "servo lag and droop", _ideal_servo),
    Effect(
        "contact_compliance",
        "contact compliance (creep)",
        _stiff_contact,
        size="plant.contact.contact_time_constant_s",
    ),
    Effect(
        "wheel_width",
        "wheel width (scrub)",
        lambda _: {"robot.tractor.wheel_shape": "ellipsoid"},
    ),
    Effect(
        "caster_inertia",
        "caster inertia",
        lambda s: {
            "robot.casters.mass_kg": min(s.robot.casters.mass_kg, IDEAL_CASTER_MASS_KG),
        },
        size="robot.casters.mass_kg",
    ),
    Effect(
        "rolling_resistance",
        "rolling resistance",
        lambda _: {"robot.casters.rolling_resistance_m": 0.0},
    ),
    Effect(
        "hitch_friction",
        "hitch friction",
        lambda _: {
            "robot.hitch.damping_n_m_s_rad": 0.0,
            "robot.hitch.coulomb_friction_n_m": 0.0,
        },
    ),
    Effect(
        "timestep",
        "timestep",
        lambda s: {"plant.contact.timestep_s": ideal_step_s(s)},
        needs=("contact_compliance",),
        size="plant.contact.timestep_s",
    ),
)


def with_effects(scenario: Scenario, on: Collection[str]) -> Scenario:
    """The scenario with only the named effects."""
    values: Values = {}
    for effect in EFFECTS:
        if effect.name not in on:
            values |= effect.off(scenario)
    return changed(scenario, values)


def _value(scenario: Scenario, path: str) -> float:
    place: Any = scenario
    for key in path.split("."):
        place = getattr(place, key)
    return float(place)
