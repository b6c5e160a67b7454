"""What driving a plan uses of its limits, from the reference that its file makes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ttwmr_mj.references.planned import Planned
from ttwmr_mj.references.shared.feasibility import check_feasibility
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import hitch_angles

if TYPE_CHECKING:
    from ttwmr_mj.planning.through_points import Found
    from ttwmr_mj.planning.transcription import Limits

PERIOD_S = 0.002


def shares_driven(
    found: Found, robot: RobotParameters, limits: Limits, folder: Path
) -> dict[str, float]:
    """Group of limits → the largest share, at samples 2 ms apart.

    By the checker of references, which is another derivation.
    """
    from ttwmr_mj.planning.knots import write_knots

    write_knots(folder / "plan.csv", found.plan, robot, "a test")
    time_s = np.arange(0.0, found.plan.time_s[-1], PERIOD_S)
    path = Planned(plan=str(folder / "plan.csv")).sample(time_s, robot)
    checked = check_feasibility(path, robot, workspace_m=limits.workspace_m)
    speed = np.hypot(*path.velocity_m_s[:, 0].T)
    sideways = speed * path.theta_rate[:, 0, 0]
    return {
        "wheel speed": checked["wheel speed"].worst / limits.wheel_speed_rad_s,
        "wheel acceleration": checked["wheel acceleration"].worst
        / limits.wheel_acceleration_rad_s2,
        "lateral acceleration": np.abs(sideways).max() / limits.lateral_acceleration_m_s2,
        "trailer's turn rate": np.abs(path.theta_rate[..., 1:]).max() / limits.trailer_rate_rad_s,
        "hitch angle": np.abs(hitch_angles(path.q)).max() / limits.hitch_angle_rad,
        "workspace": checked["workspace"].worst,
    }
