"""Checks of a scenario's times: what must be whole steps of what, and how many there may be."""

from collections.abc import Iterable
from decimal import ROUND_CEILING

from ttwmr_mj.config import Config
from ttwmr_mj.errors import Fault, Keys, at_least, rounded
from ttwmr_mj.scenario.limits import MOST_PERIODS
from ttwmr_mj.scenario.schema import Scenario

PERIOD = "control.sampling_time_s"
STEP = "plant.contact.timestep_s"
MOST_AHEAD = 16  # periods, so that half of what observers remember is left to measurements


def physics_steps(scenario: Scenario) -> Iterable[Fault]:
    """Whether contact physics, where it is asked for, can keep the control period."""
    if scenario.plant.kind == "contact":  # the analytic plants solve a period at once
        yield from physics_step_faults(scenario)


def physics_step_faults(scenario: Scenario) -> Iterable[Fault]:
    """Whether contact physics could keep this control period."""
    step = scenario.plant.contact.timestep_s
    yield from _whole_steps(scenario.control, ("control",), "sampling_time_s", step, STEP)


def motor_timing(scenario: Scenario) -> Iterable[Fault]:
    """The firmware's loop counts in physics steps, and a control period in its loops."""
    motor = scenario.robot.servo.motor
    if motor is None or scenario.plant.kind != "contact":
        return
    place, loop = ("robot", "servo", "motor"), motor.loop_period_s
    step = scenario.plant.contact.timestep_s
    yield from _whole_steps(motor, place, "loop_period_s", step, STEP)
    loop_key = "robot.servo.motor.loop_period_s"
    for key in ("encoder_window_s", "command_delay_s"):
        yield from _whole_steps(motor, place, key, loop, loop_key)
    for key in ("sampling_time_s", "command_latency_s"):
        yield from _whole_steps(scenario.control, ("control",), key, loop, loop_key)


def pushes(scenario: Scenario) -> Iterable[Fault]:
    """Of at least one control period, in which alone they begin and end."""
    period = scenario.control.sampling_time_s
    for i, push in enumerate(scenario.plant.pushes):
        if push.duration_s < period - 1e-9:
            key = ("plant", "pushes", i, "duration_s")
            allowed = f"at least one control period, {rounded(period, ROUND_CEILING, 12)} s"
            yield Fault(key=key, got=f"{push.duration_s:g}", allowed=allowed)


def latency(scenario: Scenario) -> Iterable[Fault]:
    """Of measurements: control periods."""
    sensing, period = scenario.sensing, scenario.control.sampling_time_s
    for name in ("latency_s", "latency_jitter_s"):
        yield from _whole_steps(sensing, ("sensing",), name, period, PERIOD)


def command_latency(scenario: Scenario) -> Iterable[Fault]:
    """Of commands: physics steps, and no more control periods than observers look ahead."""
    control = scenario.control
    period = control.sampling_time_s
    yield from _whole_steps(control, ("control",), "command_jitter_s", period, PERIOD)
    told = "control" if scenario.belief.command_latency_s is None else "belief"
    if scenario.believed_command_latency_s > (MOST_AHEAD + 0.5) * period:
        got = f"{scenario.believed_command_latency_s:g}"
        allowed = f"at most {MOST_AHEAD} control periods, {MOST_AHEAD * period:g} s"
        hint = "belief.command_latency_s may be less, or 0"
        yield Fault(key=(told, "command_latency_s"), got=got, allowed=allowed, hint=hint)
    if control.command_latency_s:
        step = scenario.plant.contact.timestep_s
        yield from _whole_steps(control, ("control",), "command_latency_s", step, STEP)
        if scenario.plant.kind == "analytic":  # which counts in these steps only then
            yield from physics_step_faults(scenario)


def _whole_steps(
    table: Config, place: Keys, name: str, unit: float, unit_key: str
) -> Iterable[Fault]:
    """Whether a value of a table at a place is whole steps of a unit; zero is."""
    value: float = getattr(table, name)
    count = value / unit
    whole = abs(count - round(count)) <= 1e-6 * max(count, 1.0)  # TOML's decimals are not exact
    if whole and (value == 0.0 or round(count) >= 1):
        return
    least, most = _limits(type(table), name)
    around = (n * unit for n in (int(count), int(count) + 1))
    near = " and ".join(f"{x:.9g}" for x in around if least <= x <= most)
    allowed = f"a whole number of steps of {unit:.9g} s ({unit_key})"
    allowed += f"; nearest: {near}" if near else ""
    yield Fault(key=(*place, name), got=f"{value:g}", allowed=allowed)


def _limits(table: type[Config], name: str) -> tuple[float, float]:
    """The least and the largest value of a field that has both."""
    bounds = table.model_fields[name].metadata
    (least,) = (bound.ge for bound in bounds if hasattr(bound, "ge"))
    (most,) = (bound.le for bound in bounds if hasattr(bound, "le"))
    return least, most


def one_period(scenario: Scenario) -> Iterable[Fault]:
    """At least one control period, and no more than memory holds."""
    period = scenario.control.sampling_time_s
    if scenario.duration_s < period:
        allowed = f"at least one control period, {rounded(period, ROUND_CEILING, 12)}"
        yield Fault(key=("duration_s",), got=f"{scenario.duration_s:g}", allowed=allowed)
    elif scenario.periods > MOST_PERIODS:
        allowed = f"{at_least(scenario.duration_s / MOST_PERIODS)}: {MOST_PERIODS:,} periods"
        yield Fault(key=("control", "sampling_time_s"), got=f"{period:g}", allowed=allowed)
