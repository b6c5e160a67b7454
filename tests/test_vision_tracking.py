"""The tracker against the truth of driven runs: accuracy, consistency, honesty, determinism."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy import stats
from vision_scene import ROBOT, lab_calibration, with_faults

from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.state import BoolArray, FloatArray, RobotState, wrap
from ttwmr_mj.vision.camera.labels import LabelLayout
from ttwmr_mj.vision.camera.options import LAB_CAMERA, CameraOptions
from ttwmr_mj.vision.options import CameraSensing
from ttwmr_mj.vision.sensor import CameraSensor
from ttwmr_mj.vision.tracking import tracker
from ttwmr_mj.vision.tracking.estimate import Status
from ttwmr_mj.vision.tracking.kalman import update
from ttwmr_mj.vision.tracking.motion import Gaussian

PERIOD_S = 0.033
PERIODS = 150


class Drive(NamedTuple):
    error: FloatArray  # (n, 4) of q
    rate_error: FloatArray  # (n, 4)
    valid: FloatArray  # (n,)
    labels: FloatArray  # (n,)
    status: list[Status]
    std: FloatArray  # (n, 4) as the tracker states it


def command(k: int) -> FloatArray:
    return np.array([[2.35 + 1.5 * np.sin(0.05 * k), 1.8 + np.cos(0.031 * k)]])


def drive(
    options: CameraOptions, *, latency: int = 1, seed: int = 0, periods: int = PERIODS
) -> Drive:
    plant = ContactPlant(ROBOT, ContactOptions())
    plant.reset(RobotState.at_rest(0.43, 0.0, np.pi / 2, np.pi / 2))
    sensor = CameraSensor(
        CameraSensing(kind="camera", camera=options, latency_s=latency * PERIOD_S),
        lab_calibration().camera,
        ROBOT,
        plant.model,
        period_s=PERIOD_S,
        nsim=1,
        rng=np.random.default_rng(seed),
        joint_positions=plant.joint_positions,
    )
    rows: list[tuple[FloatArray, FloatArray, float, float]] = []
    status, std = [], []
    for k in range(periods):
        truth = plant.state()
        seen = sensor.observe(truth)
        error = seen.state.q[0] - truth.q[0]
        error[2:] = wrap(error[2:])
        rate_error = seen.state.q_rate[0] - truth.q_rate[0]
        rows.append((error, rate_error, float(seen.valid[0]), float(seen.labels_found[0])))
        status.append(sensor.estimates[0].status)
        std.append(np.sqrt(sensor.estimates[0].covariance.diagonal()))
        sensor.commanded(command(k))
        plant.advance(command(k), round(PERIOD_S / plant.time_step_s))
    sensor.close()
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Drive(*columns, status=status, std=np.array(std))


@pytest.mark.slow
@pytest.mark.parametrize("latency", [0, 2])
def test_latency_is_compensated(latency: int) -> None:
    run = drive(LAB_CAMERA, latency=latency)
    assert run.valid.all()
    # a millimetre is what 0.3 of a period would cost at 0.08 m/s
    assert np.hypot(run.error[:, 0], run.error[:, 1]).max() < 5e-4
    assert np.abs(run.error[:, 2:]).max() < np.radians(0.25)
    assert np.sqrt((run.rate_error[10:, :2] ** 2).mean()) < 1e-3
    assert np.sqrt((run.rate_error[10:, 2:] ** 2).mean()) < 0.02


@pytest.mark.slow
def test_innovations_are_as_large_as_the_filter_believes(monkeypatch: pytest.MonkeyPatch) -> None:
    nis: list[tuple[float, int]] = []  # normalised innovation squared, degrees of freedom

    def watched(
        prior: Gaussian,
        points_m: FloatArray,
        found: BoolArray,
        layout: LabelLayout,
        noise_m2: float,
        gate_chi2: float,
    ) -> tuple[Gaussian, BoolArray]:
        posterior, used = update(prior, points_m, found, layout, noise_m2, gate_chi2)
        rows = np.repeat(used, 2)
        slope = layout.jacobian(prior.mean[:4])[rows]
        off = (points_m - layout.centres_m(prior.mean[:4])[:, :2]).ravel()[rows]
        spread = slope @ prior.covariance[:4, :4] @ slope.T + noise_m2 * np.eye(rows.sum())
        nis.append((off @ np.linalg.solve(spread, off), len(off)))
        return posterior, used

    monkeypatch.setattr(tracker, "update", watched)
    run = drive(with_faults(LAB_CAMERA, delivery={"dropped": 0.2}))
    assert 0.65 < (run.labels > 0).mean() < 0.9
    assert run.valid.all()
    each = np.array(nis)
    total, freedom = each.sum(axis=0)
    # too confident fails at the 99.9 % quantile; a third of what is believed is slack enough
    assert total < stats.chi2.ppf(0.999, freedom)
    assert total > 0.33 * freedom
    # no more than the gate's share of frames beyond the 99.9 % quantile of their own
    beyond = each[:, 0] > stats.chi2.ppf(0.999, each[:, 1])
    assert beyond.mean() < 0.03


def test_a_blackout_is_reported_and_survived() -> None:
    dark = {"blackouts": [{"start_s": 2.0, "end_s": 3.0}]}
    run = drive(with_faults(LAB_CAMERA, delivery=dark))
    time = PERIOD_S * np.arange(PERIODS)
    lost = np.array([status is Status.LOST for status in run.status])
    # one period of latency, then the time that blindness is tolerated
    assert not run.valid[(time > 2.25) & (time < 3.0)].any()
    assert run.valid[(time < 2.0) | (time > 3.1)].all()
    assert lost.any()
    assert run.labels[lost].sum() == 0
    # dead reckoning meanwhile, and its stated uncertainty covers it
    assert np.hypot(run.error[:, 0], run.error[:, 1]).max() < 5e-3
    assert (np.abs(run.error[lost]) < 4 * run.std[lost]).mean() > 0.95
    assert np.hypot(*run.error[-1, :2]) < 5e-4


def test_hidden_trailer_labels_leave_the_tractor_tracked() -> None:
    over = [{"over": "trailer", "start_s": 2.0, "end_s": 3.5, "diameter_m": 0.16}]
    run = drive(with_faults(LAB_CAMERA, occluders=over))
    hidden = run.labels == 2
    assert hidden.sum() == pytest.approx(45, abs=2)
    assert np.hypot(run.error[hidden, 0], run.error[hidden, 1]).max() < 5e-4
    assert np.abs(run.error[hidden, 3]).max() < np.radians(3.0)
    assert run.std[hidden, 3].max() > 3 * run.std[~hidden, 3][5:].max()


def test_late_and_frozen_frames_do_not_mislead() -> None:
    delivery = {"late": 0.2, "late_periods": 2, "frozen": 0.2}
    run = drive(with_faults(LAB_CAMERA, delivery=delivery))
    assert run.valid.mean() > 0.97
    assert np.hypot(run.error[:, 0], run.error[:, 1]).max() < 2e-3


def test_a_frozen_camera_makes_blind() -> None:
    run = drive(with_faults(LAB_CAMERA, delivery={"frozen": 1.0}), periods=60)
    assert not run.valid[8:].any()
    assert np.hypot(run.error[:, 0], run.error[:, 1]).max() < 5e-3  # dead reckoning


@pytest.mark.slow
def test_distractors_in_the_way_do_not_mislead() -> None:
    discs = [
        {"colour_of": "tractor_front", "position_m": (0.40, 0.18)},
        {"colour_of": "trailer_rear", "position_m": (0.30, 0.30)},
        {"colour_of": "trailer_front", "position_m": (0.46, 0.05)},
    ]
    run = drive(with_faults(LAB_CAMERA, distractors=discs))
    assert run.valid.all()
    assert np.hypot(run.error[:, 0], run.error[:, 1]).max() < 2e-3


def test_same_seed_same_estimates() -> None:
    first, again, other = (drive(LAB_CAMERA, seed=seed, periods=30) for seed in (4, 4, 5))
    assert np.array_equal(first.error, again.error)
    assert not np.array_equal(first.error, other.error)


def test_before_the_first_sighting_nothing_is_claimed() -> None:
    dark = {"blackouts": [{"start_s": 0.0, "end_s": 1.0}]}
    run = drive(with_faults(LAB_CAMERA, delivery=dark), latency=0, periods=60)
    assert not run.valid[:30].any()
    assert run.valid[40:].all()
    assert np.isfinite(run.error).all()
