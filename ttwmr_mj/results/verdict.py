"""Did a run do its job? One set of rules for every command that judges a run.

Judged are P, the trailer's COM and θ2, wherever the reference defines them; a reference without θ2
says nothing of the trailer, and P alone is judged. Each has two limits, those of `AcceptOptions`:

- In the last fifth of the time, END_SHARE, it stays within the `end_*` limit.
- Before, it stays within the `transient_*` limit. An offset of the start is given time to be worked
  off: what is allowed falls evenly from GROWTH times the error at the start to that limit, which it
  reaches after `settling_share` of the time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ttwmr_mj.errors import InputError, apart, require, shown
from ttwmr_mj.references.shared.demand import Feasibility
from ttwmr_mj.results.accept import END_SHARE, GROWTH, SLIPPING_M_S, AcceptOptions, VerdictName
from ttwmr_mj.results.curves import Curves, require_rows, require_run, start_of_last
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import FloatArray

# name → in words, and when a run gets it; of several the first
VERDICTS: dict[VerdictName, tuple[str, str]] = {
    "interrupted": ("interrupted", "it was stopped by the user"),
    "killed": ("killed", "its process was killed; `ttwmr score` sums up what is left of it"),
    "failed": ("failed", "physics or the controller broke, or the controller took too long"),
    "diverged": ("diverged", "the state left all bounds, or the robot turned over, flew or fell"),
    "tipped_over": ("tipped over", "the tractor tilted by more than `tilt_rad`"),
    "off_the_ground": (
        "off the ground",
        "P was higher than `height_m`, or a wheel did not touch the ground at more than "
        "`airborne_share` of the samples",
    ),
    "no_reference": ("no reference", "there was nothing to follow"),
    "blind": ("blind", "the sensor was blind for more than `blind_share` of the samples"),
    "reference_not_feasible": (
        "reference not feasible",
        "a limit below was exceeded, and the reference asks more of servo or tyres than they have",
    ),
    "saturated_throughout": (
        "saturated throughout",
        "commands were cut to the servo's range, or at its limit, at more than "
        "`saturated_share` of the samples",
    ),
    "lost": ("lost", "P exceeded a limit"),
    "tractor_follows_trailer_lost": (
        "tractor follows, trailer lost",
        "P kept its limits; the trailer's COM or θ2 exceeded one",
    ),
    "followed": ("followed", "all limits were kept"),
}
SUCCESSES = ("followed", "no_reference")  # what is no failure; without a reference nothing can be
MEASURES = {"tractor_m": "P", "trailer_m": "the trailer's COM", "theta2_rad": "θ2"}
FALLING = 0.95  # of the largest error of the fifth before, or less: the error is decreasing
NOTABLE = 0.02  # share of the samples from which wheels that slip or lift are told of
FREE_TRAILER = "free trailer"  # the check that says what no hitch gives
MISSING_TRAILER = "the reference says nothing of the trailer"


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a run is found to be.

    Attributes:
        name: one of VERDICTS.
        number: what decided, or came nearest to deciding; None where no number did.
        limit: its limit, in the same unit.
        what: number and limit in words; never empty.
    """

    name: VerdictName
    number: float | None
    limit: float | None
    what: str

    @property
    def words(self) -> str:
        """The name as people say it."""
        return VERDICTS[self.name][0]

    def __str__(self) -> str:
        return f"{self.words}: {self.what}"


class Error(NamedTuple):
    """The error of one measure, in the last fifth or before, where most of what is allowed."""

    measure: str
    number: float
    limit: float
    time_s: float | None  # None: in the last fifth of the run
    decreasing: bool = False  # as `_decreasing` has it

    @property
    def share(self) -> float:
        """Of what is allowed."""
        return self.number / self.limit

    def __str__(self) -> str:
        when = "in the last fifth of the run" if self.time_s is None else f"at {self.time_s:.3g} s"
        unit = self.measure.rpartition("_")[2]
        number, limit = _amounts(self.number, self.limit, unit)
        more = " and still decreasing" if self.decreasing else ""
        return f"{MEASURES[self.measure]} {number} off{more} {when} (limit {limit})"


