"""The laws of a batch: one for all simulations, or several, each with its own."""

from __future__ import annotations

import os
from collections.abc import Container
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.deadline import Deadline, described_within
from ttwmr_mj.errors import InputError, Overrun
from ttwmr_mj.runs.law.answers import Answers, is_sane, strange
from ttwmr_mj.scenario.tables.control import LONGEST_START_S
from ttwmr_mj.sensing import Estimate

# A law that plans along the whole reference takes 2 ms a period, `tvlqr` with three trailers.
STARTED_PERIODS = 5000


def start_limit_s(limit_s: float, task: Task) -> float:
    """How long a law's start may take for a run of that length [CPU s], of a scenario's limit."""
    periods = task.reference.time_s.size if task.reference else 0
    return limit_s * max(1.0, periods / STARTED_PERIODS)


def more_time(limit_s: float) -> str:
    """What to do where a law did not come up within a limit."""
    more_s = min(10.0 * limit_s, LONGEST_START_S)
    return f"to give it longer: --set control.controller_start_limit_s={more_s:g}"


def leave_if_forked(process: int) -> None:
    """End a process that a law has forked off this one, and that came back from it."""
    if os.getpid() != process:
        os._exit(1)


class NoRandomNumbers:
    """In place of a generator: whoever asks it for anything gets an error."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # as copy and pickle ask for them
            raise AttributeError(name)
        raise TypeError("a law that drives several scenarios has no random numbers (task.rng)")


@dataclass(frozen=True, slots=True)
class Part:
    """A law, not yet started, and its simulations."""

    controller: Controller
    task: Task
    who: NDArray[np.intp]  # by their place in the batch, rising


class Broken(NamedTuple):
    """Simulations without a command."""

    who: list[int]
    reason: str
    cause: BaseException | None = None


class Laws:
    """Asks the laws of a batch, each within its time, and checks what they answer.

    Attributes:
        deadline: of one answer; to be armed and disarmed by who asks.
    """

    def __init__(
        self,
        parts: list[Part],
        nsim: int,
        limits_s: tuple[float, float],
        *,
        torque_input: bool = False,
    ) -> None:
        """Take the laws.

        Args:
            parts: together they have every simulation once.
            nsim: simulations.
            limits_s: CPU time of a start and of an answer, for one simulation; a batch asks for
                many at once.
            torque_input: whether wheel torques are needed, beside the speeds.
        """
        self._parts, self._nsim = parts, nsim
        self._start_limit_s, self._limit_s = limits_s
        self._answers = Answers(torque_input)
        self.deadline = Deadline(self._limit_s)
        self._process = os.getpid()
        self._warnings: dict[str, Any] = dict(np.geterr())

    def start(self) -> list[Broken]:
        """Start them; who breaks ends before its first command.

        Raises:
            InputError: from a law's start.
        """
        broken = []
        for part in self._parts:
            limit_s = part.who.size * start_limit_s(self._start_limit_s, part.task)
            self.deadline.limit_s = limit_s
            try:
                with self.deadline, self._heard(part):
                    part.controller.start(part.task)
            except (InputError, KeyboardInterrupt):
                raise
            except np.linalg.LinAlgError as error:
                reason = (
                    "controller.start() found no gains for these numbers of robot and reference "
                    f"({error}); {_what_decides(part.task)}"
                )
                broken.append(Broken(part.who.tolist(), reason, error))
            except BaseException as error:  # a law of the user's may raise anything
                reason = f"controller.start() raised {described_within(limit_s, error)}"
                if isinstance(error, Overrun):
                    hint = more_time(self._start_limit_s)
                    reason = f"controller.start() timed out after {limit_s:g} s; {hint}"
                broken.append(Broken(part.who.tolist(), reason, error))
            finally:
                leave_if_forked(self._process)
        return broken

    def command(
        self, k: int, estimate: Estimate, ended: Container[int]
    ) -> tuple[Command | None, list[Broken]]:
        """The commands of sample k, in one; None where there is none.

        Args:
            k: the sample.
            estimate: what all know.
            ended: simulations that need no command; they get zero.

        Returns:
            the command, and who has none, though it should.
        """
        answers, broken = [], []
        for part in self._parts:
            if ended and all(i in ended for i in part.who.tolist()):
                continue
            answer = self._ask(part, k, estimate)
            if isinstance(answer, Broken):
                broken.append(answer)
                continue
            answers.append((part.who, answer))
            if not is_sane(answer):
                broken += _without_sense(part.who, answer, ended)
        if not answers:
            return None, broken
        command = answers[0][1] if len(self._parts) == 1 else self._joined(answers)
        return command, broken

    def _ask(self, part: Part, k: int, estimate: Estimate) -> Command | Broken:
        self.deadline.limit_s = part.who.size * self._limit_s
        # what a law does to the arrays that it was given is nobody else's business
        seen = estimate.copy() if len(self._parts) == 1 else estimate.of(part.who)
        try:
            with self.deadline, self._heard(part):
                answer = part.controller.command(k, seen)
                return self._answers.checked(answer, part.who.size)
        except KeyboardInterrupt:  # of the user, who is not to be ignored
            raise
        except BaseException as error:
            time_s = k * part.task.sampling_time_s
            return Broken(part.who.tolist(), _broken(error, time_s, self.deadline.limit_s), error)
        finally:
            leave_if_forked(self._process)

    def _heard(self, part: Part) -> np.errstate:
        """A law of the user's warns of its numbers as its author has it."""
        ours = type(part.controller).__module__.startswith("ttwmr_mj.")
        return np.errstate() if ours else np.errstate(**self._warnings)

    def _joined(self, answers: list[tuple[NDArray[np.intp], Command]]) -> Command:
        """One command for all, zero for those without."""
        nsim, names = self._nsim, self._answers.names or ()
        joined = Command(
            np.zeros((nsim, 2)),
            saturated=np.zeros(nsim, dtype=np.bool_),
            near_singular=np.zeros(nsim, dtype=np.bool_),
            signals={name: np.full(nsim, np.nan) for name in names},
            wheel_torque_n_m=np.zeros((nsim, 2)) if self._answers.torque_input else None,
        )
        for who, command in answers:
            joined.wheel_speed_rad_s[who] = command.wheel_speed_rad_s
            joined.saturated[who] = command.saturated
            joined.near_singular[who] = command.near_singular
            for name in names:
                joined.signals[name][who] = command.signals[name]
            if joined.wheel_torque_n_m is not None:
                joined.wheel_torque_n_m[who] = command.wheel_torque_n_m
        return joined


