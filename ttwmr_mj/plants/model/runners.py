"""What holds back a caster's ball, in contact physics: a runner beside it, dragged over the floor.

MuJoCo's own rolling friction lifts the ball: a soft contact that slips or rolls is also pushed
apart, by 2·τ·(δ/ρ)·v, which is 4 µm at 0.15 m/s where the robot's weight presses tyres and balls by
0.05 µm. Most of the weight then leaves the wheels for the balls, and so does their grip. The dry
friction of a ball joint acts on three axes that turn with the ball, up to √3 times as strong in
some directions as in others. A runner has neither fault: it slides without weight of its own,
pressed on the floor by a spring too soft to feel a lift, and drags with its spring's force
whichever way it goes, and holds where it stands.
"""

from ttwmr_mj.plants.model.engine import mujoco

MASS_KG = 1e-6  # a millionth of the robot's
SPRING_N_M = 1e-3  # soft: a lift of 1 mm costs 1e-6 N
RADIUS_M = 0.001


def add_runner(
    spec: mujoco.MjSpec, caster: str, force_n: float, contact_time_constant_s: float
) -> None:
    """Drag a runner at the point where a caster's ball touches the floor.

    Args:
        spec: the robot.
        caster: the ball's body.
        force_n: with which it is held back.
        contact_time_constant_s: as of the other contacts.
    """
    ball = spec.body(caster)
    lowest = ball.pos[2] - spec.geom(caster).size[0]
    body = ball.parent.add_body(
        name=f"runner_{caster}",
        pos=[ball.pos[0], ball.pos[1], lowest + RADIUS_M],
        mass=MASS_KG,
        inertia=[MASS_KG * RADIUS_M**2] * 3,
        explicitinertial=True,
    )
    body.add_joint(
        name=f"runner_{caster}",
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=[0.0, 0.0, 1.0],
        stiffness=[SPRING_N_M, 0.0, 0.0],
        springref=-force_n / SPRING_N_M,
    )
    body.add_geom(
        spec.find_default("collision"),
        name=f"runner_{caster}",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[RADIUS_M, 0.0, 0.0],
        condim=3,
        friction=[1.0, 0.0, 0.0],  # drags as hard as it is pressed
        solref=[contact_time_constant_s, 1.0],
    )
