"""Runs as they are judged: in the camera's frame, where it was moved after calibration."""

from ttwmr_mj.results.frame import PlaneFrame
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.scenario.schema import Scenario


def camera_frame(scenario: Scenario) -> PlaneFrame | None:
    """How the camera sees the world; None if as it is, or without a camera."""
    sensing = scenario.sensing
    if sensing.kind != "camera" or scenario.believed_camera == sensing.camera:
        return None
    # MuJoCo takes time to import: only where a camera was moved
    from ttwmr_mj.plants.model.mjcf import build_model
    from ttwmr_mj.vision import moved

    model = build_model(scenario.robot, scenario.plant.contact)
    return moved.camera_frame(model, sensing.camera, scenario.believed_camera)


def judged(rows: Trajectory, scenario: Scenario) -> Trajectory:
    """The run with its truth in the camera's frame, the only one that the loop can know."""
    frame = camera_frame(scenario)
    return rows if frame is None else frame.applied(rows)


def frame_metrics(scenario: Scenario) -> dict[str, float | None]:
    """Offset and turn of the camera's frame against the world; None without a camera."""
    if scenario.sensing.kind != "camera":
        return {"camera_frame_offset_m": None, "camera_frame_turn_rad": None}
    frame = camera_frame(scenario)
    offset, turn = (0.0, 0.0) if frame is None else (frame.distance_m, frame.turn_rad)
    return {"camera_frame_offset_m": offset, "camera_frame_turn_rad": turn}
