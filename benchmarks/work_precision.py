"""Work-precision diagram of contact physics: how exact which settings are, at what cost.

The wheel speeds of the lab circle drive one robot in open loop. How far P gets, at most, from where
a far finer and stiffer simulation leads it, which is nearly the limit of rigid contacts, is a
setting's error. Where the balls resist rolling, as in the last settings, each drags a contact that
slides, and the solver iterates: what these cost is another matter.
"""

from __future__ import annotations

from pathlib import Path
from time import process_time
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import batch

from ttwmr_mj.dynamics.servo import ramp
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.state import FloatArray, RobotState

DURATION_S = 6.0  # an eighth of a lap of the lab circle, from standstill
EVERY_S = 0.033
PLACES = [0, 1, 3]  # of q: x, y of P, θ2
SHIPPED = "shipped"
SWEPT = "rolling, 1 ms, 2 ms"  # of the Monte Carlo
MARKERS = "osD^v<>PX"


class Setting(NamedTuple):
    """How contacts are solved, and what came of it."""

    name: str
    timestep_s: float = 0.0005
    time_constant_s: float = 0.001
    impedance_ratio: float = 10.0
    cone: str = "elliptic"
    tolerance: float = 1e-10
    rolling_resistance_m: float = 0.0
    error_m: float = 0.0  # largest distance of P from the limit's
    error_rad: float = 0.0  # largest difference of θ2
    cost: float = 0.0  # CPU time per simulated time

    def told(self) -> dict[str, object]:
        """As in the benchmark's JSON."""
        return {
            k: float(f"{v:.3g}") if isinstance(v, float) else v
            for k, v in zip(self._fields, self, strict=True)
        }


LIMIT = Setting("limit", timestep_s=5e-5, time_constant_s=1e-4, impedance_ratio=100.0)
ROLLING_M = 1.6e-5  # of the laboratory's balls
SETTINGS = (
    Setting(SHIPPED),
    Setting("step 1 ms, 2 ms", 1e-3, 2e-3),
    Setting("step 0.25 ms, 0.5 ms", 2.5e-4, 5e-4),
    Setting("step 0.125 ms, 0.25 ms", 1.25e-4, 2.5e-4),
    Setting("step 1 ms, 4 ms", 1e-3, 4e-3),
    Setting("step 0.5 ms, 2 ms", 5e-4, 2e-3),
    Setting("step 0.25 ms, 1 ms", 2.5e-4, 1e-3),
    Setting("impratio 1", impedance_ratio=1.0),
    Setting("impratio 100", impedance_ratio=100.0),
    Setting("step 1 ms, 2 ms, impratio 100", 1e-3, 2e-3, 100.0),
    Setting("pyramidal", cone="pyramidal"),
    Setting("pyramidal, impratio 100", impedance_ratio=100.0, cone="pyramidal"),
    Setting("tolerance 1e-8", tolerance=1e-8),
    Setting("tolerance 1e-6", tolerance=1e-6),
    Setting("tolerance 1e-4", tolerance=1e-4),
    Setting("rolling", rolling_resistance_m=ROLLING_M),
    Setting("rolling, pyramidal", cone="pyramidal", rolling_resistance_m=ROLLING_M),
    Setting(SWEPT, 1e-3, 2e-3, rolling_resistance_m=ROLLING_M),
)


def measured(*, quick: bool = False) -> list[Setting]:
    """Every setting with its errors and its cost."""
    duration_s = 0.5 if quick else DURATION_S
    limit = LIMIT._replace(timestep_s=2e-4) if quick else LIMIT
    settings = (*SETTINGS[:2], *SETTINGS[-2:]) if quick else SETTINGS
    scenario = load_scenario("lab_circle", [f"duration_s={duration_s}", "plant.kind='analytic'"])
    commands = Experiment(scenario).run().trajectory.wheel_command_rad_s[:-1, 0]
    rolling = {setting.rolling_resistance_m for setting in settings}
    limits = {r: limit._replace(rolling_resistance_m=r) for r in rolling}
    exact = {r: driven(setting, commands)[0] for r, setting in limits.items()}
    found = []
    for setting in settings:
        path, cost = driven(setting, commands)
        off = path - exact[setting.rolling_resistance_m]
        error_m = float(np.hypot(off[:, 0], off[:, 1]).max())
        error_rad = float(np.abs(off[:, 2]).max())
        found.append(setting._replace(error_m=error_m, error_rad=error_rad, cost=cost))
        print(f"{setting.name}: {1e3 * error_m:.3f} mm, {1e3 * cost:.2f} ms/s", flush=True)
    return found


def driven(setting: Setting, commands: FloatArray) -> tuple[FloatArray, float]:
    """Path (n, 3) x, y of P and θ2 at every period, and CPU time per simulated time."""
    scenario = load_scenario("lab_circle")
    changes = {
        "timestep_s": setting.timestep_s,
        "contact_time_constant_s": setting.time_constant_s,
        "friction_impedance_ratio": setting.impedance_ratio,
    }
    contact, servo = scenario.plant.contact.model_copy(update=changes), scenario.robot.servo
    balls = {"rolling_resistance_m": setting.rolling_resistance_m}
    casters = scenario.robot.casters.model_copy(update=balls)
    robot = scenario.robot.model_copy(update={"casters": casters})
    # how it stands in its contacts, and no further yaw or drift
    plant = ContactPlant(robot, contact)
    plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, 0.0))
    model = plant.model
    model.opt.cone = getattr(mujoco.mjtCone, f"mjCONE_{setting.cone.upper()}")
    model.opt.tolerance = setting.tolerance
    alone = batch.Batch(model, 1, 1)
    qpos, joints = alone.bind("qpos"), Joints(model)
    alone.reset()
    qpos[:] = plant.joint_positions()
    steps = np.arange(1, round(EVERY_S / setting.timestep_s) + 1, dtype=np.float64)
    time_s = setting.timestep_s * steps
    setpoint, path, seconds = np.zeros((1, 2)), [], 0.0
    for command in commands:
        control = ramp(setpoint, command[None], servo, time_s)
        setpoint = control[:, -1]
        began = process_time()
        alone.rollout(time_s.size, control)
        seconds += process_time() - began
        path.append(joints.planar(qpos, alone.bind("qvel"))[0][0, PLACES])
    poses = np.array(path)
    poses[:, 2] = np.unwrap(poses[:, 2])
    return poses, seconds / (len(commands) * EVERY_S)


def draw(settings: list[Setting], path: Path) -> None:
    """Error over cost, both logarithmic."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.2, 4.6), layout="constrained")
    for i, setting in enumerate(settings):
        marker, size = ("*", 14) if setting.name == SHIPPED else (MARKERS[i % len(MARKERS)], 6)
        place = 1e3 * setting.cost, 1e3 * setting.error_m
        axes.loglog(*place, marker, ms=size, label=setting.name)
    figure.legend(loc="outside right center", fontsize=8)
    axes.set_xlabel("CPU time per simulated second [ms]")
    axes.set_ylabel("largest error of P within 6 s [mm]")
    axes.grid(which="both", alpha=0.3)
    figure.savefig(path, dpi=160)
    plt.close(figure)
