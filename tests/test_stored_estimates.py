"""What the law was told, in a run folder: refused where its sensing cannot have told it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_folders import Columns, edit, made

import ttwmr_mj as tt
from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.stored.estimates import wrong_estimates
from ttwmr_mj.scenario.stored.run import SAME, StoredRun

PLACES = ("est_x_m", "est_y_m")
HEADINGS = ("est_theta1_rad", "est_theta2_rad")
CAN = r"is \S+ at \S+ s, and \S+ is the nearest that its scenario's sensing can tell"
NOISE = (
    "sensing.position_noise_m=2e-4",
    "sensing.angle_noise_rad=1e-3",
    "sensing.velocity_noise_m_s=5e-3",
    "sensing.rate_noise_rad_s=0.02",
)
# as a law is told, beside the state as it is
CHANNELS: dict[str, tuple[str, ...]] = {
    "exact": (),
    "one column": NOISE[:1],
    "noisy": NOISE,
    "late": ("sensing.latency_s=0.066",),
    "late by surprise": ("sensing.latency_s=0.066", "belief.latency_s=0.033"),
    "thought late": ("belief.latency_s=0.066",),
    "unsteady": (*NOISE, "sensing.latency_s=0.033", "sensing.latency_jitter_s=0.066"),
    "lost": (*NOISE, "sensing.drop_probability=0.7"),
    "a clock ahead": (*NOISE, "sensing.clock_offset_s=0.05", "sensing.latency_s=0.033"),
    "a clock behind": ("sensing.clock_offset_s=-0.05",),
    "all": (
        *NOISE,
        "sensing.latency_s=0.033",
        "sensing.latency_jitter_s=0.066",
        "sensing.drop_probability=0.2",
        "sensing.clock_offset_s=0.01",
        "belief.latency_s=0.0",
    ),
}


def of(names: tuple[str, ...], change: Callable[[Any], Any]) -> Callable[[Columns], Columns]:
    return lambda columns: columns | {name: change(columns[name]) for name in names}


DAMAGES = {
    "millimetres": of(PLACES, lambda v: 1e3 * v),
    "tenfold": of(PLACES, lambda v: 10.0 * v),
    "elsewhere": of(PLACES, lambda v: v + 50.0),
    "mirrored": of(PLACES[:1], lambda v: -v),
    "degrees": of(HEADINGS, np.degrees),
    "zeros": of((*PLACES, *HEADINGS), np.zeros_like),
    "of other times": of((*PLACES, *HEADINGS), lambda v: np.roll(v, 7)),
    "tenfold rates": of(("est_theta1_rate_rad_s",), lambda v: 10.0 * v),
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("told")
    for name, overrides in CHANNELS.items():
        (folder / name).mkdir()
        made(folder / name, "lab_circle", "plant.kind=analytic", *overrides)
    return folder


@pytest.mark.parametrize("channel", CHANNELS)
def test_what_a_law_cannot_have_been_told_is_refused(
    channel: str, runs: Path, tmp_path: Path
) -> None:
    for damage, change in DAMAGES.items():
        folder = shutil.copytree(runs / channel, tmp_path / damage)
        StoredRun.read(folder)
        edit(folder, change)
        with pytest.raises(InputError, match=rf"trajectory\.parquet: its column est_\w+ {CAN}"):
            StoredRun.read(folder)


def test_what_the_law_is_told_is_the_state_where_nothing_is_between(
    runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = shutil.copytree(runs / "exact", tmp_path / "run")

    def moved(columns: Columns) -> Columns:
        return columns | {"est_theta2_rate_rad_s": columns["est_theta2_rate_rad_s"] + 1e-3}

    edit(folder, moved)
    before = (folder / "metrics.json").read_bytes()
    for words in (["score", str(folder)], ["video", str(folder), "-o", f"{folder}.mp4"]):
        assert main([*words, "--quiet"]) == 2
        told = capsys.readouterr().err
        assert re.search(f"its column est_theta2_rate_rad_s {CAN}", told)
    assert (folder / "metrics.json").read_bytes() == before


def test_no_law_is_blind_without_a_camera(runs: Path, tmp_path: Path) -> None:
    folder = shutil.copytree(runs / "all", tmp_path / "run")
    edit(folder, of(("est_valid",), lambda v: v * (np.arange(len(v)) < 20)))
    with pytest.raises(InputError, match=r"est_valid is 0 at 0\.66 s, and 1 in all runs without"):
        StoredRun.read(folder)


@pytest.mark.parametrize("channel", CHANNELS)
def test_what_laws_are_told_is_read_whatever_the_seed(channel: str) -> None:
    read(scenario_of("lab_circle", "plant.kind=analytic", *CHANNELS[channel]), nsim=20)


@pytest.mark.slow
@pytest.mark.parametrize("channel", ["exact", "all"])
@pytest.mark.parametrize("world", ["kind", "lab", "unkind"])
@pytest.mark.parametrize("plant", ["analytic", "contact"])
def test_what_laws_are_told_is_read_in_every_shipped_scenario(
    plant: str, world: str, channel: str
) -> None:
    for path in scenarios_folder().glob("*.toml"):
        if tt.load_scenario(path).sensing.kind == "camera":
            continue
        if (path.stem, plant) == ("outdoor_circle", "analytic"):
            continue  # its terrain is of contact physics
        words = (f"plant.kind={plant}", f"world={world}", *CHANNELS[channel])
        read(scenario_of(path.stem, *words), nsim=3)


def scenario_of(name: str, *overrides: str) -> tt.Scenario:
    return tt.load_scenario(name, ["duration_s=0.6", *overrides])


def read(scenario: tt.Scenario, nsim: int) -> None:
    rows = Experiment(scenario, scenarios_folder(), nsim).run().trajectory
    for i in range(nsim):
        one: Trajectory = rows.simulation(i)
        alive = int(np.isfinite(one.est_q).all(axis=(1, 2)).sum()) - 1
        assert not list(wrong_estimates(one.rows(0, alive), scenario, SAME))
