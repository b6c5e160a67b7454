"""The ChArUco board: its geometry, how it is found in an image, and frames that show it."""

from contextlib import suppress
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ttwmr_mj.assets import models_folder
from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.state import FloatArray
from ttwmr_mj.vision.camera.frame import Image
from ttwmr_mj.vision.camera.lens import CAMERA, LensMap
from ttwmr_mj.vision.camera.model import CameraModel, hang_camera
from ttwmr_mj.vision.camera.noise import SensorNoise
from ttwmr_mj.vision.camera.options import CameraOptions
from ttwmr_mj.vision.camera.rendering.renderer import ROBOT_GROUP, RegionRenderer

SQUARES = (7, 5)  # along and across
SQUARE_M = 0.08
MARKER_M = 0.06
THICKNESS_M = 0.003
TEXTURE_PX = 160  # of one square, six times what a camera at 1.9 m sees of it
INCH_M = 0.0254
SHEET_DPI = 127  # 400 px to a square: a whole number, as formats have it
MARGIN_M = 0.01  # so that the sheet is as wide as A2 is, and not as long
PAPER_WHITE = 0.7  # under the lamps this does not saturate
HIDDEN_GROUP = 5  # of geoms that nothing draws
REFINEMENT_REACH_PX = 2  # twice a rough corner's error, with room
# 0.01 px in 20 steps at most, usually after five
UNTIL_REFINED = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 1e-5)
REACH_M = 0.5 * (SQUARE_M - MARKER_M)  # from a corner to the nearest marker
MIN_REACH_PX = 3.0  # fewer pixels leave a saddle to noise
MIN_CORNERS = 6  # fewer say little about a pose
MIN_BESIDE_ROW = 2  # corners outside the fullest row: with fewer many poses look the same
SIZE_M: FloatArray = SQUARE_M * np.array(SQUARES)


class BoardView(NamedTuple):
    """The corners of the board seen in one image."""

    points_m: FloatArray  # (n, 2) x right and y up on the board from its middle, seen from above
    pixels: FloatArray  # (n, 2) column, row
    picture: str = ""  # the file, where there is one


def find_board(image: Image) -> BoardView | None:
    """The board's inner corners in an image, or None where those seen determine no pose."""
    grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    board = _board()
    corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(grey)
    if ids is None or not _determine_pose(np.asarray(ids, dtype=np.int64).ravel()):
        return None
    rough = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
    on_board = np.asarray(board.getChessboardCorners(), dtype=np.float64)[ids.ravel(), :2]
    on_board = (on_board - 0.5 * SIZE_M) * [1.0, -1.0]  # OpenCV counts a board's y from above
    scale = rough.std(axis=0).sum() / on_board.std(axis=0).sum()  # mean, pixels per metre
    return BoardView(on_board, _refined(grey, rough, max(MIN_REACH_PX, REACH_M * scale)))


class BoardCamera:
    """Frames of the board through the same lens and sensor as the robot's.

    Attributes:
        true: the camera's geometry.
    """

    def __init__(self, options: CameraOptions, rng: np.random.Generator, key: str = CAMERA) -> None:
        """Build the laboratory with a board in it and no robot; `key` as of `LensMap`.

        Raises:
            InputError: the lens folds the picture.
            MachineError: no OpenGL.
        """
        model = _board_model()
        self.true: CameraModel = hang_camera(model, options)
        lens = options.supersampling, options.lens.defocus_px
        self._lens = LensMap(self.true, *lens, key)
        self._renderer = RegionRenderer(model, options.name, self._lens.focal_px)
        self._noise = SensorNoise(options.noise, options.width_px, options.height_px, rng)
        self._floor = self._renderer.static(self._lens.whole)
        self._qpos = model.qpos0.copy()

    def take(self, position_m: FloatArray, rotation: FloatArray, time_s: float) -> Image:
        """A frame of the board held still.

        Args:
            position_m: (3,) of the middle of its printed face.
            rotation: (3, 3) from board axes (x along, y up the print, z out of it) to the world.
            time_s: when; gains drift with it.
        """
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
        centre = position_m - 0.5 * THICKNESS_M * rotation[:, 2]
        self._qpos[-7:] = np.concatenate([centre, quaternion])
        whole = self._lens.whole
        picture = self._renderer.robot_on(self._floor, self._qpos, whole)
        light = self._lens.expose(picture, whole, self._lens.sensor)
        return self._noise.read(light, time_s)[:]

    def close(self) -> None:
        """Give back what OpenGL holds."""
        self._renderer.close()


