"""Robots with several trailers."""

from ttwmr_mj.robot import Hitch, RobotParameters, Trailer

REACH_M = 0.23  # to the next hitch, behind the casters


def train(count: int, reach_m: float | None = REACH_M, **hitch: float) -> RobotParameters:
    """Table I's trailer repeated; None: each hitch at its trailer's centre of oscillation."""
    reach = Trailer().swing_length_m if reach_m is None else reach_m
    towing = Trailer(next_hitch_offset_m=reach)
    return RobotParameters(
        trailers=(*[towing] * (count - 1), Trailer()), hitches=(Hitch(**hitch),) * count
    )


def motley() -> RobotParameters:
    """Three trailers no two of which are alike, loads off their axes, hitches of their own."""
    return RobotParameters(
        trailers=(
            Trailer(com_lateral_m=0.012, next_hitch_offset_m=0.21),
            Trailer(mass_kg=0.5, yaw_inertia_kg_m2=0.002, com_offset_m=0.1, com_lateral_m=-0.02,
                    next_hitch_offset_m=0.16),
            Trailer(mass_kg=0.2, yaw_inertia_kg_m2=0.0009, com_offset_m=0.12, com_lateral_m=0.01),
        ),
        hitches=(
            Hitch(stiffness_n_m_rad=0.3, damping_n_m_s_rad=0.01),
            Hitch(stiffness_n_m_rad=0.1),
            Hitch(damping_n_m_s_rad=0.02),
        ),
    )  # fmt: skip
