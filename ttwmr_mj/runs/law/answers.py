"""What a law answers, checked: a user's may return anything."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ttwmr_mj.controllers.base import Command
from ttwmr_mj.results.trajectory import TORQUE_SIGNALS, is_column_of_a_train
from ttwmr_mj.state import FloatArray

SIGNAL_NAME = re.compile(r"[a-z][a-z0-9_]{0,99}")
MOST_SIGNALS = 200
LARGEST = 1e9  # rad/s or N·m: squares and sums of such numbers are still numbers


@dataclass(slots=True)
class Answers:
    """Checks a law's answers, and that its signals stay the same.

    Attributes:
        torque_input: whether wheel torques are needed, beside the speeds.
        names: of the signals, as the first answer has them.
    """

    torque_input: bool = False
    names: tuple[str, ...] | None = field(default=None, init=False)

    def checked(self, answer: Any, nsim: int) -> Command:
        """The answer in arrays that nobody else has.

        Raises:
            ValueError, AttributeError: it is not a command for so many simulations.
        """
        if not hasattr(answer, "wheel_speed_rad_s"):
            raise ValueError(
                f"the answer is of the type {type(answer).__name__}; allowed: a ttwmr_mj.Command, "
                "such as Command.plain(wheel speeds of shape (nsim, 2))"
            )
        signals = self._signals(answer.signals, nsim)
        torque = None
        if self.torque_input:
            torque = _torques(answer.wheel_torque_n_m, nsim)
            signals |= zip(TORQUE_SIGNALS, torque.T.copy(), strict=True)
        if self.names is None:  # the first answer says which signals there are
            self._refuse_names(answer.signals)
            self.names = tuple(signals)
        if signals.keys() != set(self.names):
            raise ValueError(
                f"the signals are {_listed(signals)}; at the first sample they were "
                f"{_listed(self.names)}, and they must stay the same"
            )
        return Command(
            _numbers(answer.wheel_speed_rad_s, (nsim, 2), "wheel speeds have", "wheel speeds are"),
            _flags(answer.saturated, nsim, "saturated"),
            _flags(answer.near_singular, nsim, "near_singular"),
            signals,
            torque,
        )

    def _signals(self, given: Mapping[str, Any], nsim: int) -> dict[str, FloatArray]:
        if len(given) > MOST_SIGNALS:
            raise ValueError(f"there are {len(given)} signals, allowed: {MOST_SIGNALS}")
        return {
            name: _numbers(values, (nsim,), f"signal {name} has", f"signal {name} is")
            for name, values in given.items()
        }

    def _refuse_names(self, names: Iterable[Any]) -> None:
        for name in names:
            named = isinstance(name, str) and SIGNAL_NAME.fullmatch(name)
            logged = self.torque_input and name in TORQUE_SIGNALS
            if not named or logged or is_column_of_a_train(name):
                raise ValueError(
                    f"a signal is called {name!r}; allowed: lower-case letters, digits and _, "
                    "with the unit at the end, and no name of another column, of any train"
                )


def _numbers(values: Any, shape: tuple[int, ...], have: str, are: str) -> FloatArray:
    """A copy as float64 of real numbers of a shape."""
    if type(values) is not np.ndarray or values.dtype != np.float64:  # as a rule it is
        masked = isinstance(values, np.ma.MaskedArray)
        values = np.array(values)
        if masked or values.dtype.kind not in "fiu":
            raise ValueError(f"{are} not real numbers")
        with np.errstate(over="ignore"):  # of numbers wider than 64 bits
            values = values.astype(np.float64)
    if values.shape != shape:
        raise ValueError(f"{have} shape {values.shape}, allowed: {_shape(shape)}")
    return values.copy()  # type: ignore[no-any-return]


def _torques(given: Any, nsim: int) -> FloatArray:
    if given is None:
        raise ValueError("there are no wheel torques, which control.inner_loop = 'torque' needs")
    return _numbers(given, (nsim, 2), "wheel torques have", "wheel torques are")


def _flags(values: Any, nsim: int, name: str) -> Any:
    flags = values.copy() if type(values) is np.ndarray else np.array(values)
    if flags.shape != (nsim,):
        raise ValueError(f"{name} has shape {flags.shape}, allowed: ({nsim},)")
    if flags.dtype != np.bool_:
        raise ValueError(f"{name} is not of booleans")
    return flags


def _shape(shape: tuple[int, ...]) -> str:
    return f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"


def _listed(names: Iterable[Any]) -> str:
    return str(sorted(map(str, names)))


def is_sane(command: Command) -> bool:
    """Whether all wheel speeds and torques are finite and below LARGEST."""
    torque = command.wheel_torque_n_m
    sane = np.abs(command.wheel_speed_rad_s).max() <= LARGEST
    return bool(sane and (torque is None or np.abs(torque).max() <= LARGEST))


def strange(command: Command, row: int) -> str:
    """What of one simulation's command is not sane, in words; empty where all is."""
    given = {"torques": command.wheel_torque_n_m, "speeds": command.wheel_speed_rad_s}
    for name, values in given.items():
        if values is None:
            continue
        one = values[row : row + 1]
        if not np.isfinite(one).all():
            return f"wheel {name} are not finite: {one.tolist()}"
        if np.abs(one).max() > LARGEST:
            return f"wheel {name} are beyond {LARGEST:g}: {one.tolist()}"
    return ""
