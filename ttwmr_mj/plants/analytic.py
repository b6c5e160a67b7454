"""The hybrid model (Eq. 24-29) as a plant: wheels obey their servo exactly, the trailer swings.

The tractor never slips and its wheel speeds follow `plants.servo`, so within a command they are
piecewise linear in time, with a kink where a wheel reaches its commanded speed. Between kinks the
heading is an exact quadratic, P an integral of known functions (three-point Gauss), and only the
hitch angle φ = θ2 − θ1 a differential equation (classical fourth-order Runge-Kutta):

    φ̈ = (−u̇1·sin φ + u1·u2·cos φ)/k − u̇2 + T/(J2 + m2·l²)          (Eq. 17, 24, 27-28)
"""

from __future__ import annotations

import math

import numpy as np

from ttwmr_mj.dynamics.kinematics import twist_from_wheels, wheels_from_twist, workspace_rate
from ttwmr_mj.dynamics.hitch import published_spring_acceleration, spring_damper_acceleration
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.servo import limit_speed
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, RobotState

# Every linear oscillator with |eigenvalue|·step below this is stable under classical RK4, however
# it is damped (the boundary comes closest to the origin, 2.616, at a damping ratio of 0.57).
RK4_STABLE_RADIUS = 2.6

GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(3)
# Over [0, 1], shaped to broadcast over (node, interval, simulation).
GAUSS_NODES = (0.5 + 0.5 * GAUSS_NODES)[:, None, None]
GAUSS_WEIGHTS = (0.5 * GAUSS_WEIGHTS)[:, None, None]
