"""Where the robot should be: its paths as bands on the floor, its place on them, the way there."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.outline import chassis, outline
from ttwmr_mj.plants.model.relief import Relief
from ttwmr_mj.recording import style
from ttwmr_mj.recording.scene.floor import BAND_HEIGHT_M, BORDER_HEIGHT_M, PLACE_HEIGHT_M, lift
from ttwmr_mj.recording.scene.poses import BodyPoses
from ttwmr_mj.recording.series import time_column
from ttwmr_mj.recording.style import Colour
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.results.curves import Curves, trailer_com
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray

# Lengths are of Table I's robot.
TRACTOR_BAND_M, TRAILER_BAND_M = 0.014, 0.008  # widths
BAND_STEP_M = 0.004  # between a band's corners
PLACE_MARGIN_M = 0.014  # the place is larger than the robot by this: a robot on it has a halo
PLACE_WIDTH_M = 0.005  # of the line around it
PIN_HEIGHT_M = 0.11  # above the robot
TEXT_HEIGHT_M = 0.2
TEXT_EVERY = 3  # rows per text: one that changes 30 times a second cannot be read


class Target:
    """The reference in one recording.

    Args:
        stream: of the recording.
        model: the robot, whose outlines are the places.
        robot: the numbers of that robot.
        reference: the whole reference.
        root: the entity everything is put under.
        relief: the ground it lies on; None: a plane.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        model: mujoco.MjModel,
        robot: RobotParameters,
        reference: ReferencePath,
        root: str,
        relief: Relief | None = None,
    ) -> None:
        self._stream, self._relief = stream, relief
        self._root = root
        self._scale = scale = robot.looks_scale
        self._poses = BodyPoses(model)
        self._chassis = chassis(model)
        self._rows = 0  # of the run so far
        q = reference.q[:, 0]
        trailer = reference_pieces(trailer_com(q, robot), reference.theta2_rad[:, 0])
        self._draw_band("tractor", [q[:, :2]], scale * TRACTOR_BAND_M)
        self._draw_band("trailer", trailer, scale * TRAILER_BAND_M)
        for name, body in self._chassis.items():
            self._draw_place(name, outline(model, body, scale * PLACE_MARGIN_M))
        top = [0.0, 0.0, scale * PIN_HEIGHT_M]  # a pin, seen over the robot
        pole = rr.LineStrips3D(
            [[[0.0, 0.0, 0.0], top]], colors=[style.REFERENCE], radii=[scale * 0.0012]
        )
        ball = rr.Ellipsoids3D(
            centers=[top], radii=[scale * 0.007], colors=[style.REFERENCE], fill_mode="solid"
        )
        self._draw("marker/pole", pole)
        self._draw("marker/ball", ball)
        arrow = rr.Arrows3D.from_fields(colors=[style.ALERT], radii=[scale * 0.0025])
        text = rr.Points3D.from_fields(
            colors=[style.INK], radii=rr.Radius.ui_points([0.0]), show_labels=True
        )
        for path, shape in zip(miss_paths(root), (arrow, text), strict=True):
            stream.log(path, shape, static=True)

    def _draw(self, name: str, shape: rr.AsComponents) -> None:
        self._stream.log(f"{self._root}/reference/{name}", shape, static=True)

    def _draw_band(self, name: str, pieces: list[FloatArray], width_m: float) -> None:
        bands = [band for piece in pieces if (band := spaced(piece, BAND_STEP_M)).shape[0] > 1]
        if bands:
            self._draw(
                name, ribbon(bands, width_m, BAND_HEIGHT_M, style.REFERENCE_BAND, self._relief)
            )

    def _draw_place(self, name: str, corners_m: FloatArray) -> None:
        line = np.vstack([corners_m, corners_m[:2]])  # two more, so that the last corner is whole
        border = ribbon([line], self._scale * PLACE_WIDTH_M, BORDER_HEIGHT_M, style.REFERENCE)
        self._draw(f"place_{name}/border", border)
        self._draw(f"place_{name}/area", area(corners_m, PLACE_HEIGHT_M, style.REFERENCE_PLACE))

    def append(self, rows: Trajectory, curves: Curves) -> None:
        """Move pin, places and arrows to the reference at the next rows that have one."""
        ref_q = rows.ref_q[:, 0]
        known: BoolArray = np.asarray(np.isfinite(ref_q[:, :2]).all(axis=1))
        told = known & ((np.arange(len(rows)) + self._rows) % TEXT_EVERY == 0)
        self._rows += len(rows)
        if known.any():
            columns = rr.Transform3D.columns(translation=lift(ref_q[known, :2], 0.0, self._relief))
            self._send(f"{self._root}/reference/marker", rows.time_s[known], columns)
            self._move_places(rows.time_s, ref_q)
            self._point(rows, curves, known)
        if told.any():
            self._tell(rows, curves, told)

    def _move_places(self, time_s: FloatArray, ref_q: FloatArray) -> None:
        """The chassis' places, those of trailers only where the reference says where they are."""
        aligned = np.where(np.isfinite(ref_q), ref_q, ref_q[:, [2]])
        known = np.isfinite(aligned).all(axis=1)
        if not known.any():
            return
        position, quaternion = self._poses.standing_at(aligned[known])
        for i, (name, body) in enumerate(self._chassis.items()):
            said = np.isfinite(ref_q[known, 2 : 3 + i]).all(axis=1)
            if said.any():
                columns = rr.Transform3D.columns(
                    translation=lift(position[said, body, :2], 0.0, self._relief),
                    quaternion=np.roll(quaternion[said, body], -1, axis=-1),
                )
                path = f"{self._root}/reference/place_{name}"
                self._send(path, time_s[known][said], columns)

    def _point(self, rows: Trajectory, curves: Curves, known: BoolArray) -> None:
        """Arrows from where P and the trailer's COM should be to where they are."""
        wanted = np.stack([rows.ref_q[:, 0, :2], curves.ref_trailer_com_m[:, 0]], axis=1)[known]
        now = np.stack([rows.q[:, 0, :2], curves.trailer_com_m[:, 0]], axis=1)[known]
        said = np.isfinite(wanted).all(axis=-1)
        columns = rr.Arrows3D.columns(
            origins=lift(wanted[said], self._scale * PIN_HEIGHT_M, self._relief),
            vectors=lift((now - wanted)[said], 0.0),
        ).partition(said.sum(axis=1))
        self._send(miss_paths(self._root)[0], rows.time_s[known], columns)

    def _tell(self, rows: Trajectory, curves: Curves, told: BoolArray) -> None:
        """How far off they are, over the robot."""
        errors = np.stack([curves.tractor_error_m[told, 0], curves.trailer_error_m[told, 0]], 1)
        columns = rr.Points3D.columns(
            positions=lift(rows.q[told, 0, :2], self._scale * TEXT_HEIGHT_M, self._relief),
            labels=[miss_text(*e) for e in errors],
        )
        self._send(miss_paths(self._root)[1], rows.time_s[told], columns)

    def _send(self, path: str, time_s: FloatArray, columns: rr.ComponentColumnList) -> None:
        self._stream.send_columns(path, [time_column(time_s)], columns)


