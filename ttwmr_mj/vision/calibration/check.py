"""What no camera over the floor is, whoever says so: a file, or views of a board."""

from dataclasses import replace

import numpy as np

from ttwmr_mj.errors import Fault
from ttwmr_mj.vision.camera.lens import fold_fault, lens_fault
from ttwmr_mj.vision.camera.model import CameraModel

MOST_FOCAL_PX = 1e6
LEAST_FOCAL = 0.01  # of the picture's size, which is then seen within 178°; less is in metres
ORTHONORMAL_TOLERANCE = 1e-6  # a file with seven digits passes
MOST_ASPECT = 3.0  # of fx and fy: pixels of old video formats are twice as wide as high
MOST_BESIDE = 1.0  # of the picture's size, how far beyond its edge the principal point may be
LEAST_SHOWN = 1.0 / 3.0  # of how far a picture reaches without distortion; real lenses 0.7 or more
MATRIX, ROTATION = ("camera_matrix",), ("rotation_world_to_camera",)


def camera_fault(camera: CameraModel) -> Fault | None:
    """Why this can be no camera that looks at the floor, with the key of a file; None: it can."""
    return _matrix_fault(camera) or _place_fault(camera) or _lens_fault(camera)


def _matrix_fault(camera: CameraModel) -> Fault | None:
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_px
    if min(fx, fy) <= 0:
        return Fault(key=MATRIX, problem="has a focal length that is not positive")
    if max(fx, fy) > MOST_FOCAL_PX:
        return Fault(key=MATRIX, problem="has a focal length beyond all lenses")
    if max(fx, fy) > MOST_ASPECT * min(fx, fy):
        problem = f"has focal lengths of {fx:g} and {fy:g} px"
        return Fault(key=MATRIX, problem=problem, allowed=f"a ratio of {MOST_ASPECT:g} at most")
    size = np.array([camera.width_px, camera.height_px])
    if (camera.focal_px < LEAST_FOCAL * size).any():
        problem = f"has focal lengths of {fx:g} and {fy:g} px"
        least = ", ".join(f"{LEAST_FOCAL * pixels:g}" for pixels in size)
        hint = "they are in pixels, not in metres"
        return Fault(key=MATRIX, problem=problem, allowed=f"at least {least} px", hint=hint)
    beside = np.maximum(-camera.principal_px, camera.principal_px - size)
    if (beside > MOST_BESIDE * size).any():
        problem = f"has its principal point at {cx:g}, {cy:g} px"
        allowed = f"in the picture of {size[0]} × {size[1]} px, or near it"
        return Fault(key=MATRIX, problem=problem, allowed=allowed)
    return None


def _place_fault(camera: CameraModel) -> Fault | None:
    rotation = camera.rotation
    orthonormal = np.allclose(rotation @ rotation.T, np.eye(3), atol=ORTHONORMAL_TOLERANCE)
    if not orthonormal or np.linalg.det(rotation) < 0.0:
        return Fault(key=ROTATION, problem="is not a rotation matrix")
    if not camera.looks_down:
        problem = "turns the camera so that it does not look down at the floor"
        allowed = "a last number below zero: the optical axis, z of the camera, goes down"
        return Fault(key=ROTATION, problem=problem, allowed=allowed)
    if camera.position_m[2] <= 0.0:
        return Fault(key=("camera_position_m",), problem="is not above the floor")
    return None


def _lens_fault(camera: CameraModel) -> Fault | None:
    fault = fold_fault(camera) or _squeezed_fault(camera)
    return fault and fault.within("distortion_coefficients")


def _squeezed_fault(camera: CameraModel) -> Fault | None:
    """Why a lens shows too little; what shows more than without distortion is a wide one."""
    size = np.array([camera.width_px, camera.height_px])
    corners = np.array([[0, 0], [0, 1], [1, 0], [1, 1]]) * (size - 1.0)
    without = replace(camera, distortion=np.zeros(5))
    reach, plain = (
        np.linalg.norm(view.to_tangents(corners), axis=-1).max() for view in (camera, without)
    )
    if reach >= LEAST_SHOWN * plain:
        return None
    problem = (
        f"with this distortion the picture reaches {reach / plain:.2g} times as far as without; "
        f"lenses reach at least {LEAST_SHOWN:.2g} times"
    )
    return lens_fault(camera, problem)
