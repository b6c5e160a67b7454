"""
A law of your own
=================

A law is a class with a method ``command``, which gets the control sample's number and the estimated state and returns
wheel speeds. This one drives towards the reference in proportion to the distance. It knows nothing of the trailer,
which is carried along outside of the circle, where its motion is stable.
"""

import matplotlib.pyplot as plt
import numpy as np

import ttwmr_mj as tt


class Chase(tt.Controller):
    """Move as the reference does, and towards it in proportion to the distance."""

    def __init__(self, gain_1_s: float) -> None:
        self.gain_1_s = gain_1_s

    def start(self, task: tt.Task) -> None:
        self.task = task

    def command(self, k: int, estimate: tt.Estimate) -> tt.Command:
        q = estimate.state.q  # (nsim, 4): x, y [m] of P, θ1, θ2 [rad]
        aim = self.task.reference.at(k)
        wish = aim.velocity_m_s + self.gain_1_s * (aim.position_m - q[:, :2])
        off = tt.wrap(np.arctan2(wish[:, 1], wish[:, 0]) - q[:, 2])
        speed = np.hypot(*wish.T) * np.cos(off)
        turn = aim.theta_rate[:, 0] + 4.0 * off
        wheels = tt.wheels_from_twist(np.stack([speed, turn], axis=-1), self.task.robot)
        limit = self.task.robot.servo.speed_limit_rad_s
        return self.plain(np.clip(wheels, -limit, limit))


# %%
# The scenario gives the robot, the start and the reference; ``controller=`` replaces its law.

SETTINGS = ["duration_s=10.0", "plant.kind=analytic", "reference.angular_rate_rad_s=0.5"]
scenario = tt.load_scenario("outer_circle", SETTINGS)

fig, ax = plt.subplots(figsize=(7, 3.5), layout="constrained")
for gain, colour in ((0.5, "#0072B2"), (1.0, "#D55E00"), (2.0, "#009E73")):
    result = tt.simulate(scenario, controller=Chase(gain))
    run = result.trajectory
    off = np.hypot(*(run.q - run.ref_q)[:, 0].T[:2])
    ax.semilogy(run.time_s, 1e3 * off, color=colour, label=f"gain {gain} 1/s")
    print(f"gain {gain}: {1e3 * off[-1]:.3f} mm after {run.time_s[-1]:.1f} s")
ax.set(xlabel="time [s]", ylabel="distance of P [mm]")
ax.legend(frameon=False)
plt.show()
