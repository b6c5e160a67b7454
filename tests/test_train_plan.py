"""Plans for several trailers: the symbolic model, the command, and driving what is shipped."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from driven import shares_driven
from trains import motley, train

import ttwmr_mj as tt
from ttwmr_mj.cli.main import main
from ttwmr_mj.dynamics.hitch import spring_damper_torque
from ttwmr_mj.dynamics.train import on_trailers, trailer_accelerations
from ttwmr_mj.references.planned import Knots
from ttwmr_mj.results.curves import centre_of_oscillation
from ttwmr_mj.robot import Hitch, RobotParameters, Trailer
from ttwmr_mj.runs.judgement.foresight import foretold

pytest.importorskip("casadi")
import casadi as ca

from ttwmr_mj.planning.limits import limits_of
from ttwmr_mj.planning.request import Request
from ttwmr_mj.planning.through_points import plan_through
from ttwmr_mj.planning.transcription import (
    A1,
    THETA1,
    U1,
    U2,
    hitch_angles,
    last_centre,
    rate_of,
    state_count,
    trailer_rows,
)

RING_M = [[0.4, 0.0], [0.25, 0.35], [-0.25, 0.3], [-0.4, 0.0], [-0.2, -0.35], [0.25, -0.3]]
RNG = np.random.default_rng(5)


@pytest.mark.parametrize("robot", [train(1), train(2, damping_n_m_s_rad=1e-3), motley()])
def test_the_symbolic_trailers_swing_as_the_equations_say(robot: RobotParameters) -> None:
    symbols, jerk = ca.SX.sym("x", state_count(robot)), ca.SX.sym("j", 2)
    rate = ca.Function("rate", [symbols, jerk], [rate_of(symbols, jerk, robot)])
    state = RNG.uniform(-1.0, 1.0, state_count(robot))
    change = np.array(rate(state, [0.3, -0.2]))[:, 0]
    angles, rates = np.array(trailer_rows(robot)).T
    heading, u1, u2 = state[[THETA1, U1, U2]]
    ahead = np.array([np.cos(heading), np.sin(heading)])
    v = state[A1] * ahead + u1 * u2 * np.array([-ahead[1], ahead[0]])
    hitch = np.diff(state[[THETA1, *angles]])
    slide = np.diff([u2, *state[rates]])
    torque = np.array([
        spring_damper_torque(*pair, of)
        for *pair, of in zip(hitch, slide, robot.hitches, strict=True)
    ])  # fmt: skip
    swing = trailer_accelerations(state[angles], state[rates], v, robot, on_trailers(torque))
    assert change[rates] == pytest.approx(swing, rel=1e-9)
    assert change[angles] == pytest.approx(state[rates], rel=1e-12)
    assert change[:2] == pytest.approx(u1 * ahead, rel=1e-12)
    for angle, expected in zip(hitch_angles(state[:, None], robot), hitch, strict=True):
        assert angle == pytest.approx(expected)
    if not any(trailer.com_lateral_m for trailer in robot.trailers):
        q = state[[0, 1, THETA1, *angles]]
        centre = np.array(ca.DM(last_centre(ca.DM(state), robot)))[:, 0]
        assert centre == pytest.approx(centre_of_oscillation(q, robot), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["double_rest_to_rest", "double_u_turn"])
def test_two_trailers_are_parked_where_they_should_be(name: str) -> None:
    scenario = tt.load_scenario(name)
    result = tt.simulate(scenario)
    assert result.verdicts[0].name == "followed"
    off = np.abs(result.trajectory.q - result.trajectory.ref_q)[-1, 0]
    assert np.hypot(*off[:2]) < 5e-3  # measured 0.7 mm
    assert off[2:].max() < np.radians(2.0)  # measured 0.3°
    error = tt.score(result.trajectory, scenario.robot)[0]["centre_of_oscillation_rmse_m"]
    assert error is not None
    assert error < 5e-3  # measured 0.5 mm


@pytest.mark.slow
def test_two_trailers_are_driven_round_the_eight() -> None:
    scenario = tt.load_scenario("double_eight", ["duration_s=20.0"])
    result = tt.simulate(scenario)
    assert result.verdicts[0].name == "followed"
    error = tt.score(result.trajectory, scenario.robot)[0]["steady_centre_of_oscillation_rmse_m"]
    assert error is not None
    assert error < 5e-3


@pytest.mark.slow
def test_the_command_plans_for_two_trailers(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("-0.5,-0.1\n0.5,0.1\n")
    words = ["--scenario", "two_trailers_turn", "--workspace", "2.4", "1.8", "--quiet"]
    out = tmp_path / "way_plan.csv"
    assert main(["plan", str(tmp_path / "way.csv"), *words, "--out", str(out)]) == 0
    assert Knots.read(str(out)).q.shape[1] == 5
    scenario = tt.load_scenario(str(out.with_suffix(".toml")), ["plant.kind=analytic"])
    assert scenario.controller.kind == "tvlqr"
    assert foretold(scenario) == []  # between its rows, too, the hitches are asked for nothing
    assert tt.simulate(scenario).verdicts[0].name == "followed"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "hitch_angle_deg"),
    [
        (Request(np.array([[-0.5, -0.3], [0.0, -0.1], [0.4, 0.2], [0.5, 0.45]])), 80.0),
        (Request(np.array(RING_M), closed=True), 100.0),
    ],
    ids=["open", "closed"],
)
def test_what_is_told_of_a_trains_limits_is_what_driving_uses(
    way: Request, hitch_angle_deg: float, tmp_path: Path
) -> None:
    """Kept at knots only, the wheels' acceleration on the open way bulged by a tenth."""
    trailers = (
        Trailer(mass_kg=0.4, com_offset_m=0.12, next_hitch_offset_m=0.2),
        Trailer(com_offset_m=0.15),
    )
    hitches = (Hitch(damping_n_m_s_rad=2e-3, stiffness_n_m_rad=0.01), Hitch(damping_n_m_s_rad=1e-3))
    fast = tt.load_scenario("outer_circle").robot.servo
    robot = RobotParameters(trailers=trailers, hitches=hitches, servo=fast)
    wish = {"workspace_m": (2.4, 1.8), "hitch_angle_rad": np.radians(hitch_angle_deg)}
    limits = limits_of(robot, 0.9, **wish)
    found = plan_through(way, robot, limits)
    driven = shares_driven(found, robot, limits, tmp_path)
    assert found.used == pytest.approx(driven, abs=5e-4)  # told in tenths of a percent
    assert max(driven.values()) < 1.005  # of a spline that rounds the corners of a jerk
