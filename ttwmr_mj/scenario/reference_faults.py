"""What can be wrong between a scenario's reference, its robot and its controller."""

from __future__ import annotations

import numpy as np

from ttwmr_mj.controllers.flatness import LEAST_ACCELERATION_M_S2
from ttwmr_mj.controllers.options import FlatnessController, TvlqrController
from ttwmr_mj.dynamics.flatness import dot, trailer_axes
from ttwmr_mj.errors import InputError
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.run import build
from ttwmr_mj.scenario.faults import Fault
from ttwmr_mj.scenario.schema import LyapunovPidController, Scenario

MOST_SAMPLES = 20_000  # a longer run is looked at that often; its controller looks at every sample
SECTION = "reference"


def reference_faults(scenario: Scenario) -> list[Fault]:
    """Faults of the reference itself, or else of the controller that shall follow it."""
    try:
        reference = build.make_reference(scenario)
    except InputError as error:
        return [_named(str(error))]
    if reference is None:
        return []
    count = min(scenario.periods + 1 + build.LOOKAHEAD_SAMPLES, MOST_SAMPLES)
    end_s = (scenario.periods + build.LOOKAHEAD_SAMPLES) * scenario.control.sampling_time_s
    try:
        with np.errstate(all="ignore"):  # what does not move has no direction: NaN, found below
            path = reference.sample(np.linspace(0.0, end_s, count))
    except InputError as error:
        return [_named(str(error))]
    fault = _needed(scenario, path)
    return [fault] if fault else []


def _named(message: str) -> Fault:
    """The fault of an error whose message may begin with a key of this section."""
    where, colon, rest = message.partition(": ")
    if colon and where.startswith(f"{SECTION}."):
        return Fault(tuple(where.split(".")), rest)
    return Fault((SECTION, "kind"), message)


def _needed(scenario: Scenario, path: ReferencePath) -> Fault | None:
    """What the controller needs of the reference and does not find."""
    section = scenario.controller
    if isinstance(section, FlatnessController):
        return _for_flatness(scenario, path)
    undefined = np.isnan(path.theta).any(axis=(1, 2))
    if isinstance(section, TvlqrController) and undefined.any():
        message = f"at {path.time_s[undefined][0]:g} s; controller.kind = {section.kind!r} steers "
        message += "the trailer and needs θ2 everywhere, as a circle with theta2 = 'outward', "
        message += "'flat_circle' or 'planned' have it"
        return _theta2(scenario, message)
    if (
        isinstance(section, LyapunovPidController)
        and (section.correction, section.theta2_reference) == ("pid", "reference")
        and undefined.all()
    ):
        message = "everywhere; controller.theta2_reference = 'reference' needs it: give "
        message += "'aligned' or 'outward' here, or 'tractor' there"
        return _theta2(scenario, message)
    return None


def _theta2(scenario: Scenario, message: str) -> Fault:
    """θ2 is not defined where it is needed."""
    key = "theta2" if hasattr(scenario.reference, "theta2") else "kind"
    got = getattr(scenario.reference, key)
    return Fault((SECTION, key), f"got {got!r}, which leaves θ2 undefined {message}")


def _for_flatness(scenario: Scenario, path: ReferencePath) -> Fault | None:
    """The flatness law needs the centre of oscillation, accelerating."""
    keys, kind = (SECTION, "kind"), scenario.reference.kind
    law = "controller.kind = 'flatness'"
    if path.flat_derivatives is None:
        return Fault(
            keys,
            f"got {kind!r}; {law} needs a reference of the trailer's centre of oscillation, as "
            "'flat_circle', 'flat_ellipse' or 'flat_arc'",
        )
    direction, _ = trailer_axes(path.theta2_rad)
    along = np.abs(dot(path.flat_derivatives[:, :, 2], direction)).min(axis=1)
    along = np.nan_to_num(along)  # an undefined direction is that of no acceleration
    if along.min() >= LEAST_ACCELERATION_M_S2:
        return None
    return Fault(
        keys,
        f"got {kind!r}, on which the trailer's centre of oscillation hardly accelerates at "
        f"{path.time_s[along.argmin()]:.3g} s ({along.min():.1g} m/s²); {law} needs at least "
        f"{LEAST_ACCELERATION_M_S2:g} m/s² everywhere; 'tvlqr' and 'mpc' do not",
    )