def judge(
    trajectory: Trajectory,
    robot: RobotParameters,
    *,
    status: str = "ok",
    reason: str = "",
    accept: AcceptOptions | None = None,
    demands: Feasibility | None = None,
) -> Verdict:
    """The verdict on one simulation.

    Args:
        trajectory: of that simulation, with every row finite if its status is ok.
        robot: that was driven.
        status: how it ended, as `runs.closed_loop.loop.Outcome` has it.
        reason: why, if it broke off.
        accept: the limits; None: the defaults.
        demands: what the reference asks of that robot; None: not looked at.

    Raises:
        InputError: the trajectory has several simulations or no rows, is of a robot with more or
            fewer trailers, or has rows that are not finite though its status is ok.
    """
    require_run(trajectory, robot)
    require(AcceptOptions | None, "accept", accept, hint="as in scenario.accept")
    require(Feasibility | None, "demands", demands)
    if status != "ok":
        name = next((known for known in VERDICTS if known == status), None)
        if name is None:
            allowed = f"ok, {', '.join(VERDICTS)}"
            raise InputError.at("status", got=shown(status), allowed=allowed)
        return Verdict(name, None, None, reason)
    require_rows(trajectory)
    accept = accept or AcceptOptions()
    rows = trajectory.simulation()
    if not (finite := np.isfinite(rows.q).all(axis=(1, 2))).all():  # no error would look like none
        problem = f"q is not finite at {rows.time_s[finite.argmin()]:.3g} s"
        raise InputError.at("trajectory", problem, hint="give the status that the run ended with")
    if (fallen := _footing(rows, accept)) is not None:
        return fallen
    errors = list(_errors(rows, robot, accept))
    if not errors:
        return Verdict("no_reference", None, None, "there was nothing to follow")
    if (blind := float(1.0 - rows.est_valid.mean())) > accept.blind_share:
        return _share("blind", blind, accept.blind_share, "the sensor was blind at")
    broken = [error for error in errors if error.share > 1.0]
    if broken and demands and (asked := demands.undrivable):
        worst = _gravest(broken)
        what = f"{asked[0].sentence}; {worst}"
        return Verdict("reference_not_feasible", asked[0].worst, asked[0].limit, what)
    if (cut := float(rows.saturated.mean())) > accept.saturated_share:
        return _share("saturated_throughout", cut, accept.saturated_share, "commands were cut at")
    return _verdict_of(errors, broken, demands, rows)


def _verdict_of(
    errors: list[Error], broken: list[Error], demands: Feasibility | None, rows: Trajectory
) -> Verdict:
    """Followed, lost, or the trailer alone lost."""
    tractor = [error for error in broken if error.measure == "tractor_m"]
    if tractor:
        worst = _gravest(tractor)
        return Verdict("lost", worst.number, worst.limit, f"{worst}{_wheels(rows)}")
    if broken:
        worst = _gravest(broken)
        what = f"{worst}{_not_free(demands)}{_wheels(rows)}"
        return Verdict("tractor_follows_trailer_lost", worst.number, worst.limit, what)
    nearest = max((e for e in errors if e.time_s is None), key=lambda error: error.share)
    judged = {error.measure for error in errors}
    what = f"at most {nearest}" if len(judged) > 1 else f"at most {nearest}; {MISSING_TRAILER}"
    return Verdict("followed", nearest.number, nearest.limit, what)


def _footing(rows: Trajectory, accept: AcceptOptions) -> Verdict | None:
    """Tipped over or off the ground; None while it stands, or where nothing is known of that."""
    if not np.isfinite(rows.tilt_rad).any():
        return None
    if (tilt := float(np.nanmax(rows.tilt_rad))) > accept.tilt_rad:
        number, limit = _amounts(tilt, accept.tilt_rad, "rad")
        what = f"the tractor tilted by {number} (limit {limit})"
        return Verdict("tipped_over", tilt, accept.tilt_rad, what)
    if (height := float(np.nanmax(rows.height_m))) > accept.height_m:
        number, limit = _amounts(height, accept.height_m, "m")
        what = f"P rose by {number} (limit {limit})"
        return Verdict("off_the_ground", height, accept.height_m, what)
    if (share := float((rows.wheels_on_floor < 2).mean())) > accept.airborne_share:
        what = "a wheel was off the ground at"
        return _share("off_the_ground", share, accept.airborne_share, what)
    return None


