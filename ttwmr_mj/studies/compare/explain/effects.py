"""Effects of contact physics that the ideal model lacks, and how each is switched off."""

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass
from typing import Any

from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.studies.compare.variants import changed

Values = dict[str, Any]

IDEAL_STEPS = 4  # in one step of the scenario: more cost time and shrink the unexplained remainder
LEAST_STEPS = 2  # in a time constant: MuJoCo allows no stiffer contact
IDEAL_SERVO_GAIN = 1e3  # N·m·s/rad: the wheels lag by a millionth of a second
IDEAL_STALL_TORQUE_N_M = 1e3  # a stiff servo that saturates would bang from limit to limit
IDEAL_CASTER_MASS_KG = 1e-5  # a hundredth of the lab robot's; MuJoCo allows no zero
STEP, TIME_CONSTANT = "plant.contact.timestep_s", "plant.contact.contact_time_constant_s"
CASTER_MASS = "robot.casters.mass_kg"


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
        solver: whether it is how MuJoCo computes, and not how the robot is built: no real robot
            has it.
        shared: whether the analytic model has it, too, so that much of what it seems to do alone
            is a change in what others do.
        wheels: whether it is how the wheels follow their commands: nothing where the analytic
            model is driven by the wheels' actual speeds.
    """

    name: str
    text: str
    off: Callable[[Scenario], Values]
    needs: tuple[str, ...] = ()
    size: str | None = None
    solver: bool = False
    shared: bool = False
    wheels: bool = False

    def present(self, scenario: Scenario) -> bool:
        """Whether the scenario has it at all."""
        return changed(scenario, self.off(scenario)) != changed(scenario, {})

    def reach(self, scenario: Scenario) -> float:
        """The share of the effect that switching it off removes."""
        if self.size is None:
            return 1.0
        left = _value(changed(scenario, self.off(scenario)), self.size)
        return 1.0 - left / _value(scenario, self.size)


def _frictionless(scenario: Scenario) -> Values:
    count = len(scenario.robot.hitches)
    hitches = [f"hitches.{i}" for i in range(count)] if count > 1 else ["hitch"]
    keys = "damping_n_m_s_rad", "coulomb_friction_n_m"
    return {f"robot.{hitch}.{key}": 0.0 for hitch in hitches for key in keys}


EFFECTS = (
    Effect(
        "servo",
        "servo lag and droop",
        lambda _: {
            "robot.servo.velocity_gain_n_m_s_rad": IDEAL_SERVO_GAIN,
            "robot.servo.stall_torque_n_m": IDEAL_STALL_TORQUE_N_M,
            "robot.servo.motor": None,
        },
        wheels=True,
    ),
    Effect(
        "contact_compliance",
        "contact compliance (creep)",
        lambda s: {
            TIME_CONSTANT: min(
                _value(s, TIME_CONSTANT), LEAST_STEPS * _value(s, STEP) / IDEAL_STEPS
            )
        },
        size=TIME_CONSTANT,
        solver=True,
    ),
    Effect(
        "wheel_width", "wheel width (scrub)", lambda _: {"robot.tractor.wheel_shape": "ellipsoid"}
    ),
    Effect(
        "caster_inertia",
        "caster inertia",
        lambda s: {CASTER_MASS: min(_value(s, CASTER_MASS), IDEAL_CASTER_MASS_KG)},
        size=CASTER_MASS,
    ),
    Effect(
        "rolling_resistance",
        "rolling resistance and sockets of the balls",
        lambda _: {
            "robot.casters.rolling_resistance_m": 0.0,
            "robot.casters.socket_friction_n_m": 0.0,
        },
    ),
    Effect("hitch_friction", "hitch friction", _frictionless, shared=True),
    Effect(
        "timestep",
        "timestep",
        lambda s: {STEP: _value(s, STEP) / IDEAL_STEPS},
        needs=("contact_compliance",),
        size=STEP,
        solver=True,
    ),
)


def with_effects(
    scenario: Scenario, on: Collection[str], among: Iterable[Effect] = EFFECTS
) -> Scenario:
    """The scenario with only the named effects of those among; others stay as they are."""
    values: Values = {}
    for effect in among:
        if effect.name not in on:
            values |= effect.off(scenario)
    return changed(scenario, values)


def _value(scenario: Scenario, path: str) -> float:
    place: Any = scenario
    for key in path.split("."):
        place = getattr(place, key)
    return float(place)
