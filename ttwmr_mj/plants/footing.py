"""How a robot stands on the ground."""

from typing import NamedTuple

from ttwmr_mj.state import FloatArray


class Footing(NamedTuple):
    """Of each simulation (nsim,)."""

    tilt_rad: FloatArray  # of the tractor's deck against the floor's plane
    height_m: FloatArray  # of P over where it stands at rest, above the ground under it
    wheels_on_floor: FloatArray  # how many of the tractor's two are within 0.1 mm of the ground
    wheel_slip_m_s: FloatArray  # the faster of the wheels' surfaces over the ground