def _what_decides(task: Task) -> str:
    """What most likely leaves a law without gains."""
    acts = [
        name
        for name, key in (
            ("spring", "stiffness_n_m_rad"),
            ("damper", "damping_n_m_s_rad"),
            ("friction", "coulomb_friction_n_m"),
        )
        if any(np.any(getattr(hitch, key)) for hitch in task.robot.hitches)
    ]
    if acts:
        return f"the hitch's {' and '.join(acts)} decide{'s' * (len(acts) == 1)} most"
    return "a reference that is slower, or bends less, asks less"


def _without_sense(who: NDArray[np.intp], command: Command, ended: Container[int]) -> list[Broken]:
    """Whose wheel speeds or torques are not finite or beyond all wheels, each by itself."""
    broken = []
    for i, simulation in enumerate(who.tolist()):
        told = "" if simulation in ended else strange(command, i)
        if told:
            error = ValueError(told)
            broken.append(Broken([simulation], _broken(error), error))
    return broken


def _broken(error: BaseException, time_s: float = 0.0, limit_s: float = 0.0) -> str:
    """Why a controller gave no command, in words."""
    if isinstance(error, IndexError):
        hint = "; beyond its samples a reference goes on with task.reference.at(k)"
        return f"controller.command() raised {described_within(limit_s or 1.0, error)}{hint}"
    if not isinstance(error, Overrun):
        return f"controller.command() raised {described_within(limit_s or 1.0, error)}"
    return (
        f"the controller timed out after {limit_s:g} s at its sample at t = {time_s:.3f} s "
        "(limit: control.controller_time_limit_s)"
    )
