"""
The camera closes the loop
==========================

An overhead camera is the only sensor: an image every 33 ms, noise, blur, lens distortion, and one frame of latency.
A tracker finds the labels on both bodies and estimates the state. The picture shows how far its estimate is from the
truth, which no law ever sees. Needs software OpenGL; ``ttwmr doctor`` says whether it is there.
"""

import matplotlib.pyplot as plt
import numpy as np

import ttwmr_mj as tt

scenario = tt.load_scenario("inverted_trailer_camera", ["duration_s=4.0"])
result = tt.simulate(scenario)
run = result.trajectory

fig, (above, below) = plt.subplots(2, 1, figsize=(7, 4.5), sharex=True, layout="constrained")
above.plot(run.time_s, 1e3 * np.hypot(*(run.est_q - run.q)[:, 0].T[:2]), color="#0072B2")
above.set(ylabel="error of P [mm]")
below.plot(run.time_s, np.degrees(tt.wrap(run.est_q - run.q))[:, 0, 2], color="#0072B2", label="θ1")
below.plot(run.time_s, np.degrees(tt.wrap(run.est_q - run.q))[:, 0, 3], color="#C2478A", label="θ2")
below.set(xlabel="time [s]", ylabel="error of angles [°]")
below.legend(frameon=False)
print(result.verdicts[0])
print(f"labels found per image: {run.labels_found.mean():.1f}")
plt.show()
