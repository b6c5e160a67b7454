"""The laws of a batch: one for all simulations, or several, each with its own."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Container, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.controllers.base import Command, Controller, Task
from ttwmr_mj.errors import InputError, described
from ttwmr_mj.runs.deadline import Deadline, Overrun
from ttwmr_mj.sensing import Estimate

SIGNAL_NAME = re.compile(r"[a-z][a-z0-9_]*")
TORQUE_SIGNALS = ("wheel_torque_right_n_m", "wheel_torque_left_n_m")


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
        limit_s: float,
        taken: Collection[str] = (),
        *,
        torque_input: bool = False,
    ) -> None:
        """Take the laws.

        Args:
            parts: together they have every simulation once.
            nsim: simulations.
            limit_s: CPU time of an answer for one simulation; a batch asks for many at once.
            taken: names that signals must not have.
            torque_input: whether wheel torques are needed, beside the speeds.
        """
        self._parts, self._nsim, self._limit_s = parts, nsim, limit_s
        self._taken, self._torque_input = taken, torque_input
        self._names: tuple[str, ...] | None = None
        self.deadline = Deadline(limit_s)

    def start(self) -> list[Broken]:
        """Start them; who breaks ends before its first command.

        Raises:
            InputError: from a law's start.
        """
        broken = []
        for part in self._parts:
            try:
                part.controller.start(part.task)
            except (InputError, KeyboardInterrupt):
                raise
            except BaseException as error:  # a law of the user's may raise anything
                reason = f"controller.start() raised {described(error)}"
                broken.append(Broken(part.who.tolist(), reason, error))
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
            if not math.isfinite(_sum(answer)):  # one number shows a NaN or infinity in any
                broken += _not_finite(part.who, answer, ended)
        if not answers:
            return None, broken
        command = answers[0][1] if len(self._parts) == 1 else self._joined(answers)
        return command, broken

    def _ask(self, part: Part, k: int, estimate: Estimate) -> Command | Broken:
        self.deadline.limit_s = part.who.size * self._limit_s
        seen = estimate if len(self._parts) == 1 else estimate.of(part.who)
        try:
            with self.deadline:
                command = part.controller.command(k, seen)
            if self._torque_input:
                command = _with_torques_logged(command, part.who.size)
            self._check(command, part.who.size)
        except KeyboardInterrupt:  # of the user, who is not to be ignored
            raise
        except BaseException as error:
            time_s = k * part.task.sampling_time_s
            return Broken(part.who.tolist(), _broken(error, time_s, self.deadline.limit_s), error)
        return command

    def _check(self, command: Command, nsim: int) -> None:
        """An answer must be wheel speeds of the right shape, and the same signals every time."""
        shape = np.shape(command.wheel_speed_rad_s)
        if shape != (nsim, 2):
            raise ValueError(f"wheel speeds have shape {shape}, allowed: ({nsim}, 2)")
        for name in ("saturated", "near_singular"):
            if np.shape(getattr(command, name)) != (nsim,):
                got = np.shape(getattr(command, name))
                raise ValueError(f"{name} has shape {got}, allowed: ({nsim},)")
        if np.asarray(command.wheel_speed_rad_s).dtype.kind not in "fiu":
            raise ValueError("wheel speeds are not real numbers")
        if self._names is None:  # the first command says which signals there are
            self._refuse_names(command.signals)
            self._names = tuple(command.signals)
        if command.signals.keys() != set(self._names):
            raise ValueError(
                f"the signals are {sorted(command.signals)}; at the first sample they were "
                f"{sorted(self._names)}, and they must stay the same"
            )
        for name, values in command.signals.items():
            if np.shape(values) != (nsim,):
                raise ValueError(f"signal {name} has shape {np.shape(values)}, allowed: ({nsim},)")

    def _refuse_names(self, names: Iterable[str]) -> None:
        for name in names:
            if not SIGNAL_NAME.fullmatch(name) or name in self._taken:
                raise ValueError(
                    f"a signal is called {name!r}; allowed: lower-case letters, digits and _, "
                    "with the unit at the end, and no name of another column"
                )

    def _joined(self, answers: list[tuple[NDArray[np.intp], Command]]) -> Command:
        """One command for all, zero for those without."""
        nsim, names = self._nsim, self._names or ()
        joined = Command(
            np.zeros((nsim, 2)),
            saturated=np.zeros(nsim, dtype=np.bool_),
            near_singular=np.zeros(nsim, dtype=np.bool_),
            signals={name: np.full(nsim, np.nan) for name in names},
            wheel_torque_n_m=np.zeros((nsim, 2)) if self._torque_input else None,
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


def _sum(command: Command) -> float:
    torque = command.wheel_torque_n_m
    return float(command.wheel_speed_rad_s.sum()) + (0.0 if torque is None else torque.sum())


def _not_finite(who: NDArray[np.intp], command: Command, ended: Container[int]) -> list[Broken]:
    """Whose wheel speeds or torques are not finite, each by itself."""
    broken = []
    torque = command.wheel_torque_n_m
    given = {"wheel torques": torque, "wheel speeds": command.wheel_speed_rad_s}
    for i, simulation in enumerate(who.tolist()):
        for name, values in given.items():
            if values is None or simulation in ended or np.isfinite(values[i]).all():
                continue
            error = ValueError(f"{name} are not finite: {values[i : i + 1].tolist()}")
            broken.append(Broken([simulation], _broken(error), error))
            break
    return broken


def _with_torques_logged(command: Command, nsim: int) -> Command:
    """The command of a controller that must give wheel torques, these among its signals."""
    torque = command.wheel_torque_n_m
    if torque is None:
        raise ValueError("there are no wheel torques, which control.inner_loop = 'torque' needs")
    if np.shape(torque) != (nsim, 2):
        raise ValueError(f"wheel torques have shape {np.shape(torque)}, allowed: ({nsim}, 2)")
    columns = dict(zip(TORQUE_SIGNALS, torque.T, strict=True))
    return replace(command, signals={**command.signals, **columns})


def _broken(error: BaseException, time_s: float = 0.0, limit_s: float = 0.0) -> str:
    """Why a controller gave no command, in words."""
    if isinstance(error, IndexError):
        hint = "; beyond its samples a reference goes on with task.reference.at(k)"
        return f"controller.command() raised {described(error)}{hint}"
    if not isinstance(error, Overrun):
        return f"controller.command() raised {described(error)}"
    return (
        f"the controller timed out after {limit_s:g} s at its sample at t = {time_s:.3f} s "
        "(limit: control.controller_time_limit_s)"
    )
