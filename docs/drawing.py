"""Draws docs/images/robot.svg: the robot from above, with its names, lengths and signs.

python docs/drawing.py
"""

from __future__ import annotations

import math
from pathlib import Path

from ttwmr_mj.robot import RobotParameters

ROBOT = RobotParameters()
SCALE, WIDTH, HEIGHT = 1560.0, 980, 520  # px/m, px
ORIGIN = (400.0, 185.0)  # where P is
THETA1, THETA2 = math.radians(20.0), math.radians(52.0)
INK, TRACTOR, TRAILER, GREY = "#222222", "#0072B2", "#C2478A", "#8A8A8A"
STYLE = (
    "text{font-family:Helvetica,Arial,sans-serif;font-size:17px;fill:#222222}"
    ".i{font-style:italic}.s{font-size:14px;fill:#555555}"
)


class Frame:
    """A body's frame at P: x ahead along its heading, y to its left [m]."""

    def __init__(self, heading: float) -> None:
        self._cos, self._sin = math.cos(heading), math.sin(heading)

    def at(self, x: float, y: float = 0.0) -> tuple[float, float]:
        """The pixel of a point."""
        px = ORIGIN[0] + SCALE * (self._cos * x - self._sin * y)
        return px, ORIGIN[1] - SCALE * (self._sin * x + self._cos * y)


WORLD, FRONT, BACK = Frame(0.0), Frame(THETA1), Frame(THETA2)


def polygon(frame: Frame, corners: list[tuple[float, float]], colour: str) -> str:
    """A filled outline."""
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (frame.at(*corner) for corner in corners))
    return (
        f'<polygon points="{points}" fill="{colour}" fill-opacity="0.16" stroke="{colour}" '
        'stroke-width="1.6" stroke-linejoin="round"/>'
    )


def line(a: tuple[float, float], b: tuple[float, float], colour: str = INK, more: str = "") -> str:
    """A thin line between two pixels."""
    return (
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" '
        f'stroke="{colour}" stroke-width="1.3" {more}/>'
    )


def measure(
    frame: Frame, start: tuple[float, float], end: tuple[float, float], aside: float
) -> str:
    """A dimension line, moved aside to the left of the frame [m], with its extension lines."""
    a, b = ((x, y + aside) for x, y in (start, end))
    arrows = 'marker-start="url(#arrow)" marker-end="url(#arrow)"'
    parts = [line(frame.at(*a), frame.at(*b), INK, arrows)]
    beyond = math.copysign(0.006, aside)
    for (x, y), moved in ((start, a), (end, b)):
        parts.append(line(frame.at(x, y), frame.at(moved[0], moved[1] + beyond), GREY))
    return "".join(parts)


def arc(angle: float, radius: float) -> str:
    """An angle from +x, counter-clockwise, with its arrow."""
    x0, y0 = WORLD.at(radius)
    x1, y1 = Frame(angle).at(radius)
    r = SCALE * radius
    return (
        f'<path d="M {x0:.1f} {y0:.1f} A {r:.1f} {r:.1f} 0 0 0 {x1:.1f} {y1:.1f}" fill="none" '
        f'stroke="{INK}" stroke-width="1.3" marker-end="url(#arrow)"/>'
    )


def dot(frame: Frame, x: float, y: float, radius: float, colour: str) -> str:
    """A filled point."""
    px, py = frame.at(x, y)
    return f'<circle cx="{px:.1f}" cy="{py:.1f}" r="{radius}" fill="{colour}"/>'


def text(place: tuple[float, float], words: str, kind: str = "i", anchor: str = "start") -> str:
    """A label."""
    x, y = place
    return f'<text x="{x:.0f}" y="{y:.0f}" class="{kind}" text-anchor="{anchor}">{words}</text>'


def wheel(side: float) -> str:
    """One driven wheel."""
    b, r = ROBOT.half_track_m, ROBOT.tractor.wheel_radius_m
    corners = [(-r, side * b - 0.006), (r, side * b - 0.006)]
    corners += [(x, side * b + 0.006) for x in (r, -r)]
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (FRONT.at(*c) for c in corners))
    return f'<polygon points="{points}" fill="{INK}"/>'


