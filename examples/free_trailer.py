"""
Phase portrait of a trailer behind a circle
===========================================

Behind a tractor on a circle of radius R at the rate ω, a free trailer keeps ½·k·φ̇² + R·ω²·cos φ, where φ is its angle
off the direction to the centre (:doc:`/theory/limits`): a pendulum that stands on its head inside the circle, φ = 0,
and hangs outside, φ = 180°. Lines are that energy, the dots a simulation of the analytic model.
"""

import matplotlib.pyplot as plt
import numpy as np

import ttwmr_mj as tt

RADIUS_M, RATE_RAD_S = 0.5, 1.0
CIRCLE = (
    f'reference={{kind="flat_circle", circle_of="P", radius_m={RADIUS_M}, angular_rate_rad_s=1.0}}'
)
SETTINGS = ["duration_s=12.0", "plant.kind=analytic", 'controller={kind="feedforward"}', CIRCLE]
START = 'initial={{kind="on_reference", theta2_offset_rad={}}}'

fig, ax = plt.subplots(figsize=(7, 4), layout="constrained")
k = tt.RobotParameters().swing_length_m
phi, rate = np.meshgrid(np.linspace(-np.pi, np.pi, 201) + np.pi, np.linspace(-4, 4, 201))
energy = 0.5 * k * rate**2 + RADIUS_M * RATE_RAD_S**2 * np.cos(phi)
ax.contour(
    np.degrees(phi), rate, energy, levels=12, colors="#BBBBBB", linewidths=0.8, linestyles="solid"
)
for offset in (0.4, 1.2, 2.4):
    scenario = tt.load_scenario("outer_circle", [*SETTINGS, START.format(offset)])
    run = tt.simulate(scenario).trajectory
    turned = run.q[:, 0, 3] - run.ref_q[:, 0, 3] + np.pi
    turning = run.q_rate[:, 0, 3] - RATE_RAD_S
    ax.plot(np.degrees(turned), turning, ".", markersize=2.5, color="#C2478A")
    found = 0.5 * k * turning**2 + RADIUS_M * RATE_RAD_S**2 * np.cos(turned)
    print(f"from {np.degrees(offset):5.1f}° off: energy within {np.ptp(found) / abs(found[0]):.1e}")
ax.set(xlabel="φ [°]: 0 inside, 180 outside", ylabel="rate of φ [rad/s]", xticks=range(0, 361, 90))
plt.show()
