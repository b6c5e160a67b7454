"""`ttwmr plan`: from points to a motion of tractor and trailer."""

from __future__ import annotations

import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from driven import shares_driven

import ttwmr_mj as tt
from ttwmr_mj.errors import InputError, RunError
from ttwmr_mj.planning.points import MOST_POINTS, read_points
from ttwmr_mj.references.planned import Planned
from ttwmr_mj.references.shared.feasibility import check_feasibility
from ttwmr_mj.robot import Hitch, RobotParameters

pytest.importorskip("casadi")
from ttwmr_mj.planning.deliver import what_limits
from ttwmr_mj.planning.limits import limits_of
from ttwmr_mj.planning.request import Request
from ttwmr_mj.planning.through_points import Found, plan_through

SPRUNG = RobotParameters(hitch=Hitch(stiffness_n_m_rad=5e-4, damping_n_m_s_rad=1e-3))
BEND = np.array([[-0.4, -0.1], [0.0, 0.1], [0.4, -0.1]])
SERVO = SPRUNG.servo.model_copy(update={"acceleration_limit_rad_s2": 1.0})
SLOW = SPRUNG.model_copy(update={"servo": SERVO})
ROUND = Request(np.array([[0.4, 0.0], [0.0, 0.15], [-0.4, 0.0], [0.0, -0.1]]), closed=True)


