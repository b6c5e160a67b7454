"""Worlds: presets of what a controller is not told.

A world fills in keys that a scenario leaves out, and lets the controller believe what it would be
without the world. "kind" fills in nothing. "lab" is our estimate of the article's laboratory, of
which the article says little: each number has a reason. "unkind" is a distribution; the scenario's
seed draws from it, so that one seed is one world.
"""

import math
from collections.abc import Callable
from operator import attrgetter
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import BaseModel

World = Literal["kind", "lab", "unkind"]
FILLING = ("lab", "unkind")  # those that fill in something
Table = dict[str, Any]
PERIOD_S = 0.033  # control.sampling_time_s, where it is left out


LISTS = {"trailer": "trailers", "hitch": "hitches"}


class Known(NamedTuple):
    """A value of the laboratory."""

    key: str
    value: float | Table
    believed: float | None  # in its place; None: nothing is believed of it, or the truth
    reason: str


LAB = (
    Known("ground.slope_rad", 0.002, 0.0, "floors are laid level to 2 mm per metre"),
    Known(
        "robot.casters.rolling_resistance_m",
        1e-5,
        0.0,
        "hard balls on a hard floor: 5e-6 to 5e-5 m",
    ),
    Known(
        "robot.casters.socket_friction_n_m",
        1e-4,
        0.0,
        "ball transfer units take 0.005 to 0.02 of their load; 0.8 % of it here",
    ),
    Known(
        "robot.hitch.coulomb_friction_n_m",
        3e-4,
        0.0,
        "a pin of 4 mm, pressed by about a newton, steel on brass: 0.15 · 1 N · 2 mm",
    ),
    Known(
        "robot.tractor.wheel_radius_difference_m",
        5e-5,
        0.0,
        "moulded tyres are alike to 0.2 % of their radius",
    ),
    Known(
        "robot.servo.motor",
        {},
        None,
        "a direct-current motor with its gear and firmware, of the article's servo's class",
    ),
)
LAB_TRUTH = (  # where the sensor is "truth": what the laboratory's camera and tracker leave
    Known("sensing.latency_s", PERIOD_S, None, "one frame from exposure to arrival, and known"),
    Known("sensing.position_noise_m", 2e-4, None, "labels are found to 0.2 mm on the floor"),
    Known("sensing.angle_noise_rad", 1e-3, None, "0.1 mm across a body of 0.1 m"),
    Known("sensing.velocity_noise_m_s", 5e-3, None, "0.2 mm from frame to frame, filtered"),
    Known("sensing.rate_noise_rad_s", 0.02, None, "1 mrad from frame to frame, filtered"),
)

# The unkind world: largest values, each drawn evenly up to them (slope and camera in any direction)
SLOPE_RAD = math.radians(0.5)
ROLLING_M = 1e-4
DRY_N_M = 1e-3
LENGTH_SHARE = 0.05  # of l, to either side
RADIUS_SHARE = 0.01  # of the wheels' radius, to either side
LATENCY_PERIODS = 1  # more or fewer than are told
CAMERA_M = 0.005  # displacement after calibration
CAMERA_RAD = math.radians(0.25)  # tilt after calibration

UNKIND = (  # key, range and reason, for who reads
    ("ground.slope_rad", f"0 to {SLOPE_RAD:.4f} (0.5°), downhill anywhere", "a floor as laid"),
    (
        "robot.casters.rolling_resistance_m",
        f"0 to {ROLLING_M:g}",
        "up to soft balls on a soft floor",
    ),
    ("robot.hitch.coulomb_friction_n_m", f"0 to {DRY_N_M:g}", "a pin dry, or bound by its load"),
    (
        "robot.trailer.com_offset_m",
        f"the given one ± {LENGTH_SHARE:.0%}",
        "a load put down by hand, to 7 mm",
    ),
    (
        "robot.tractor.wheel_radius_m",
        f"the given one ± {RADIUS_SHARE:.0%}",
        "tyres worn or pressed by 0.26 mm",
    ),
    (
        "sensing.latency_s",
        "the given one (0.033 if none), one period less or more, or as it is",
        "a pipeline of frames that nobody has measured",
    ),
    (
        "sensing.camera.x_m, y_m",
        f"within {CAMERA_M:g} of where it was calibrated",
        "a tripod that was touched",
    ),
    (
        "sensing.camera.roll_rad, pitch_rad",
        f"within {CAMERA_RAD:.4f} (0.25°) of how it was calibrated",
        "the same",
    ),
)