def _determine_pose(ids: NDArray[np.int64]) -> bool:
    """Whether corners of these numbers (n,), counted row by row, tell how the board is held."""
    fullest = np.bincount(ids // (SQUARES[0] - 1)).max()
    return len(ids) >= MIN_CORNERS and len(ids) - fullest >= MIN_BESIDE_ROW


def _refined(grey: Image, corners_px: FloatArray, reach_px: float) -> FloatArray:
    """Saddle points (n, 2) near rough corners (n, 2).

    Around a corner of a chessboard the picture is its own half turn, as far as the markers. A
    patch turned about the rough corner fits the picture best where it is moved by twice the rough
    corner's error. Depending on where in its pixel a corner of a lying board is, this errs by up
    to 0.01 px, and `cv2.cornerSubPix` by up to 0.08 px.
    """
    sharp, margin = np.asarray(grey, dtype=np.float32), REFINEMENT_REACH_PX
    side = 2 * (int(reach_px) + margin) + 1
    refined = corners_px.copy()
    for corner in refined:
        patch = cv2.getRectSubPix(sharp, (side, side), corner.tolist())
        turned = cv2.rotate(patch, cv2.ROTATE_180)[margin:-margin, margin:-margin]
        move = np.array([[1, 0, margin], [0, 1, margin]], dtype=np.float32)
        with suppress(cv2.error):  # nothing fits: it stays rough
            cv2.findTransformECC(turned, patch, move, cv2.MOTION_TRANSLATION, UNTIL_REFINED)
            corner += 0.5 * (move[:, 2] - margin)
    return refined


def _board() -> cv2.aruco.CharucoBoard:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return cv2.aruco.CharucoBoard(SQUARES, SQUARE_M, MARKER_M, dictionary)


def board_print(square_px: int = TEXTURE_PX) -> NDArray[np.uint8]:
    """The board as it is printed, (rows, columns) grey, without margin."""
    size = (SQUARES[0] * square_px, SQUARES[1] * square_px)
    return np.asarray(_board().generateImage(size, marginSize=0))


def board_sheet() -> NDArray[np.uint8]:
    """The board to print at `SHEET_DPI`, (rows, columns) grey; its margin says how large it is."""
    ink = board_print(round(SQUARE_M / INCH_M * SHEET_DPI))
    margin = round(MARGIN_M / INCH_M * SHEET_DPI)
    sheet = np.pad(ink, margin, constant_values=255)
    text = f"Print at 100 %: a square is {1e3 * SQUARE_M:.0f} mm wide. Measure one."
    below = (margin, len(sheet) - margin // 4)
    cv2.putText(sheet, text, below, cv2.FONT_HERSHEY_SIMPLEX, 0.9, 0, 2, cv2.LINE_AA)
    return sheet


def _board_model() -> mujoco.MjModel:
    """The shipped laboratory, its robot hidden, with the board on a free joint (last in qpos)."""
    spec = mujoco.MjSpec.from_file(str(models_folder() / "scene.xml"))
    for geom in spec.geoms:
        if geom.parent.name != "world":
            geom.group = HIDDEN_GROUP
    for key in list(spec.keys):
        spec.delete(key)
    # black that is black would be taken for background
    ink = np.maximum(board_print(), 8)
    texture = spec.add_texture(
        name="print",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        width=ink.shape[1],
        height=ink.shape[0],
        nchannel=3,
    )
    texture.data = np.repeat(ink[..., None], 3, axis=2).tobytes()
    material = spec.add_material(name="print", rgba=[PAPER_WHITE] * 3 + [1.0], specular=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "print"
    body = spec.worldbody.add_body(name="charuco")
    body.add_freejoint()
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[*(0.5 * SIZE_M), 0.5 * THICKNESS_M],
        material="print",
        group=ROBOT_GROUP,
        mass=0.1,
    )
    return spec.compile()
