"""Many different scenarios in one batch: each the same bits as alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.controllers.base import Command
from ttwmr_mj.controllers.lyapunov import Lyapunov
from ttwmr_mj.errors import InputError
from ttwmr_mj.results.trajectory import Trajectory
from ttwmr_mj.runs import batch
from ttwmr_mj.runs.batch import batch_key, run_batch
from ttwmr_mj.runs.closed_loop import loop
from ttwmr_mj.runs.execute import run_scenario
from ttwmr_mj.runs.experiment import Experiment, Result
from ttwmr_mj.runs.metrics import metrics_of
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import AtRest, Scenario
from ttwmr_mj.sensing import Estimate

HERE = Path(__file__).parent
PERIOD_S = 0.033
SHORT = ["duration_s=0.5", "output.figures=false", "output.recording=false"]
ROBOT = {
    "robot.trailer.mass_kg": (0.25, 0.4),
    "robot.tractor.com_offset_m": (0.02, 0.035),
    "robot.tractor.wheel_radius_m": (0.0255, 0.0265),
    "robot.tractor.wheel_radius_difference_m": (1e-5, 1e-4),
    "robot.hitch.damping_n_m_s_rad": (1e-4, 2e-3),
    "robot.servo.speed_limit_rad_s": (5.0, 7.0),
    "robot.servo.acceleration_limit_rad_s2": (30.0, 60.0),
    "belief.robot.trailer.com_offset_m": (0.135, 0.147),
    "belief.robot.tractor.track_width_m": (0.117, 0.121),
}
CONTACT = {
    "plant.contact.floor_friction": (0.6, 1.0),
    "plant.contact.contact_time_constant_s": (0.001, 0.002),
}
CHANNELS: dict[str, tuple[float, float]] = {  # whole numbers: periods
    "sensing.position_noise_m": (1e-4, 1e-3),
    "sensing.rate_noise_rad_s": (1e-3, 1e-2),
    "sensing.latency_s": (1, 3),
    "sensing.latency_jitter_s": (1, 2),
    "sensing.drop_probability": (0.05, 0.3),
    "belief.latency_s": (0.01, 0.07),
}
START = {"initial.x_m": (0.5, 0.7), "initial.theta2_rad": (-1.0, 1.0)}
CIRCLE = {"reference.radius_m": (0.3, 0.5), "reference.angular_rate_rad_s": (0.1, 0.2)}
LYAPUNOV = {f"controller.alpha{i}": (8.0, 30.0) for i in (1, 2, 3, 4)}
LATE = ["control.command_latency_s=0.01", "control.command_jitter_s=0.033"]
PUSHED = [
    "plant.pushes=[{on='trailer', start_s=0.1, duration_s=0.2, force_n=[0.5, 0.1], "
    "random_within_s=0.1, random_direction=true}]"
]
# name → scenario, overrides, what is drawn beside the robot
CASES: dict[str, tuple[str, list[str], dict[str, tuple[float, float]]]] = {
    "lyapunov": ("lab_circle", [], CONTACT | START | CIRCLE | LYAPUNOV),
    "lyapunov late and pushed": ("lab_circle", LATE + PUSHED, CHANNELS | LYAPUNOV),
    "regularized": (
        "lab_circle",
        ["controller.singular_terms='regularized'"],
        LYAPUNOV | {"controller.regularization_m_s": (0.01, 0.1)},
    ),
    "lyapunov_pid": (
        "lab_circle",
        [
            "controller={kind='lyapunov_pid', gamma='regularized', anti_windup='conditional'}",
            "reference.theta2='outward'",
        ],
        LYAPUNOV
        | {"controller.k_p": (40.0, 50.0), "controller.gamma_limit": (1.0, 5.0)}
        | {"controller.gamma_regularization_m_s2": (0.05, 0.2)},
    ),
    "spring_damper": (
        "lab_circle",
        ["controller={kind='lyapunov_pid', correction='spring_damper', gamma='exact'}"],
        {"controller.k_t": (100.0, 200.0), "controller.c_t": (100.0, 200.0)},
    ),
    "feedforward": ("lab_circle", ["controller={kind='feedforward'}"], CIRCLE | CONTACT),
    "pure_pursuit": (
        "lab_circle",
        ["controller={kind='pure_pursuit'}"],
        CIRCLE | {"controller.preview_s": (0.2, 0.8), "controller.gain_1_s": (0.5, 2.0)},
    ),
    "open_loop": (
        "open_loop_turn",
        [],
        {"controller.segments.0.duration_s": (0.1, 0.3)}
        | {"controller.segments.0.wheel_left_rad_s": (1.0, 9.0)},
    ),
    "motor": ("lab_circle_motor", [], LYAPUNOV | {"robot.servo.motor.resistance_ohm": (7.5, 8.5)}),
    "sloping, with wet spots": (
        "lab_circle",
        ["ground.regions=[{shape='disc', friction=0.2, x_m=0.6, y_m=-0.3, radius_m=0.1}]"],
        {"ground.slope_rad": (0.01, 0.02), "ground.regions.0.radius_m": (0.01, 0.1)} | CONTACT,
    ),
    "flatness": ("inverted_trailer", ["controller.recovery='own'"], CHANNELS),
    "torque": ("inverted_trailer_torque", ["controller.recovery='own'"], {}),
    "computed torque": ("lab_circle", ["control.inner_loop='computed_torque'"], LYAPUNOV),
    "analytic": (
        "lab_circle",
        ["plant.kind='analytic'"],
        LYAPUNOV
        | CHANNELS
        | START
        | {"robot.hitch.coulomb_friction_n_m": (1e-5, 1e-3), "ground.slope_rad": (0.01, 0.02)}
        | {"robot.casters.rolling_resistance_m": (1e-5, 1e-4)},
    ),
    "analytic, sprung": (
        "lab_circle",
        ["plant.kind='analytic'", "plant.analytic.published_spring=true"],
        {"robot.hitch.stiffness_n_m_rad": (0.01, 0.1), "robot.trailer.com_lateral_m": (1e-3, 5e-3)},
    ),
    "extended": (
        "lab_circle",
        [
            "plant.kind='analytic'",
            "plant.analytic.extended={wheel_radius_m=0.026, track_width_m=0.119, "
            "servo_time_constant_s=2e-5, slip_time_s=7e-4, hitch_coulomb_friction_n_m=1e-4, "
            "caster_mass_kg=1e-3, rolling_resistance_m=1e-5}",
        ],
        {"plant.analytic.extended.slip_time_s": (5e-4, 8e-4), "ground.slope_rad": (0.01, 0.02)}
        | {"plant.analytic.extended.wheel_radius_m": (0.0255, 0.0265)}
        | {"plant.analytic.extended.hitch_coulomb_friction_n_m": (1e-5, 1e-3)}
        | {"robot.casters.trailer_half_spacing_m": (0.04, 0.06)},
    ),
    "kinetic": (
        "inverted_trailer_torque",
        ["plant.kind='analytic'", "controller.recovery='own'"],
        {"robot.hitch.coulomb_friction_n_m": (1e-5, 1e-4)},
    ),
}


def drawn(case: str, count: int, seed: int = 0) -> list[Scenario]:
    """Scenarios of a case that differ in every number."""
    name, changes, numbers = CASES[case]
    rng = np.random.default_rng(seed)
    ranges = ROBOT | numbers

    def value(low: float, high: float) -> float:
        if isinstance(low, int):
            return float(PERIOD_S * rng.integers(low, high, endpoint=True))
        return float(rng.uniform(low, high))

    return [
        load_scenario(
            name,
            [*SHORT, *changes, f"seed={i}"]
            + [f"{key}={value(*limits)!r}" for key, limits in ranges.items()],
        )
        for i in range(count)
    ]


def assert_same(got: Result, alone: Result) -> None:
    assert got.outcomes[0].status == alone.outcomes[0].status
    assert got.outcomes[0].reason == alone.outcomes[0].reason
    assert_same_rows(got.trajectory, alone.trajectory)
    assert got.verdicts == alone.verdicts
    ours, theirs = (metrics_of(r, r.scenario, 1.0) for r in (got, alone))
    timed = {"control_time_per_sample_us", "control_overruns", "control_slowest_s"}
    assert {k: v for k, v in ours.items() if k not in timed} == {
        k: v for k, v in theirs.items() if k not in timed
    }


def assert_same_rows(got: Trajectory, alone: Trajectory) -> None:
    ours, theirs = got.to_columns(), alone.to_columns()
    assert list(ours) == list(theirs)
    for name, values in ours.items():
        assert values.tobytes() == theirs[name].tobytes(), name


@pytest.mark.parametrize("case", CASES)
def test_a_row_is_the_same_bits_as_alone(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenarios = drawn(case, 3)
    assert len(set(map(batch_key, scenarios))) == 1
    with monkeypatch.context() as patch:
        patch.setattr(batch, "Experiment", None)  # none has to be run again alone
        together = run_batch(scenarios)
    for scenario, result in zip(scenarios, together, strict=True):
        assert result.scenario is scenario
        assert_same(result, Experiment(scenario).run())
    first, second = (r.trajectory.q for r in together[:2])
    assert not np.array_equal(first, second)  # what is drawn does something


def test_whatever_the_batch_the_place_in_it_and_the_threads() -> None:
    scenarios = drawn("lyapunov late and pushed", 5)
    one = run_batch(scenarios[2:3])[0]
    for among, place, threads in (
        (scenarios, 2, 1),
        (scenarios[::-1], 2, 2),
        (scenarios[1:3], 1, 3),
    ):
        assert_same(run_batch(among, nthread=threads)[place], one)


def test_it_is_what_ttwmr_run_writes(tmp_path: Path) -> None:
    scenarios = drawn("lyapunov late and pushed", 2)
    result = run_batch(scenarios)[1]
    run_scenario(scenarios[1], tmp_path)
    assert_same_rows(result.trajectory, Trajectory.read(tmp_path / "trajectory.parquet"))


def test_scenarios_that_cannot_share_a_batch_run_in_several() -> None:
    rows = [drawn(case, 1)[0] for case in ("lyapunov", "feedforward", "analytic")]
    rows.append(load_scenario("lab_circle", SHORT))  # its hitch has no damping
    assert len(set(map(batch_key, rows))) == 4
    for scenario, result in zip(rows, run_batch(rows), strict=True):
        assert_same(result, Experiment(scenario).run())


@pytest.mark.parametrize(
    "change",
    [
        "duration_s=0.6",
        "control.sampling_time_s=0.022",
        "plant.contact.timestep_s=0.00025",
        "robot.hitch.coulomb_friction_n_m=1e-4",
        "controller.singular_terms='published'",
        "belief.latency_s=0.0",
    ],
)
def test_what_makes_another_batch(change: str) -> None:
    plain = load_scenario("lab_circle", SHORT)
    assert batch_key(plain) != batch_key(load_scenario("lab_circle", [*SHORT, change]))


def test_pushes_on_different_bodies_make_another_batch() -> None:
    push = "plant.pushes=[{{start_s=0.1,duration_s=0.1,force_n=[0.1,0.0],{on}}}]"
    on = ("on='tractor'", "trailer=1", "trailer=2")
    rows = [load_scenario("double_inverted", [push.format(on=one)]) for one in on]
    assert len(set(map(batch_key, rows))) == 3


def test_who_ends_early_does_not_harm_the_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loop, "ESCAPE", 2.0)  # rad, of θ2
    scenarios = [
        row.model_copy(update={"initial": AtRest(theta2_rad=angle)})
        for row, angle in zip(
            drawn("lyapunov late and pushed", 4), (0.0, 2.1, 1.999, 0.5), strict=True
        )
    ]
    results = run_batch(scenarios)
    for scenario, result in zip(scenarios, results, strict=True):
        assert_same(result, Experiment(scenario).run())
    assert [r.outcomes[0].status for r in results] == ["ok", "diverged", "diverged", "ok"]
    assert len(results[1].trajectory) == 1 < len(results[2].trajectory) < 16


@pytest.mark.parametrize("breaks", ["raises", "is not finite"])
def test_who_breaks_a_law_does_not_break_it_for_the_others(
    monkeypatch: pytest.MonkeyPatch, breaks: str
) -> None:
    """A law breaks where θ2 is large: for all of its batch, or for one of them."""
    sound = Lyapunov.command

    def command(self: Lyapunov, k: int, estimate: Estimate) -> Command:
        large = estimate.state.q[:, 3] > 1.5
        if large.any() and breaks == "raises":
            raise ArithmeticError("too large")
        wheels = sound(self, k, estimate)
        wheels.wheel_speed_rad_s[large] = np.nan
        return wheels

    monkeypatch.setattr(Lyapunov, "command", command)
    scenarios = [
        row.model_copy(update={"initial": AtRest(theta2_rad=angle)})
        for row, angle in zip(drawn("lyapunov", 3), (0.0, 1.6, 0.5), strict=True)
    ]
    results = run_batch(scenarios)
    for scenario, result in zip(scenarios, results, strict=True):
        assert_same(result, Experiment(scenario).run())
    assert [r.outcomes[0].status for r in results] == ["ok", "failed", "ok"]


def test_a_law_that_never_returns_ends_its_own_row_only() -> None:
    changes = [*SHORT, "control.controller_time_limit_s=0.2"]
    endless = [*changes, "controller={kind='custom', target='misbehaving:Endless'}"]
    rows = [load_scenario("lab_circle", of) for of in (changes, endless, endless)]
    assert len(set(map(batch_key, rows))) == 3
    assert [r.outcomes[0].status for r in run_batch(rows, HERE)] == ["ok", "failed", "failed"]


def test_an_interrupted_batch_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def command(*_: object) -> Command:
        raise KeyboardInterrupt

    monkeypatch.setattr(Lyapunov, "command", command)
    with pytest.raises(KeyboardInterrupt):
        run_batch(drawn("lyapunov", 2))


def test_an_impossible_row_is_refused() -> None:
    rows = [load_scenario("lab_circle", SHORT) for _ in range(2)]
    steering = load_scenario("inverted_trailer").controller  # not for this circle
    rows[1] = rows[1].model_copy(update={"controller": steering})
    with pytest.raises(InputError, match="centre of oscillation"):
        run_batch(rows)


def test_the_example_in_the_docs_runs(capsys: pytest.CaptureFixture[str]) -> None:
    page = (HERE.parent / "docs" / "howto" / "throughput.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", page, flags=re.M | re.S)
    exec(code, {})  # ours
    assert len(capsys.readouterr().out.splitlines()) == 6
