"""
Three laws on the same circle
=============================

The same start, 50 mm and 0.2 rad off, the same robot, the analytic model. All three laws steer the trailer; how fast
they remove the error differs. :doc:`/howto/choose_a_law` says which to take.
"""

import matplotlib.pyplot as plt
import numpy as np

import ttwmr_mj as tt

LAWS = {"flatness": "#0072B2", "tvlqr": "#D55E00", "mpc": "#009E73"}
COMMON = ["duration_s=10.0", "plant.kind=analytic"]

fig, (above, below) = plt.subplots(2, 1, figsize=(7, 5), sharex=True, layout="constrained")
for kind, colour in LAWS.items():
    scenario = tt.load_scenario("outer_circle", [*COMMON, f'controller={{kind="{kind}"}}'])
    result = tt.simulate(scenario)
    run = result.trajectory
    off = np.hypot(*(run.q - run.ref_q)[:, 0].T[:2])
    above.semilogy(run.time_s, 1e3 * off, color=colour, label=kind)
    below.plot(run.time_s, np.degrees(tt.wrap(run.q[:, 0, 3] - run.ref_q[:, 0, 3])), color=colour)
    (metrics,) = tt.score(result.trajectory, scenario.robot)
    print(f"{kind:9} P {1e3 * metrics['tractor_final_error_m']:.4f} mm off at the end")
above.set(ylabel="distance of P [mm]")
below.set(xlabel="time [s]", ylabel="error of θ2 [°]")
above.legend(frameon=False)
plt.show()
