"""
A robot of your own, and one that is not as believed
====================================================

Every number of the robot is a key of the scenario. ``[belief]`` holds what the law is told, where that differs from
the robot that is driven. Here the trailer's load lies 20 % further back than the law believes, and the law that
steers it pays for that.
"""

import matplotlib.pyplot as plt
import numpy as np

import ttwmr_mj as tt

COMMON = ["duration_s=10.0", "plant.kind=analytic", 'controller={kind="tvlqr"}']
TOLD = {"the truth": 1.2, "Table I's trailer": 1.0}  # share of Table I's distance

fig, ax = plt.subplots(figsize=(7, 3.5), layout="constrained")
nominal = tt.RobotParameters().trailer.com_offset_m
for (told, share), colour in zip(TOLD.items(), ("#009E73", "#D55E00"), strict=True):
    scenario = tt.load_scenario(
        "outer_circle",
        [
            *COMMON,
            f"robot.trailer.com_offset_m={1.2 * nominal}",
            f"belief.robot.trailer.com_offset_m={share * nominal}",
        ],
    )
    result = tt.simulate(scenario)
    run = result.trajectory
    off = np.degrees(tt.wrap(run.q[:, 0, 3] - run.ref_q[:, 0, 3]))
    ax.plot(run.time_s, off, color=colour, label=f"law is told {told}")
    print(f"told {told}: {result.verdicts[0]}; θ2 {off[-1]:.3f}° off at the end")
ax.axhline(0.0, color="#777777", linewidth=0.8)
ax.set(xlabel="time [s]", ylabel="θ2 less the reference's [°]")
ax.legend(frameon=False)
plt.show()