def filled(given: Table, told: BaseModel) -> Table:
    """A scenario's table with what its world adds.

    What the scenario gives, stays. Lengths, radii and latencies that the unkind world changes are
    changed about the given value, unless the scenario says itself what is believed of them; so a
    resolved scenario is filled no further.

    Args:
        given: as in the file, overrides applied, with a world that fills in something.
        told: the scenario that it is without that, valid.
    """
    filling = _Filling(given, told)
    return filling.lab() if given["world"] == "lab" else filling.unkind()


class _Filling:
    """A scenario's table, being filled."""

    def __init__(self, given: Table, told: BaseModel) -> None:
        self._given, self._told, self._table = given, told, _copied(given)
        self._camera = self._value("sensing.kind") == "camera"

    def lab(self) -> Table:
        """The laboratory's values."""
        for known in (*LAB, *(() if self._camera else LAB_TRUTH)):
            self._add(known.key, known.value, known.believed)
        return self._table

    def unkind(self) -> Table:
        """One draw; all numbers are drawn, in this order, whatever the scenario gives."""
        rng = np.random.default_rng(np.random.SeedSequence([self._value("seed"), *b"world"]))
        slope, rolling, dry, length, radius, off, tilt = rng.uniform(size=7).tolist()
        downhill, aside, tilted = rng.uniform(-math.pi, math.pi, 3).tolist()
        frames = int(rng.integers(-LATENCY_PERIODS, LATENCY_PERIODS, endpoint=True))
        self._add("ground.slope_rad", SLOPE_RAD * slope, 0.0)
        self._add("ground.downhill_rad", downhill, 0.0)
        self._add("robot.casters.rolling_resistance_m", ROLLING_M * rolling, 0.0)
        self._add("robot.hitch.coulomb_friction_n_m", DRY_N_M * dry, 0.0)
        longer = 1.0 + LENGTH_SHARE * (2.0 * length - 1.0)
        larger = 1.0 + RADIUS_SHARE * (2.0 * radius - 1.0)
        self._change("robot.trailer.com_offset_m", lambda told: told * longer)
        self._change("robot.tractor.wheel_radius_m", lambda told: told * larger)
        period = self._value("control.sampling_time_s")
        self._change("sensing.latency_s", lambda told: max(told + frames * period, 0.0), period)
        if self._camera:
            self._move("x_m", CAMERA_M * math.sqrt(off) * math.cos(aside))
            self._move("y_m", CAMERA_M * math.sqrt(off) * math.sin(aside))
            self._move("roll_rad", CAMERA_RAD * math.sqrt(tilt) * math.cos(tilted))
            self._move("pitch_rad", CAMERA_RAD * math.sqrt(tilt) * math.sin(tilted))
        return self._table

    def _move(self, move: str, value: float) -> None:
        """The camera moved after calibration; before a calibration file it was not moved."""
        by_file = self._at("sensing.calibration_path") is not None
        key = f"sensing.camera.{move}"
        self._add(key, value, None if by_file else 0.0, believed_key=f"camera.{move}")

    def _add(
        self, key: str, value: float | Table, believed: float | None, believed_key: str = ""
    ) -> None:
        """A value that the scenario leaves out, and what is believed instead."""
        if self._at(key) is not None:
            return
        _set(self._table, key, value)
        belief = f"belief.{believed_key or key}"
        if believed is not None and self._at(belief) is None:
            _set(self._table, belief, believed)

    def _change(
        self, key: str, change: Callable[[float], float], usual: float | None = None
    ) -> None:
        """A value changed, while the one that the scenario gives is believed.

        Args:
            key: of the value.
            change: from the one that is given.
            usual: in place of the schema's default, where none is given.
        """
        belief = f"belief.{key.removeprefix('sensing.')}"
        if self._at(belief) is not None:
            return
        told = self._value(key) if usual is None or self._at(key) is not None else usual
        _set(self._table, belief, told)
        _set(self._table, key, change(told))

    def _value(self, key: str) -> Any:
        """What the scenario gives, or else its default."""
        return attrgetter(key)(self._told)

    def _at(self, key: str) -> Any:
        """What the scenario gives; None if nothing, or not in tables.

        The first trailer and hitch may be given by themselves, or first in their lists.
        """
        place: Any = self._given
        for part in key.split("."):
            if isinstance(place, dict):
                place = place.get(part, _first(place.get(LISTS.get(part, ""))))
            else:
                place = getattr(place, part, None)
        return place


def _first(items: Any) -> Any:
    return items[0] if isinstance(items, list | tuple) and items else None


def _copied(table: Table) -> Table:
    return {k: _copied(v) if isinstance(v, dict) else v for k, v in table.items()}


def _set(table: Table, key: str, value: float | Table) -> None:
    """Set a value in nested tables; where something else than a table is in the way, leave it."""
    *outer, last = key.split(".")
    place: Any = table
    for part in outer:
        place = place.setdefault(part, {})
        if not isinstance(place, dict):
            return
    place[last] = value