def ttwmr(*words: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ttwmr_mj", *words]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def bend() -> Found:
    return plan_through(Request(BEND), SPRUNG, limits_of(SPRUNG, 0.9))


@pytest.fixture(scope="module")
def slow_bend() -> Found:
    return plan_through(Request(BEND), SLOW, limits_of(SLOW, 0.9))


@pytest.fixture(scope="module")
def slow_round() -> Found:
    return plan_through(ROUND, SLOW, limits_of(SLOW, 0.9))


def test_p_passes_through_every_point_from_rest_to_rest(bend: Found) -> None:
    state, knots = bend.plan.state, np.searchsorted(bend.plan.time_s, bend.points_s - 1e-9)
    assert state[knots, :2] == pytest.approx(BEND, abs=1e-7)
    for end in (0, -1):
        assert state[end, 2] == pytest.approx(state[end, 3], abs=1e-7)
        assert state[end, 4:] == pytest.approx(0.0, abs=1e-7)


def test_spring_and_damper_are_in_the_plan(tmp_path: Path, bend: Found) -> None:
    """What the checker finds of it, which is another derivation of the same model."""
    from ttwmr_mj.planning.knots import write_knots

    write_knots(tmp_path / "bend.csv", bend.plan, SPRUNG, "a test")
    time_s = np.arange(0.0, bend.plan.time_s[-1], 0.01)
    path = Planned(plan=str(tmp_path / "bend.csv")).sample(time_s, SPRUNG)
    limits = limits_of(SPRUNG, 0.9)
    checked = check_feasibility(path, SPRUNG, workspace_m=limits.workspace_m)
    assert checked.feasible, str(checked)
    # spring and damper alone give a hundred times the checker's tolerance
    assert not check_feasibility(path, RobotParameters())["free trailer"].kept


@pytest.mark.parametrize(
    ("name", "robot"), [("bend", SPRUNG), ("slow_bend", SLOW), ("slow_round", SLOW)]
)
def test_what_is_told_of_limits_is_what_driving_uses(
    name: str, robot: RobotParameters, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    """Between knots as well: kept at knots only, wheels' accelerations bulge, here by 1.8 %."""
    found, limits = request.getfixturevalue(name), limits_of(robot, 0.9)
    driven = shares_driven(found, robot, limits, tmp_path)
    assert found.used == pytest.approx(driven, abs=5e-4)  # told in tenths of a percent
    assert max(driven.values()) < 1.005  # of a spline that rounds the corners of a jerk
    lines = {line[:21].strip(): line[21:28].strip() for line in what_limits(found, limits)}
    assert lines == {group: f"{100 * share:.1f}" for group, share in found.used.items()}


def test_a_plan_that_exceeds_a_limit_between_knots_is_refused() -> None:
    """Which others than the wheels' may, in an extreme."""
    fast = tt.load_scenario("outer_circle").robot
    limits = replace(limits_of(fast, 0.9), trailer_rate_rad_s=0.8)
    with pytest.raises(RunError, match=r"turn rate: 0.81\d* rad/s, more than the 0.8 .*--duration"):
        plan_through(Request(BEND), fast, limits)


def test_more_time_where_none_was_asked_for_and_the_limits_ask(slow_bend: Found) -> None:
    mean = 0.6 * 0.8 * SLOW.servo.speed_limit_rad_s * SLOW.tractor.wheel_radius_m
    assert slow_bend.plan.time_s[-1] > 1.05 * Request(BEND).legs_m.sum() / mean


@pytest.mark.slow
def test_a_plan_that_cannot_be_says_which_limit_to_relax() -> None:
    limits = limits_of(SPRUNG, 0.9)
    with pytest.raises(RunError, match=r"wheel speed: .* --duration (\d+\.?\d*)") as caught:
        plan_through(Request(BEND, duration_s=4.0), SPRUNG, limits)
    assert "between points" in str(caught.value)
    advised = float(str(caught.value).split("--duration ")[1].split(",")[0])
    assert plan_through(Request(BEND, duration_s=advised), SPRUNG, limits).plan.time_s[-1] == (
        pytest.approx(advised)
    )
    small = limits_of(SPRUNG, 0.9, workspace_m=(0.9, 0.25))
    with pytest.raises(RunError, match=r"workspace: .* a larger --workspace"):
        plan_through(Request(BEND), SPRUNG, small)


def test_a_larger_robot_needs_more_room_for_the_same_points() -> None:
    across, outdoor = (
        Request(np.array([[0.6, 0.0], [-0.6, 0.0]])),
        RobotParameters(preset="outdoor"),
    )
    # its last label is 0.213 m · 60/26 behind P
    with pytest.raises(RunError, match=r"workspace: 1\.09 m from its centre, more than the 0\.9"):
        plan_through(across, outdoor, limits_of(outdoor, 0.9))
    room = limits_of(outdoor, 0.9, workspace_m=(2.4, 1.3))
    used = plan_through(across, outdoor, room).used["workspace"]
    assert used == pytest.approx((0.6 + 0.213 * 60 / 26) / 1.2, rel=1e-3)


def test_points_that_are_none() -> None:
    limits = limits_of(SPRUNG, 0.9)
    with pytest.raises(InputError, match="at least 3 of them"):
        plan_through(Request(BEND[:2], closed=True), SPRUNG, limits)
    with pytest.raises(InputError, match=r"points.2: is where the next one is"):
        plan_through(Request(BEND[[0, 1, 1, 2]]), SPRUNG, limits)


def test_points_that_are_too_far_or_too_many() -> None:
    """Refused before anything is laid out: it would take all memory."""
    far = Request(np.array([[0.0, 0.0], [1e6, 0.0], [2e6, 1e5]]))
    told = r"points.2: got \(1e\+06, 0\) m, and 1 more .* 1.8 × 1.3 m .* --workspace"
    with pytest.raises(InputError, match=told):
        plan_through(far, SPRUNG, limits_of(SPRUNG, 0.9))
    with pytest.raises(InputError, match=r"points: 3 of them .* at most 2,000; .* in parts"):
        plan_through(far, SPRUNG, limits_of(SPRUNG, 0.9, workspace_m=(1e7, 1e7)))


def test_a_search_that_takes_too_long_ends() -> None:
    with pytest.raises(RunError, match=r"within 0.01 s of computing; try fewer points"):
        plan_through(Request(BEND), SPRUNG, limits_of(SPRUNG, 0.9), most_s=0.01)


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM])
def test_the_solver_does_not_swallow_ctrl_c(
    signum: signal.Signals, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(iteration: int) -> None:
        if iteration == 3:
            signal.raise_signal(signum)

    before = signal.getsignal(signum)
    with pytest.raises(KeyboardInterrupt):
        plan_through(Request(BEND), SPRUNG, limits_of(SPRUNG, 0.9), progress=stop)
    assert signal.getsignal(signum) == before
    assert capsys.readouterr().err == ""  # CasADi's own comment on it


@pytest.mark.filterwarnings("error")
def test_a_table_with_names_or_without(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    path.write_text("# a way\nname, y_m, x_m\na, 0.2, 0.1\nb, 0.4, 0.3\n")
    assert read_points(path).points_m.tolist() == [[0.1, 0.2], [0.3, 0.4]]
    path.write_text("0, 0\n1, 0\n1, 1\n0, 0\n")
    closed = read_points(path)
    assert (closed.points_m.tolist(), closed.closed) == ([[0, 0], [1, 0], [1, 1]], True)
    for text, problem in (
        ("a,b\n1,2\n", "there must be x_m and y_m"),
        ("1,2\n3\n", "a line is not two numbers, x and y, but 3"),
        ("", "no points can be read: there are none"),
        ("0,0\nnan,1\n", "not every number is finite"),
        ("0,0,0\n1,1,1\n", "3 columns without names; name two of them x_m and y_m"),
        ("x_m,y_m,x_m\n1,2,3\n", "several columns x_m"),
        ("0,0\n1e308,1\n-1e308,1\n", "farther than 1,000 m"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=problem):
            read_points(path)


@pytest.mark.filterwarnings("error")
def test_files_without_an_end_or_with_endless_cells(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="larger than 16,000,000 bytes"):
        read_points(Path("/dev/zero"))
    path = tmp_path / "way.csv"
    for cell in ("1" * 130_000 + "x", "1" * 200_000):
        path.write_text(f"{cell},0\n")
        with pytest.raises(InputError, match="no points can be read"):
            read_points(path)


@pytest.mark.filterwarnings("error")
def test_a_drawing(tmp_path: Path) -> None:
    path = tmp_path / "way.svg"
    unmoved = 'transform="translate(0) matrix(1,0,0,1,0,0)" style="text-transform:none"'
    lines = {
        '<polyline points="0,0 100,0 100,50"/>': ([[-50, 25], [50, 25], [50, -25]], False),
        '<polygon points="0,0 100,0 100,50"/>': ([[-50, 25], [50, 25], [50, -25]], True),
        '<path d="M 0 0 h 100 V 50 z"/>': ([[-50, 25], [50, 25], [50, -25]], True),
        '<path d="m 0,0 100,0 0,50"/>': ([[-50, 25], [50, 25], [50, -25]], False),
        '<path d="M 0 0 H 1e2 v 5e+1"/>': ([[-50, 25], [50, 25], [50, -25]], False),
        f'<g {unmoved}><path d="M 0 0 H 100 V 50"/></g>': ([[-50, 25], [50, 25], [50, -25]], False),
    }
    for line, (corners, closed) in lines.items():
        path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg"><g>{line}</g></svg>')
        got = read_points(path, 0.01)
        assert got.points_m == pytest.approx(0.01 * np.array(corners)), line
        assert got.closed is closed
    for line, problem in (
        ('<path d="M 0 0 C 1 1 2 2 3 3"/>', "has curves"),
        ('<polyline transform="scale(2)" points="0,0 1,1"/>', "polyline has .* flatten it"),
        (
            '<g transform="scale(2)"><g><path d="M 0 0 H 1"/></g></g>',
            "path is in a g that has .* flatten it",
        ),
        (
            '<g style="transform: scale(2)"><path d="M 0 0 H 1"/></g>',
            "path is in a g that has .* flatten it",
        ),
        (
            '<g transform="nonsense"><path d="M 0 0 H 1"/></g>',
            "path is in a g that has .* flatten it",
        ),
        ('<path d="M"/>', "no two corners"),
        ('<polyline points="0,0 1e308,0 -1e308,1e999"/>', "farther than 1,000 m"),
        ("<rect/>", "no polyline"),
        ('<polyline points="0cm,0cm 30cm,0cm"/>', "polyline has 'cm' where numbers should be"),
        ('<path d="M0-0L3e2-100.5.5"/>', "path has 3 numbers after L, no pairs"),
        ('<path d="M 0 0 L 1 1 M 5 5 L 6 6"/>', "several pieces"),
        ('<path d="M 0 0 L 1 1 z L 6 6"/>', "several pieces"),
        ('<path d="0 0 L 1 1"/>', "begins with '0 0', and must with M or m"),
    ):
        path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{line}</svg>')
        with pytest.raises(InputError, match=problem):
            read_points(path)
    many = " ".join(f"{100 * np.cos(a)},{100 * np.sin(a)}" for a in np.linspace(0.0, 6.0, 500))
    path.write_text(f'<svg><polyline points="{many}"/></svg>')
    thinned = read_points(path)
    assert (len(thinned.points_m), thinned.given) == (MOST_POINTS, 500)
    apart = np.hypot(*np.diff(thinned.points_m, axis=0).T)
    assert apart == pytest.approx(apart.mean(), rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("sensing.kind=camera",)], ids=["truth", "camera"])
def test_the_shipped_course_is_followed(more: tuple[str, ...]) -> None:
    """5 mm asked; 0.1 by truth and 0.5 by camera found."""
    scenario = tt.load_scenario("waypoints", ["duration_s=40.0", *more])
    result = tt.simulate(scenario)
    (metrics,), (verdict,) = tt.score(result.trajectory, scenario.robot), result.verdicts
    assert verdict.name == "followed"
    for name in ("tractor", "trailer", "centre_of_oscillation"):
        assert metrics[f"steady_{name}_rmse_m"] < 2e-3, name
