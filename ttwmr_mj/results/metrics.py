"""From a trajectory to numbers: SI units in the names, null where a number is undefined.

Names without a prefix of their own cover the whole run; `steady_*` covers the second half of the
time. Angle errors are taken on the circle, in [−π, π): a trailer that has spun once around points
where it pointed before.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ttwmr_mj.results.accept import SLIPPING_M_S
from ttwmr_mj.results.curves import Curves, require_rows, require_run, start_of_last
from ttwmr_mj.results.trajectory import TORQUE_SIGNALS, Trajectory
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.state import BoolArray, FloatArray, wrap

RESTING_M_S = 1e-3  # a reference that is slower rests
SETTLED_M = 0.01  # a run has settled when P stays this close to its reference until the end

Metrics = dict[str, float | None]


def _value(number: float) -> float | None:
    return float(number) if math.isfinite(number) else None


def _rms(values: FloatArray, _: FloatArray) -> float | None:
    defined = values[np.isfinite(values)]
    return _value(np.sqrt(np.mean(defined**2))) if defined.size else None


def _max(values: FloatArray, _: FloatArray) -> float | None:
    defined = values[np.isfinite(values)]
    return _value(defined.max()) if defined.size else None


def _final(values: FloatArray, _: FloatArray) -> float | None:
    return _value(values[-1])


def _share(values: FloatArray, _: FloatArray) -> float | None:
    defined = values[np.isfinite(values)]
    return float(defined.mean()) if defined.size else None


def _integral(values: FloatArray, time_s: FloatArray) -> float | None:
    defined = np.isfinite(values)
    if not defined.any():
        return None
    return _value(float(np.trapezoid(values[defined], time_s[defined])))


def _settling_time(error: FloatArray, time_s: FloatArray) -> float | None:
    """First time after which the error stays below SETTLED_M; None if the run ends outside it."""
    if not np.isfinite(error).all() or error[-1] > SETTLED_M:
        return None
    outside = np.flatnonzero(error > SETTLED_M)
    return float(time_s[outside[-1] + 1]) if outside.size else float(time_s[0])


class Sum(NamedTuple):
    """A way to sum up values over time."""

    words: str
    formula: str  # of the value x
    unit: str  # its own; "same" as the value's, or the "integral" of it over time


class Quantity(NamedTuple):
    """What is summed up."""

    words: str
    formula: str
    unit: str
    equations: str = ""  # of the article, behind it


class Metric(NamedTuple):
    """A number that sums up a run: a function of values (n,) and times (n,), and which values."""

    sum_up: Callable[[FloatArray, FloatArray], float | None]
    of: str

    @property
    def meaning(self) -> str:
        """In words."""
        return f"{SUMS[self.sum_up].words} {QUANTITIES[self.of].words}"

    @property
    def may_never_come(self) -> bool:
        """Whether a finished run without it is worse than any that has it; else it is undefined."""
        return self.sum_up is _settling_time

    @property
    def unit(self) -> str:
        """As people write it; 1 of shares."""
        unit = QUANTITIES[self.of].unit
        return {"same": unit, "integral": INTEGRALS.get(unit, "")}.get(
            SUMS[self.sum_up].unit, SUMS[self.sum_up].unit
        )

    @property
    def formula(self) -> str:
        """How it is computed."""
        return SUMS[self.sum_up].formula.format(QUANTITIES[self.of].formula)


INTEGRALS = {"m": "m·s", "m·s": "m·s²", "rad²/s²": "rad²/s"}
SUMS = {
    _rms: Sum("rms", "√(mean {}²)", "same"),
    _max: Sum("largest", "max {}", "same"),
    _final: Sum("final", "{} at the last sample", "same"),
    _share: Sum("share of samples", "mean({})", "1"),
    _integral: Sum("integral over time of the", "∫ {} dt", "integral"),
    _settling_time: Sum(
        f"time after which it stays within {1e3 * SETTLED_M:g} mm:",
        f"min T: {{}} ≤ {SETTLED_M:g} m for all t ≥ T",
        "s",
    ),
}
QUANTITIES = {
    "tractor": Quantity("distance of P from its reference", "|P − P_d|", "m", "2, 30"),
    "tractor_t": Quantity(
        "distance of P from its reference, times t", "t·|P − P_d|", "m·s", "2, 30"
    ),
    "trailer": Quantity(
        "distance of the (last) trailer's COM, l behind its hitch, from its reference",
        "|G − G_d|",
        "m",
        "16-17",
    ),
    "oscillation": Quantity(
        "distance of the (last) trailer's centre of oscillation from its reference",
        "|F − F_d|",
        "m",
        "24",
    ),
    "theta1": Quantity("error of θ1", "(θ1 − θ1_d)", "rad", "2"),
    "theta2": Quantity("error of θ2", "(θ2 − θ2_d)", "rad", "2"),
    "wheel_speed": Quantity("speed of a wheel", "(|ω_r|, |ω_l|)", "rad/s", "8-9"),
    "command_squared": Quantity(
        "sum ω_r² + ω_l² of the commands", "(ω_r² + ω_l²) commanded", "rad²/s²", "8-9"
    ),
    "saturated": Quantity(
        "whose command was cut to the servo's range, or at its limit",
        "the command was cut or at the limit",
        "1",
        "8-9",
    ),
    "near_singular": Quantity(
        "near the singularity of the map from accelerations to wheels, while the reference moves",
        f"u1 near 0, |Ṗ_d| > {RESTING_M_S:g} m/s",
        "1",
        "27-28",
    ),
    "seen_position": Quantity(
        "distance between the controller's estimate of P and the true P", "|P̂ − P|", "m", "2"
    ),
    "seen_theta1": Quantity("error of the controller's estimate of θ1", "(θ̂1 − θ1)", "rad", "2"),
    "seen_theta2": Quantity("error of the controller's estimate of θ2", "(θ̂2 − θ2)", "rad", "2"),
    "blind": Quantity(
        "at which the sensor's estimate was invalid", "the estimate was invalid", "1"
    ),
    "tilt": Quantity("tilt of the tractor against the floor's plane", "tilt", "rad"),
    "height": Quantity("height of P above where it stands", "z_P − z_P(standing)", "m"),
    "airborne": Quantity("at which a wheel does not touch the ground", "wheels on floor < 2", "1"),
    "slipping": Quantity(
        f"at which a wheel slips faster than {SLIPPING_M_S:g} m/s",
        f"slip > {SLIPPING_M_S:g} m/s",
        "1",
    ),
}
_TRACKING = {
    "tractor_rmse_m": Metric(_rms, "tractor"),
    "tractor_max_error_m": Metric(_max, "tractor"),
    "tractor_final_error_m": Metric(_final, "tractor"),
    "trailer_rmse_m": Metric(_rms, "trailer"),
    "trailer_max_error_m": Metric(_max, "trailer"),
    "centre_of_oscillation_rmse_m": Metric(_rms, "oscillation"),
    "theta1_rmse_rad": Metric(_rms, "theta1"),
    "theta2_rmse_rad": Metric(_rms, "theta2"),
}
METRICS = {
    **_TRACKING,
    **{f"steady_{name}": m for name, m in _TRACKING.items() if m.sum_up is not _final},
    "iae_m_s": Metric(_integral, "tractor"),
    "itae_m_s2": Metric(_integral, "tractor_t"),
    "settling_time_s": Metric(_settling_time, "tractor"),
    "wheel_speed_max_rad_s": Metric(_max, "wheel_speed"),
    "control_effort": Metric(_integral, "command_squared"),
    "saturated_share": Metric(_share, "saturated"),
    "near_singular_share": Metric(_share, "near_singular"),
    "estimator_position_rmse_m": Metric(_rms, "seen_position"),
    "estimator_theta1_rmse_rad": Metric(_rms, "seen_theta1"),
    "estimator_theta2_rmse_rad": Metric(_rms, "seen_theta2"),
    "blind_share": Metric(_share, "blind"),
    "tilt_max_rad": Metric(_max, "tilt"),
    "height_max_m": Metric(_max, "height"),
    "airborne_share": Metric(_share, "airborne"),
    "slipping_share": Metric(_share, "slipping"),
}


def meaning_of(name: str) -> str:
    """What one of METRICS is, in words, and what it covers if that is not the whole run."""
    covered = "over the second half: " if name.startswith("steady_") else ""
    return f"{covered}{METRICS[name].meaning}"


def _samples(rows: Trajectory, robot: RobotParameters) -> dict[str, FloatArray]:
    """QUANTITIES (n,) of a batch of one."""
    curves, seen = Curves.of(rows, robot), rows.est_q - rows.q
    batch = {
        "tractor": curves.tractor_error_m,
        "tractor_t": curves.tractor_error_m * rows.time_s[:, None],
        "trailer": curves.trailer_error_m,
        "oscillation": curves.oscillation_error_m,
        "theta1": curves.theta_error_rad[..., 0],
        "theta2": curves.theta_error_rad[..., 1],
        "wheel_speed": np.abs(rows.wheel_speed_rad_s).max(axis=-1),
        "command_squared": _where_told((rows.wheel_command_rad_s**2).sum(axis=-1), rows),
        "saturated": rows.saturated,
        "near_singular": rows.near_singular & ~_resting(rows),
        "seen_position": np.hypot(seen[..., 0], seen[..., 1]),
        "seen_theta1": wrap(seen[..., 2]),
        "seen_theta2": wrap(seen[..., 3]),
        "blind": ~rows.est_valid,
        "tilt": rows.tilt_rad,
        "height": rows.height_m,
        "airborne": _where_known(rows.wheels_on_floor < 2, rows.wheels_on_floor),
        "slipping": _where_known(rows.wheel_slip_m_s > SLIPPING_M_S, rows.wheel_slip_m_s),
    }
    return {name: values[:, 0] for name, values in batch.items()}


def _resting(rows: Trajectory) -> BoolArray:
    """(n, nsim) whether the reference stands still; a robot that does so too is in no trouble."""
    return np.asarray(np.hypot(*np.moveaxis(rows.ref_q_rate[..., :2], -1, 0)) < RESTING_M_S)


def _where_told(command_squared: FloatArray, rows: Trajectory) -> FloatArray:
    """NaN for a law that drives by torques and names no speeds: that is no law without effort."""
    silent = TORQUE_SIGNALS[0] in rows.signals and not command_squared.any()
    return np.full_like(command_squared, np.nan) if silent else command_squared


def _where_known(condition: BoolArray, of: FloatArray) -> FloatArray:
    return np.where(np.isfinite(of), condition, np.nan)


def score(trajectory: Trajectory, robot: RobotParameters) -> tuple[Metrics, ...]:
    """All METRICS of every simulation, in order; a value is None where it is undefined.

    Undefined are: errors against a reference that does not exist, settling that never happens, the
    control effort of a law that gives torques and no speeds, and everything of a run without a
    single finite row.

    Raises:
        InputError: the trajectory has no rows, or is of a robot with more or fewer trailers.
    """
    require_run(trajectory, robot)
    require_rows(trajectory)
    return tuple(_score(trajectory.simulation(i), robot) for i in range(trajectory.nsim))


def _score(rows: Trajectory, robot: RobotParameters) -> Metrics:
    """All metrics of a batch of one."""
    time_s, samples = rows.time_s, _samples(rows, robot)
    half = start_of_last(0.5, time_s)
    numbers: Metrics = {}
    for name, metric in METRICS.items():
        start = half if name.startswith("steady_") else 0
        numbers[name] = metric.sum_up(samples[metric.of][start:], time_s[start:])
    return numbers
