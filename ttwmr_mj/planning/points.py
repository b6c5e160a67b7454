"""Points of a way, read from a table or from a drawing's polyline."""

import csv
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ttwmr_mj.errors import Fault, InputError, cut
from ttwmr_mj.files import MOST_BYTES
from ttwmr_mj.state import FloatArray

MOST_POINTS = 60  # of a plan; a line that is drawn with more is thinned evenly
LINES = ("polyline", "polygon", "path")
NUMBER = re.compile(r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
COMMAND = re.compile(r"([A-DF-Za-df-z])([^A-DF-Za-df-z]*)")  # an e belongs to a number
TRANSFORM = re.compile(r"([A-Za-z]+)\s*\(([^()]*)\)")
STYLED = re.compile(r"(?:^|;)\s*transform\s*:(?!\s*none)")
IDENTITY = {"matrix": (1, 0, 0, 1, 0, 0), "translate": (0, 0), "scale": (1, 1), "rotate": (0,)}
FARTHEST_M = 1e3  # from the origin


@dataclass(frozen=True, slots=True)
class Points:
    """What a file gives."""

    points_m: FloatArray  # (m, 2)
    closed: bool  # the drawing's line ends where it begins
    given: int  # points in the file, before thinning


def read_points(path: Path, metres_per_unit: float = 1e-3) -> Points:
    """Points of P from a .csv (x_m, y_m) or the first line of an .svg, centred, y up.

    Args:
        path: the file.
        metres_per_unit: of a drawing.

    Raises:
        InputError: it cannot be read, or holds no points; says why.
    """
    try:
        text = _text(path)
        if path.suffix.lower() == ".svg":
            points, closed = _from_svg(text)
            with np.errstate(all="ignore"):  # what overflows is too far
                points -= 0.5 * (points.min(axis=0) + points.max(axis=0))
                points *= (metres_per_unit, -metres_per_unit)
        else:
            points, closed = _from_table(text), False
        if not (np.abs(points) <= FARTHEST_M).all():
            raise ValueError(f"a point is farther than {FARTHEST_M:,.0f} m from the origin")
    except OSError as error:
        raise InputError(Fault(problem=error.strerror or str(error)), file=str(path)) from error
    except (ET.ParseError, csv.Error, ValueError) as error:
        raise InputError(
            Fault(problem=f"no points can be read: {error}"), file=str(path)
        ) from error
    if len(points) > 2 and np.hypot(*(points[-1] - points[0])) < 1e-6:
        points, closed = points[:-1], True
    return Points(_thinned(points, closed), closed, len(points))


def _text(path: Path) -> str:
    """What a file of bounded size holds; of a device no more than that is read."""
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise ValueError(f"larger than {MOST_BYTES:,} bytes")
    return content.decode("utf-8-sig")


def _from_table(text: str) -> FloatArray:
    """(m, 2) of lines "x, y", the first of which may be names; # begins a remark."""
    lines = [line.partition("#")[0] for line in text.splitlines()]
    rows = [row for row in csv.reader(lines, skipinitialspace=True) if "".join(row).strip()]
    if rows and not NUMBER.fullmatch(rows[0][0].strip()):
        names = [name.strip() for name in rows[0]]
        if not {"x_m", "y_m"} <= set(names):
            raise ValueError(f"the columns are {', '.join(names)}; there must be x_m and y_m")
        if twice := {name for name in ("x_m", "y_m") if names.count(name) > 1}:
            raise ValueError(f"there are several columns {' and '.join(sorted(twice))}")
        columns = [names.index("x_m"), names.index("y_m")]
        rows = rows[1:]
    else:
        columns = [0, 1]
        if rows and (width := max(map(len, rows))) > 2:
            raise ValueError(f"it has {width} columns without names; name two of them x_m and y_m")
    if short := [",".join(row) for row in rows if len(row) <= max(columns)]:
        raise ValueError(f"a line is not two numbers, x and y, but {short[0]}")
    try:
        points = np.array([[float(row[i]) for i in columns] for row in rows])
    except ValueError as error:
        raise ValueError(f"a line is not two numbers, x and y: {error}") from error
    if not len(points):
        raise ValueError("there are none")
    if not np.isfinite(points).all():
        raise ValueError("not every number is finite")
    return points


def _from_svg(text: str) -> tuple[FloatArray, bool]:
    """(m, 2) corners of the first line in a drawing, in its units, and whether it is closed."""
    drawing = ET.fromstring(text)
    around = {inner: one for one in drawing.iter() for inner in one}
    for element in drawing.iter():
        kind = element.tag.rpartition("}")[2]
        if kind not in LINES:
            continue
        outer: ET.Element | None = element
        while outer is not None:
            if _is_transformed(outer):
                name = outer.tag.rpartition("}")[2]
                whose = kind if outer is element else f"{kind} is in a {name} that"
                remedy = "flatten it (Inkscape: ungroup, save)"
                raise ValueError(f"its {whose} has a transform; {remedy}")
            outer = around.get(outer)
        if kind == "path":
            return _from_path(element.get("d", ""))
        numbers = np.array(_numbers(element.get("points", ""), kind))
        if numbers.size < 4 or numbers.size % 2:
            raise ValueError(f"its {kind} is not pairs of numbers")
        return numbers.reshape(-1, 2), kind == "polygon"
    raise ValueError(f"it has no {', '.join(LINES[:-1])} or {LINES[-1]}")


def _is_transformed(element: ET.Element) -> bool:
    """Whether a drawing's element has a transform that changes anything."""
    rest = TRANSFORM.sub(_unless_identity, element.get("transform", ""))
    return bool(rest.strip(" ,\t\r\n")) or bool(STYLED.search(element.get("style", "")))


def _unless_identity(transform: re.Match[str]) -> str:
    numbers = tuple(float(x) for x in NUMBER.findall(transform[2]))
    same = numbers and numbers == IDENTITY.get(transform[1], ())[: len(numbers)]
    return "" if same else transform[0]


def _from_path(d: str) -> tuple[FloatArray, bool]:
    """Corners of a path of straight lines."""
    points: list[tuple[float, float]] = []
    at, closed = (0.0, 0.0), False
    if begin := COMMAND.sub("", d).strip():
        raise ValueError(f"its path begins with {cut(begin)!r}, and must with M or m")
    for number, (letter, rest) in enumerate(COMMAND.findall(d)):
        numbers = _numbers(rest, "path")
        base = at if letter.islower() else (0.0, 0.0)
        if closed or (number and letter in "mM"):
            raise ValueError("its path has several pieces; leave one")
        steps: list[tuple[float, float]] = []
        if letter in "zZ":
            closed = True
        elif letter in "hH":
            steps = [(base[0] + x, at[1]) for x in numbers]
        elif letter in "vV":
            steps = [(at[0], base[1] + y) for y in numbers]
        elif letter in "mMlL":
            if len(numbers) % 2:
                raise ValueError(f"its path has {len(numbers)} numbers after {letter}, no pairs")
            steps = _along(zip(numbers[::2], numbers[1::2], strict=True), at, letter.islower())
        else:
            raise ValueError(f"its path has curves ({letter}); make it a line of straight pieces")
        points += steps
        at = points[-1] if points else at
    if len(points) < 2:
        raise ValueError("its path has no two corners")
    return np.array(points), closed


def _numbers(text: str, kind: str) -> list[float]:
    """All of a list, and nothing but numbers."""
    if other := NUMBER.sub(" ", text).replace(",", " ").split():
        raise ValueError(f"its {kind} has {cut(other[0])!r} where numbers should be")
    return [float(x) for x in NUMBER.findall(text)]


def _along(
    pairs: Iterable[tuple[float, float]], at: tuple[float, float], relative: bool
) -> list[tuple[float, float]]:
    points = []
    for x, y in pairs:
        at = (at[0] + x, at[1] + y) if relative else (x, y)
        points.append(at)
    return points


def _thinned(points: FloatArray, closed: bool) -> FloatArray:
    """At most MOST_POINTS, evenly along the line."""
    if len(points) <= MOST_POINTS:
        return points
    line = np.vstack([points, points[: int(closed)]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.linspace(0.0, along[-1], MOST_POINTS + int(closed))[:MOST_POINTS]
    return np.stack([np.interp(at, along, line[:, i]) for i in (0, 1)], axis=-1)
