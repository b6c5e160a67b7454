"""
Balance the trailer inside a circle
===================================

Behind a tractor that drives in a circle, a free trailer swings outwards. Inside the circle it is an inverted
pendulum: the smallest error grows. Two laws start from the same place. The article's law (32) follows the circle with
the tractor and ignores the trailer; the time-varying LQR steers both, in contact physics.
"""

import matplotlib.pyplot as plt
import numpy as np

import ttwmr_mj as tt

LAWS = {"the article's law (32)": "lyapunov", "time-varying LQR": "tvlqr"}

fig, axes = plt.subplots(1, 2, figsize=(8, 4), sharex=True, sharey=True, layout="constrained")
for ax, (title, kind) in zip(axes, LAWS.items(), strict=True):
    law = f'controller={{kind="{kind}"}}'
    result = tt.simulate(tt.load_scenario("inverted_trailer", ["duration_s=8.0", law]))
    run = result.trajectory
    x, y, _, theta2 = run.q[:, 0].T
    k = result.scenario.robot.swing_length_m
    ax.plot(*run.ref_q[:, 0].T[:2], color="#F2C879", linewidth=5, label="P, reference")
    ax.plot(x, y, color="#0072B2", label="P, on the tractor")
    ax.plot(
        x - k * np.cos(theta2), y - k * np.sin(theta2), color="#C2478A", label="F, on the trailer"
    )
    ax.set(title=title, xlabel="x [m]", aspect="equal")
    print(f"{title}: {result.verdicts[0]}")
axes[0].set_ylabel("y [m]")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
plt.show()
