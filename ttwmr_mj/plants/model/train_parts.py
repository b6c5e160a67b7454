"""Further trailers of the MjModel: copies of the one in models/ttwmr.xml, hinged one to the next.

Bodies that are hinged together may overlap, as they do at a hitch; all others collide. A tongue
leads to the next hitch and holds its pin.
"""

from ttwmr_mj.plants.model.engine import mujoco
from ttwmr_mj.plants.model.names import namespace, trailer_part
from ttwmr_mj.robot import RobotParameters

COLLIDES = 2  # a bit of its own: chassis touch each other, never the floor
# Half-sizes and middles of the chassis' outlines as boxes, in the frames of their hitches [m].
TRACTOR_BOX = ([0.083, 0.062, 0.02], [0.047, 0.0, 0.01])
TRAILER_BOX = ([0.059, 0.06, 0.02], [-0.143, 0.0, 0.015])
TONGUE_HEIGHT_M, PIN_HEIGHT_M = 0.004, 0.018
BED_END_M = 0.19  # where a tongue begins, under the rear of the bed


def add_trailers(
    spec: mujoco.MjSpec, path: str, robot: RobotParameters, contact_time_constant_s: float
) -> None:
    """Hang all trailers but the first on what is there.

    Args:
        spec: the laboratory with one trailer.
        path: the file it was read from: the source of more.
        robot: how many, and where their hitches are.
        contact_time_constant_s: as of the other contacts.
    """
    count = len(robot.trailers)
    if count == 1:
        return
    for i, trailer in enumerate(robot.trailers[:-1], start=1):
        reach = trailer.next_hitch_offset_m or 0.0
        source = mujoco.MjSpec.from_file(path)
        for key in source.keys:
            source.delete(key)
        towing = spec.body(trailer_part("trailer", i - 1))
        _add_tongue(spec, towing, reach)
        towing.add_frame(pos=[-reach, 0.0, 0.0]).attach_body(
            source.body("trailer"), namespace(i), ""
        )
        spec.sensor(f"{namespace(i)}theta2_direction").name = f"theta{i + 2}_direction"
    names = ["tractor", *(trailer_part("trailer", i) for i in range(count))]
    for name, (size, pos) in zip(names, [TRACTOR_BOX, *[TRAILER_BOX] * count], strict=True):
        spec.body(name).add_geom(
            spec.find_default("collision"),
            name=f"{name}_hull",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=size,
            pos=pos,
            contype=COLLIDES,
            conaffinity=COLLIDES,
            condim=1,
            solref=[contact_time_constant_s, 1.0],
        )


def _add_tongue(spec: mujoco.MjSpec, towing: mujoco.MjsBody, reach_m: float) -> None:
    visual = spec.find_default("visual")
    if (length := reach_m - BED_END_M) > 0.0:
        towing.add_geom(
            visual,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[0.5 * length, 0.008, 0.003],
            pos=[-BED_END_M - 0.5 * length, 0.0, TONGUE_HEIGHT_M],
        )
    towing.add_geom(
        visual,
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[0.004, 0.016, 0.0],
        pos=[-reach_m, 0.0, PIN_HEIGHT_M],
        material="alloy",
    )
