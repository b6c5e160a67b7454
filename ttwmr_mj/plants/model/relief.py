"""Terrain and kerbs in the MjModel: built into it, and read back as heights."""

from pathlib import Path

import numpy as np

from ttwmr_mj.dynamics.floor.ground import Ground
from ttwmr_mj.dynamics.floor.terrain import PICTURE, Terrain, scaled
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.state import FloatArray

TERRAIN = "terrain"
BASE_M = 0.05  # thickness under the lowest point
HALF_PLATE_M = 0.02  # a kerb reaches into the floor, so that nothing gets under it
MATERIAL = "floor"


def add_relief(spec: mujoco.MjSpec, ground: Ground) -> None:
    """Put terrain and kerbs on the floor, which then lies under the lowest point.

    Raises:
        InputError: the terrain's picture cannot be read, or has no heights.
    """
    low = 0.0
    if ground.terrain is not None:
        heights = _heights(ground.terrain)
        low = float(heights.min())
        rise = max(float(heights.max()) - low, 1e-6)
        half = ground.terrain.half_size_m
        spec.add_hfield(
            name=TERRAIN,
            nrow=heights.shape[0],
            ncol=heights.shape[1],
            size=[half, half, rise, BASE_M],
            userdata=((heights - low) / rise).ravel().tolist(),
        )
        _add(spec, name=TERRAIN, type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=TERRAIN,
             pos=[0.0, 0.0, low])  # fmt: skip
        spec.geom("floor").pos[2] += low
    for i, kerb in enumerate(ground.kerbs):
        half_angle = 0.5 * kerb.angle_rad
        _add(
            spec,
            name=f"kerb_{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.5 * kerb.length_m, 0.5 * kerb.width_m, HALF_PLATE_M],
            pos=[kerb.x_m, kerb.y_m, kerb.height_m - HALF_PLATE_M],
            quat=[np.cos(half_angle), 0.0, 0.0, np.sin(half_angle)],
        )


def _add(spec: mujoco.MjSpec, **what: object) -> None:
    spec.worldbody.add_geom(material=MATERIAL, contype=0, conaffinity=1, **what)


def _heights(terrain: Terrain) -> FloatArray:
    """(rows, columns), from south to north and from west to east."""
    if terrain.png_path is None:
        return terrain.heights_m()
    import cv2  # only who has a picture needs it

    from ttwmr_mj.pixels import read_pixels

    flags = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH
    picture = read_pixels(Path(terrain.png_path), flags)
    if picture is None or min(picture.shape) < 2:
        raise _refused(terrain, "cannot be read as a picture of 2×2 pixels to 30 megapixels")
    if picture.min() == picture.max():
        raise _refused(terrain, "is of one grey level, which would be level ground")
    return scaled(np.flipud(picture).astype(np.float64), terrain.rms_height_m)


def _refused(terrain: Terrain, problem: str) -> InputError:
    got = repr(terrain.png_path)
    return InputError.at("ground.terrain.png_path", problem, got=got, hint=PICTURE)


def take_off(model: mujoco.MjModel) -> None:
    """Leave only the floor, where it was: nothing touches terrain and kerbs any more."""
    for i in range(model.ngeom):
        name = model.geom(i).name
        if name == TERRAIN or name.startswith("kerb_"):
            model.geom_conaffinity[i] = 0
        if name == TERRAIN:
            model.geom("floor").pos[2] -= model.geom_pos[i, 2]


class Relief:
    """Heights of a model's ground.

    Attributes:
        flat: whether there is only the floor, and what a scene of one's own has on it.
        plain: whether there is only the floor.
        lowest_m: no place is lower; where the floor is, beyond the terrain.
        highest_m: no place is higher.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        geoms = {model.geom(i).name: i for i in range(model.ngeom)}
        self._kerbs = [geoms[name] for name in geoms if name.startswith("kerb_")]
        self._model, self._terrain = model, geoms.get(TERRAIN)
        others = sorted({*range(model.ngeom)} - {*self._kerbs})
        self._boxes = [geom for geom in others if _is_plate(model, geom)]
        self.flat = self._terrain is None and not self._kerbs
        self.plain = self.flat and not self._boxes
        self.lowest_m = self.highest_m = 0.0
        if self._terrain is not None:
            shape = int(model.hfield_nrow[0]), int(model.hfield_ncol[0])
            self._half, _, rise, _ = model.hfield_size[0].tolist()
            low = model.geom_pos[self._terrain][2]
            self.heights_m = low + rise * model.hfield_data.reshape(shape)
            self.lowest_m, self.highest_m = float(self.heights_m.min()), float(self.heights_m.max())
        tops = (model.geom_pos[kerb][2] + model.geom_size[kerb][2] for kerb in self._kerbs)
        self.highest_m = max([self.highest_m, *map(float, tops)])

    def at(self, points_m: FloatArray) -> FloatArray:
        """(...) height under points (..., 2); beyond the terrain that of the floor."""
        height = np.zeros(points_m.shape[:-1])
        if self._terrain is not None:
            height = self._on_terrain(points_m)
        return self._over(self._kerbs, points_m, height)

    def under(self, points_m: FloatArray) -> FloatArray:
        """(...) the same, on plates and steps of a scene of one's own, too."""
        return self._over(self._boxes, points_m, self.at(points_m))

    def _over(self, boxes: list[int], points_m: FloatArray, height: FloatArray) -> FloatArray:
        """(...) height, or of the boxes' tops that are higher."""
        for geom in boxes:
            axes = _plane_axes(self._model.geom_quat[geom])
            local = np.abs((points_m - self._model.geom_pos[geom, :2]) @ axes)
            on = (local <= self._model.geom_size[geom, :2]).all(axis=-1)
            top = self._model.geom_pos[geom, 2] + self._model.geom_size[geom, 2]
            height = np.where(on, np.maximum(height, top), height)
        return np.asarray(height)

    def _on_terrain(self, points_m: FloatArray) -> FloatArray:
        """Bilinear between the grid's points, and the floor around them."""
        rows, columns = self.heights_m.shape
        most = np.array([columns, rows]) - 1.0
        place = (points_m + self._half) / (2.0 * self._half) * most
        beyond = ((place < 0.0) | (place > most)).any(axis=-1)
        place = np.clip(place, 0.0, most)
        cell = np.minimum(np.floor(place).astype(np.int64), (most - 1).astype(np.int64))
        (x, y), (column, row) = np.moveaxis(place - cell, -1, 0), np.moveaxis(cell, -1, 0)
        low = (1.0 - x) * self.heights_m[row, column] + x * self.heights_m[row, column + 1]
        high = (1.0 - x) * self.heights_m[row + 1, column]
        high = high + x * self.heights_m[row + 1, column + 1]
        return np.where(beyond, self.lowest_m, (1.0 - y) * low + y * high)


def _is_plate(model: mujoco.MjModel, geom: int) -> bool:
    """Whether it is an upright box on the floor, fixed, that a wheel can stand on."""
    upright = np.allclose(model.geom_quat[geom, 1:3], 0.0)
    bottom_m = model.geom_pos[geom, 2] - model.geom_size[geom, 2]
    of_world = model.geom_bodyid[geom] == 0 and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX
    touched = bool(model.geom_contype[geom] | model.geom_conaffinity[geom])
    return bool(of_world and touched and upright and bottom_m <= 0.0)


def _plane_axes(quaternion: FloatArray) -> FloatArray:
    """(2, 2) columns: x and y axes of a body turned about the vertical."""
    angle = 2.0 * np.arctan2(quaternion[3], quaternion[0])
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