def miss_paths(root: str = "world") -> tuple[str, str]:
    """The entities of the arrows from where the robot should be, and of their text."""
    return f"{root}/miss/arrows", f"{root}/miss/text"


def miss_text(tractor_m: float, trailer_m: float) -> str:
    """How far tractor and trailer are off, the trailer only where its reference is defined."""
    tractor = f"tractor {distance(tractor_m)} off"
    return f"{tractor}, trailer {distance(trailer_m)}" if np.isfinite(trailer_m) else tractor


def distance(length_m: float) -> str:
    """As a person reads it while it changes: 45 µm, 1.2 mm, 34 mm, 1.56 m."""
    if length_m < 1e-4:
        return f"{1e6 * length_m:.0f} µm"
    if length_m < 0.01:
        return f"{1e3 * length_m:.1f} mm"
    return f"{1e3 * length_m:.0f} mm" if length_m < 1.0 else f"{length_m:.2f} m"


def reference_pieces(points_m: FloatArray, theta2_rad: FloatArray) -> list[FloatArray]:
    """The points (n, 2) cut where θ2 is undefined or jumps, in pieces of two and more."""
    with np.errstate(invalid="ignore"):
        broken = ~(np.abs(np.diff(theta2_rad)) < 0.5 * np.pi)
    pieces = np.split(points_m, np.flatnonzero(broken) + 1)
    return [piece for piece in pieces if len(piece) > 1 and np.isfinite(piece).all()]


def spaced(points_m: FloatArray, step_m: float) -> FloatArray:
    """Some of the points (n, 2) along a path, no closer than a step along it, and the last."""
    steps = np.hypot(*np.diff(points_m, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    first = np.unique(np.floor(along / step_m), return_index=True)[1]
    if along[-1] > along[first[-1]]:
        first = np.append(first, len(points_m) - 1)
    return points_m[first]


def ribbon(
    lines_m: list[FloatArray],
    width_m: float,
    height_m: float,
    colour: Colour,
    relief: Relief | None = None,
) -> rr.Mesh3D:
    """Lines (n, 2), no two successive points equal, as flat bands over the floor."""
    corners, triangles, count = [], [], 0
    for line in lines_m:
        ahead = np.gradient(line, axis=0)
        ahead /= np.maximum(np.hypot(*ahead.T), 1e-12)[:, None]  # at a cusp there is no direction
        aside = 0.5 * width_m * np.column_stack([-ahead[:, 1], ahead[:, 0]])
        corners += [line + aside, line - aside]
        left = count + np.arange(len(line) - 1)
        right = left + len(line)
        triangles += [
            np.column_stack([left, right, left + 1]),
            np.column_stack([right, right + 1, left + 1]),
        ]
        count += 2 * len(line)
    return _flat(np.vstack(corners), np.vstack(triangles), height_m, colour, relief)


def area(corners_m: FloatArray, height_m: float, colour: Colour) -> rr.Mesh3D:
    """What a convex line (n, 2) surrounds, over the floor."""
    after = np.arange(1, len(corners_m) - 1)
    fan = np.column_stack([np.zeros_like(after), after, after + 1])
    return _flat(corners_m, fan, height_m, colour)


def _flat(
    points_m: FloatArray,
    triangles: NDArray[np.int64],
    height_m: float,
    colour: Colour,
    relief: Relief | None = None,
) -> rr.Mesh3D:
    return rr.Mesh3D(
        vertex_positions=lift(points_m, height_m, relief),
        triangle_indices=triangles,
        vertex_normals=np.tile([0.0, 0.0, 1.0], (len(points_m), 1)),
        albedo_factor=colour,
    )