def drawing() -> str:
    """The SVG."""
    b, k = ROBOT.half_track_m, ROBOT.swing_length_m
    com, half = ROBOT.trailer.com_distance_m, ROBOT.casters.trailer_half_spacing_m
    nose = ROBOT.casters.tractor_position_m
    body = [(-0.03, -0.045), (0.07, -0.045), (0.103, -0.015), (0.103, 0.015), (0.07, 0.045)]
    bed = [(-0.045, -0.035), (-0.213, -0.06), (-0.213, 0.06), (-0.045, 0.035)]
    head = "M0,0 L7,3 L0,6 z"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'role="img" aria-label="The robot from above">',
        f"<style>{STYLE}</style>",
        '<defs><marker id="arrow" viewBox="0 0 7 6" refX="7" refY="3" markerWidth="8" '
        f'markerHeight="7" orient="auto-start-reverse"><path d="{head}" fill="{INK}"/></marker>'
        "</defs>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        polygon(BACK, bed, TRAILER),
        line(BACK.at(0.0), BACK.at(-0.045), TRAILER, 'style="stroke-width:5"'),
        polygon(FRONT, [*body, (-0.03, 0.045)], TRACTOR),
        line(FRONT.at(0.0, -b), FRONT.at(0.0, b), INK, 'style="stroke-width:3"'),
        wheel(1.0),
        wheel(-1.0),
        dot(FRONT, nose, 0.0, 7, GREY),
        dot(BACK, -com, half, 7, GREY),
        dot(BACK, -com, -half, 7, GREY),
        # angles
        line(WORLD.at(0.0), WORLD.at(0.145), GREY, 'stroke-dasharray="5 4"'),
        line(FRONT.at(0.0), FRONT.at(0.135), TRACTOR, 'stroke-dasharray="5 4"'),
        line(BACK.at(-k - 0.02), BACK.at(0.095), TRAILER, 'stroke-dasharray="5 4"'),
        arc(THETA1, 0.125),
        arc(THETA2, 0.08),
        text((WORLD.at(0.131)[0], WORLD.at(0.0, 0.017)[1]), "θ1"),
        text(Frame(math.radians(50)).at(0.087), "θ2"),
        # lengths
        measure(BACK, (0.0, 0.0), (-com, 0.0), 0.085),
        measure(BACK, (0.0, 0.0), (-k, 0.0), -0.085),
        line(
            FRONT.at(0.016, 0.0),
            FRONT.at(0.016, b),
            INK,
            'marker-start="url(#arrow)" marker-end="url(#arrow)"',
        ),
        text(BACK.at(-0.5 * com - 0.006, 0.1), "l", anchor="middle"),
        text(BACK.at(-0.5 * k - 0.004, -0.098), "k", anchor="middle"),
        text(FRONT.at(0.025, 0.62 * b), "b"),
        # points
        dot(WORLD, 0.0, 0.0, 6, INK),
        dot(BACK, -com, 0.0, 5, TRAILER),
        dot(BACK, -k, 0.0, 5, INK),
        text((ORIGIN[0] + 12, ORIGIN[1] + 20), "P"),
        text(BACK.at(-com + 0.012, 0.008), "G", anchor="end"),
        text(BACK.at(-k - 0.006, -0.012), "F"),
        *_world(),
        *_legend(),
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _world() -> list[str]:
    corner, end, up = (40.0, 480.0), (95.0, 480.0), (40.0, 425.0)
    arrow = 'marker-end="url(#arrow)"'
    return [
        line(corner, end, INK, arrow),
        line(corner, up, INK, arrow),
        text((98, 485), "x"),
        text((35, 418), "y"),
    ]


def _legend() -> list[str]:
    rows = (
        ("P", "middle of the wheel axle, and the hitch"),
        ("θ1, θ2", "headings of tractor and trailer from +x,"),
        ("", "counter-clockwise positive; hitch angle θ2 − θ1"),
        ("b", f"half the track: {1e3 * ROBOT.half_track_m:.1f} mm"),
        ("l", f"hitch to the trailer's COM, G: {1e3 * ROBOT.trailer.com_distance_m:.0f} mm"),
        ("k", f"l + J2/(m2·l), hitch to F: {1e3 * ROBOT.swing_length_m:.0f} mm"),
        ("F", "centre of oscillation: what can be steered"),
    )
    parts = []
    for i, (name, words) in enumerate(rows):
        y = 322 + 24 * i
        parts += [text((545, y), name), text((607, y), words, "s")]
    parts.append(text((607, 322 + 24 * len(rows)), "driven wheels black, balls grey", "s"))
    return parts


if __name__ == "__main__":
    (Path(__file__).parent / "images" / "robot.svg").write_text(drawing(), encoding="utf-8")