def _wheels(rows: Trajectory) -> str:
    """What wheels did that explains a loss; empty if they rolled."""
    found = {
        "a wheel was off the ground at": float((rows.wheels_on_floor < 2).mean()),
        "wheels slipped at": float((rows.wheel_slip_m_s > SLIPPING_M_S).mean()),
    }
    told = [f"{what} {100 * x:.3g} % of the samples" for what, x in found.items() if x > NOTABLE]
    return "".join(f"; {words}" for words in told)


def _not_free(demands: Feasibility | None) -> str:
    """What the reference asks of the hitch beyond what it gives; empty if nothing."""
    for check in demands.checks if demands else ():
        if check.name == FREE_TRAILER and not check.kept:
            return f"; the reference asks the hitch for {check.worst:.2g} N·m that it does not have"
    return ""


def _gravest(broken: list[Error]) -> Error:
    """What is wrong in the last fifth before what was wrong for a while; then the largest share."""
    return max(broken, key=lambda error: (error.time_s is None, error.share))


def _share(name: VerdictName, number: float, limit: float, what: str) -> Verdict:
    share, most = apart(100.0 * number, 100.0 * limit, 3)
    return Verdict(name, number, limit, f"{what} {share} % of the samples (limit {most} %)")


def _errors(rows: Trajectory, robot: RobotParameters, accept: AcceptOptions) -> Iterator[Error]:
    """Of each measure that the reference defines: before the last fifth, and in it."""
    curves = Curves.of(rows, robot)
    values = {
        "tractor_m": curves.tractor_error_m,
        "trailer_m": curves.trailer_error_m,
        # of several trailers the one that is furthest off
        "theta2_rad": np.abs(curves.theta_error_rad[..., 1:]).max(axis=-1),
    }
    time_s = rows.time_s
    since_s = time_s - time_s[0]  # of a part of a run, too
    end = start_of_last(END_SHARE, time_s)
    for measure, batch in values.items():
        error = batch[:, 0]
        if not np.isfinite(error).any():
            continue
        lasting = getattr(accept, f"transient_{measure}")
        allowed = _allowed(error, since_s, lasting, accept.settling_share)
        share = np.nan_to_num(error / allowed)[:end]
        if share.size:  # of a single sample there is no before
            k = int(share.argmax())
            before = float(np.nan_to_num(error)[k])
            yield Error(measure, before, float(allowed[k]), float(time_s[k]))
        last, limit = np.nan_to_num(error[end:]), getattr(accept, f"end_{measure}")
        decreasing = limit < last.max() and _decreasing(error, time_s)
        yield Error(measure, float(last.max()), limit, None, decreasing)


def _decreasing(error: FloatArray, time_s: FloatArray) -> bool:
    """Whether the largest error (n,) of each of the last three fifths is well below the one before.

    Largest errors do not depend on the phase of an oscillation, three falls leave little to chance.
    """
    starts = [start_of_last(fifths * END_SHARE, time_s) for fifths in (4, 3, 2, 1)]
    largest = [part.max(initial=0.0) for part in np.split(error, starts)[1:]]  # NaN: undefined
    return all(later <= FALLING * earlier for earlier, later in pairwise(largest))


def _allowed(
    error: FloatArray, since_s: FloatArray, lasting: float, settling_share: float
) -> FloatArray:
    """(n,) what an error (n,) may be: its start, worked off evenly, then the lasting limit."""
    start = GROWTH * error[np.isfinite(error)][0]
    left = 1.0 - since_s / max(settling_share * since_s[-1], np.finfo(float).tiny)
    return np.asarray(lasting + max(start - lasting, 0.0) * np.maximum(left, 0.0))


def _amounts(number: float, limit: float, unit: str) -> tuple[str, str]:
    """A number and its limit, told apart where they differ."""
    texts = _amount(number, unit), _amount(limit, unit)
    if number == limit or texts[0] != texts[1]:
        return texts
    factor, unit = (1e3, "mm") if unit == "m" and limit < 1.0 else (1.0, unit)
    one, other = apart(factor * number, factor * limit)
    return f"{one} {unit}", f"{other} {unit}"


def _amount(value: float, unit: str) -> str:
    """Three digits and the unit; lengths below a metre in mm."""
    return f"{1e3 * value:.3g} mm" if unit == "m" and value < 1.0 else f"{value:.3g} {unit}"
