"""What `ttwmr new` writes: files that run as they are, to be changed."""

SCENARIO = """\
# What to do with it: ttwmr validate {name}.toml; ttwmr run {name}.toml; ttwmr view
# All keys, with units, defaults and limits: ttwmr export-schema. All kinds: ttwmr list.
name = "{name}"
description = "{what}"   # shown with the results
duration_s = 20.0

[robot.servo]
preset = "fast"                  # 40 rad/s at the wheels; "lab", the default, 6.5 rad/s

[robot.hitch]
damping_n_m_s_rad = 1e-3         # of its damper; without the table the hitch turns freely
# stiffness_n_m_rad = 0.0
# coulomb_friction_n_m = 0.0

[initial]
kind = "on_reference"            # or "at_rest", with x_m, y_m, theta1_rad, theta2_rad
x_offset_m = 0.02                # off the reference at the start

# A circle of the trailer's centre of oscillation, which tractor and trailer can follow exactly.
[reference]
kind = "flat_circle"
radius_m = 0.6
angular_rate_rad_s = 0.5
side = "outside"                 # of the trailer; "inside" is unstable

[controller]
{law}
[sensing]
kind = "truth"                   # or "camera", which sees coloured labels

[plant]
kind = "contact"                 # MuJoCo's contact physics; or "analytic", the article's equations

# When the run counts as a success: docs/reference/verdict.md has all limits.
[accept]
end_tractor_m = 0.05
"""
BUILT_IN = """\
kind = "tvlqr"                   # steers the trailer too; ttwmr list has the others
"""
CUSTOM = """\
kind = "custom"
target = "{module}:{law}"

[controller.options]             # keyword arguments of the class
gain_1_s = 2.0
turn_gain_1_s = 6.0
"""
LAW = '''\
"""A law of your own: steer P along its reference.

It ignores the trailer, which on this reference is carried along: outside of the circle its motion
is stable. A law that steers the trailer, too, uses θ2 of the estimate, and the reference's theta.
"""

import numpy as np

import ttwmr_mj as tt


class {law}(tt.Controller):
    """The reference's own motion, and corrections along and across it."""

    def __init__(self, gain_1_s: float = 2.0, turn_gain_1_s: float = 6.0) -> None:
        self.gain_1_s, self.turn_gain_1_s = gain_1_s, turn_gain_1_s

    def start(self, task: tt.Task) -> None:
        """Prepare: the robot as it is believed to be, the reference, the control period."""
        self.task = task

    def command(self, k: int, estimate: tt.Estimate) -> tt.Command:
        """Wheel speeds (nsim, 2) [rad/s] from sample k, time k·sampling_time_s, until the next."""
        q = estimate.state.q  # (nsim, 4): x, y [m] of P, θ1, θ2 [rad]
        aim = self.task.reference.at(k)  # goes on beyond the end of the run
        miss = aim.position_m - q[:, :2]
        towards = aim.velocity_m_s + self.gain_1_s * miss  # where P shall move, and how fast
        off = tt.wrap(np.arctan2(towards[:, 1], towards[:, 0]) - q[:, 2])
        speed = np.hypot(*towards.T) * np.cos(off)
        turn = aim.theta_rate[:, 0] + self.turn_gain_1_s * off
        wheels = tt.wheels_from_twist(np.stack([speed, turn], axis=-1), self.task.robot)
        limit = self.task.robot.servo.speed_limit_rad_s
        return self.plain(np.clip(wheels, -limit, limit))
'''
TEST = '''\
"""The law does what it is for; run with: python -m pytest {test}"""

from pathlib import Path

import ttwmr_mj as tt

HERE = Path(__file__).parent


def test_the_law_brings_p_to_its_reference() -> None:
    """Within 5 mm in the second half, from 20 mm off, in contact physics."""
    lean = ["output.recording=false", "output.figures=false"]
    scenario = tt.load_scenario(str(HERE / "{name}.toml"), lean)
    result = tt.simulate(scenario, scenario_folder=HERE)
    (outcome,), (metrics,) = result.outcomes, tt.score(result.trajectory, scenario.robot)
    assert outcome.status == "ok", outcome.reason
    assert metrics["steady_tractor_rmse_m"] < 0.005


def test_it_works_by_camera() -> None:
    """With what it sees instead of the truth, for a shorter time."""
    lean = ["output.recording=false", "output.figures=false", "duration_s=8.0"]
    scenario = tt.load_scenario(str(HERE / "{name}.toml"), [*lean, "sensing.kind=camera"])
    (verdict,) = tt.simulate(scenario, scenario_folder=HERE).verdicts
    assert verdict.name == "followed", str(verdict)
'''


def template_files(name: str, *, controller: bool) -> dict[str, str]:
    """File name → text: a scenario, and with a controller a law and its test.

    Args:
        name: of the scenario, as the schema allows it.
        controller: whether the scenario is driven by a law of the user's.
    """
    module = f"{name.replace('-', '_')}_law"
    module = module if module[0].isalpha() else f"my_{module}"
    words = {
        "name": name,
        "module": module,
        "law": "".join(word.capitalize() for word in module.split("_") if word),
        "test": f"test_{module}.py",
        "what": "A law of my own on a circle" if controller else "A circle, tractor and trailer",
    }
    law = (CUSTOM if controller else BUILT_IN).format(**words)
    files = {f"{name}.toml": SCENARIO.format(**words | {"law": law})}
    if controller:
        files[f"{module}.py"] = LAW.format(**words)
        files[words["test"]] = TEST.format(**words)
    return files
