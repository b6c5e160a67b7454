"""What a stranger meets first: hints by meaning, names in words, references that go on."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.waypoints import Waypoints
from ttwmr_mj.scenario.meaning import best_by_meaning

TIMES = 0.033 * np.arange(200)


@pytest.mark.parametrize(
    ("override", "meant"),
    [
        ("robot.hitch.viscous_damping=1.0", "damping_n_m_s_rad"),
        ("robot.hitch.dry_friction=1.0", "coulomb_friction_n_m"),
        ("robot.hitch.spring=1.0", "stiffness_n_m_rad"),
        ("robot.viscous_damping=1.0", "hitch.damping_n_m_s_rad"),
        ("robot.tractor.weight=1.0", "mass_kg"),
        ("robot.servo.max_velocity=1.0", "speed_limit_rad_s"),
        ("control.delay=1.0", "command_latency_s"),
        ("reference.omega=1.0", "angular_rate_rad_s"),
    ],
)
def test_an_unknown_key_is_told_by_its_meaning(override: str, meant: str) -> None:
    with pytest.raises(tt.InputError) as caught:
        tt.load_scenario("lab_circle", [override])
    (fault,) = caught.value.faults
    assert fault.problem == f"unknown key (did you mean {meant!r}?)"


def test_what_means_nothing_here_gets_no_hint() -> None:
    with pytest.raises(tt.InputError) as caught:
        tt.load_scenario("lab_circle", ["robot.hitch.colour='red'"])
    assert caught.value.faults[0].problem == "unknown key"
    assert best_by_meaning("m_s", {"speed_m_s": "how fast"}) == ""  # units alone mean nothing


def test_a_bad_name_is_told_in_words() -> None:
    with pytest.raises(tt.InputError) as caught:
        tt.load_scenario("lab_circle", ["name='My Scenario'"])
    (fault,) = caught.value.faults
    assert fault.allowed.startswith("up to 64 lower-case letters, digits, - and _")


def test_all_keys_that_are_missing_in_a_table_are_named() -> None:
    with pytest.raises(tt.InputError) as caught:
        tt.load_scenario("lab_circle", ["reference={kind='flat_ellipse'}"])
    keys = {fault.where for fault in caught.value.faults}
    assert keys == {"reference.half_axes_m", "reference.angular_rate_rad_s"}


def test_beyond_its_samples_a_reference_goes_straight_on() -> None:
    path = Circle(radius_m=0.5, angular_rate_rad_s=0.4, theta2="aligned").sample(TIMES)
    last = len(TIMES) - 1
    for k in (0, 7, last):
        assert path.at(k).position_m == pytest.approx(path.position_m[k])
        assert path.at(k).acceleration_m_s2 == pytest.approx(path.acceleration_m_s2[k])
    far = path.at(last + 10)
    assert far.position_m == pytest.approx(path.position_m[-1] + 0.33 * path.velocity_m_s[-1])
    assert far.theta == pytest.approx(path.theta[-1] + 0.33 * path.theta_rate[-1])
    assert not far.acceleration_m_s2.any()
    assert path.at(-3).position_m == pytest.approx(path.position_m[0])
    many = path.at(np.array([0, last, last + 10]))
    assert many.position_m.shape == (3, 1, 2)
    assert many.position_m[2] == pytest.approx(far.position_m)


def test_what_has_come_to_rest_stays_there() -> None:
    way = Waypoints(points_m=((0.0, 0.0), (0.2, 0.1), (0.4, 0.0)), speed_m_s=0.2, theta2="aligned")
    path = way.sample(TIMES)
    assert path.at(1000).position_m == pytest.approx(path.position_m[-1])


AHEAD = """
import ttwmr_mj as tt

class Ahead(tt.Controller):
    def start(self, task):
        self.task = task

    def command(self, k, estimate):
        aim = self.task.reference.{row}
        speed = 0.0 * aim + 1.0
        return self.plain(speed)
"""


@pytest.mark.parametrize(
    ("row", "status"), [("at(k + 500).position_m", "ok"), ("position_m[k + 500]", "failed")]
)
def test_a_law_that_looks_too_far_ahead(row: str, status: str, tmp_path: Path) -> None:
    (tmp_path / f"ahead_{status}.py").write_text(AHEAD.format(row=row))
    law = f"controller={{kind='custom', target='ahead_{status}:Ahead'}}"
    scenario = tt.load_scenario("lab_circle", [law, "plant.kind=analytic", "duration_s=1.0"])
    (outcome,) = tt.simulate(scenario, scenario_folder=tmp_path).outcomes
    assert outcome.status == status
    assert (status == "ok") is ("task.reference.at(k)" not in outcome.reason)


@pytest.mark.slow
def test_bench_that_is_stopped_says_what_is_kept(tmp_path: Path) -> None:
    (tmp_path / "suite.toml").write_text(
        'name = "s"\nseeds = [0, 1]\n[controller.a]\n[task.t]\nscenario = "lab_circle"\n'
        'overrides = ["duration_s=400.0"]\n[[block]]\n'
    )
    command = [sys.executable, "-m", "ttwmr_mj", "bench", "suite.toml"]
    with subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as bench:
        for _ in range(600):
            if list(tmp_path.glob("results/bench/*/runs/*")):
                break
            time.sleep(0.1)
        bench.send_signal(signal.SIGINT)
        _, told = bench.communicate(timeout=60)
    (folder,) = (tmp_path / "results" / "bench").iterdir()
    assert bench.returncode == 1
    kept = folder.relative_to(tmp_path)
    assert f"stopped; 0 of 2 runs are kept in {kept}. To go on: " in told
    assert told.rstrip().endswith(f"--out {kept}")
