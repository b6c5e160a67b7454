"""
Many runs at once: the hitch's damper
=====================================

Laws that follow with the tractor alone leave the trailer to itself. How long it swings depends on the damper in the
hitch. Scenarios that differ only in numbers share a batch; each run is the same, bit for bit, as alone.
"""

import matplotlib.pyplot as plt
import numpy as np

import ttwmr_mj as tt

DAMPING = (0.0, 3e-4, 1e-3, 3e-3)
COMMON = ["duration_s=20.0", "plant.kind=analytic", 'controller={kind="lyapunov"}']
COMMON += ['reference={kind="flat_circle", radius_m=0.6, angular_rate_rad_s=0.5}']

runs = tt.run_batch(
    [
        tt.load_scenario("outer_circle", [*COMMON, f"robot.hitch.damping_n_m_s_rad={damping}"])
        for damping in DAMPING
    ]
)

fig, axes = plt.subplots(
    len(runs), 1, figsize=(7, 6), sharex=True, sharey=True, layout="constrained"
)
for ax, damping, result in zip(axes, DAMPING, runs, strict=True):
    run = result.trajectory
    off = np.degrees(tt.wrap(run.q[:, 0, 3] - run.ref_q[:, 0, 3]))
    ax.axhline(0.0, color="#777777", linewidth=0.8)
    ax.plot(run.time_s, off, color="#C2478A")
    ax.set_title(f"{1e3 * damping:g} mN·m·s/rad", loc="left", fontsize="medium")
    late = np.abs(off[run.time_s > 15.0]).max()
    print(f"{1e3 * damping:4.1f} mN·m·s/rad: θ2 still swings by {late:.2f}° after 15 s")
axes[-1].set_xlabel("time [s]")
fig.supylabel("error of θ2 [°]", fontsize="medium")
plt.show()
