"""The rules of the verdict: both sides of every limit, on trajectories made up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ttwmr_mj as tt
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.shared.demand import Demand, Feasibility
from ttwmr_mj.references.shared.feasibility import check_feasibility
from ttwmr_mj.results.accept import END_SHARE, GROWTH, AcceptOptions
from ttwmr_mj.results.verdict import VERDICTS
from ttwmr_mj.robot import RobotParameters, Servo

ROBOT = RobotParameters()
LENGTH = ROBOT.trailer.com_offset_m
TIME_S = np.linspace(0.0, 10.0, 101)
LIMITS = AcceptOptions()
# limits of P, COM and θ2 apart from each other, so that each can be exceeded alone
WIDE: dict[str, Any] = {"end_trailer_m": 9.0, "transient_trailer_m": 9.0}
HAIR = 1e-9


def still(theta2: float | None = 0.0) -> tt.Trajectory:
    """Standing on its reference; θ2 undefined with None."""
    rows = tt.Trajectory.empty(TIME_S, nsim=1)
    rows.q[:], rows.ref_q[:], rows.est_q[:] = 0.0, 0.0, 0.0
    rows.ref_q[..., 3] = np.nan if theta2 is None else theta2
    return rows


def demanding(rate_rad_s: float) -> Feasibility:
    """An outer circle at a rate; its wheels turn at 19.3 rad/s per rad/s, of 40."""
    robot = RobotParameters(servo=Servo(preset="fast"))
    circle = FlatCircle(radius_m=0.6, angular_rate_rad_s=rate_rad_s)
    return check_feasibility(circle.sample(TIME_S, robot), robot)


def verdict(rows: tt.Trajectory, demands: Feasibility | None = None, **accept: Any) -> tt.Verdict:
    return tt.judge(rows, ROBOT, accept=AcceptOptions(**accept), demands=demands)


def test_a_run_on_its_reference_followed() -> None:
    found = verdict(still())
    assert (found.name, found.number) == ("followed", 0.0)


@pytest.mark.parametrize(
    ("column", "key", "lost"),
    [(0, "tractor_m", "lost"), (3, "theta2_rad", "tractor_follows_trailer_lost")],
)
@pytest.mark.parametrize("late", [True, False])
def test_at_the_end_each_stays_within_its_limit(
    column: int, key: str, lost: str, late: bool
) -> None:
    limit = getattr(LIMITS, f"end_{key}")
    rows = still()
    begin = np.searchsorted(TIME_S, (1.0 - END_SHARE) * 10.0)
    rows.q[begin if late else begin - 1, 0, column] = -limit * (1.0 - HAIR)
    assert verdict(rows, **WIDE).name == "followed"
    stricter = {**WIDE, f"transient_{key}": 0.5 * limit}  # which is for what comes before
    assert verdict(rows, **stricter).name == ("followed" if late else lost)
    rows.q[begin if late else begin - 1, 0, column] = -limit * (1.0 + HAIR)
    found = verdict(rows, **WIDE)
    assert found.name == (lost if late else "followed")
    if late:
        assert (found.number, found.limit) == (pytest.approx(limit), limit)


def test_the_trailers_com_has_its_own_limit() -> None:
    """At 2·l·sin(Δθ2/2) from its reference, P in place."""
    for factor, name in ((0.999, "followed"), (1.001, "tractor_follows_trailer_lost")):
        rows = still()
        rows.q[-1, 0, 3] = 2.0 * np.arcsin(factor * LIMITS.end_trailer_m / (2.0 * LENGTH))
        found = verdict(rows, end_theta2_rad=1.0)
        assert found.name == name
    assert found.number == pytest.approx(1.001 * LIMITS.end_trailer_m)
    assert "the trailer's COM 50.1 mm off in the last fifth of the run (limit 50 mm)" in str(found)


@pytest.mark.parametrize(
    ("column", "key", "lost"),
    [(1, "tractor_m", "lost"), (3, "theta2_rad", "tractor_follows_trailer_lost")],
)
def test_who_was_lost_for_a_while_did_not_follow(column: int, key: str, lost: str) -> None:
    limit = getattr(LIMITS, f"transient_{key}")
    rows = still()
    rows.q[30, 0, column] = limit * (1.0 - HAIR)
    assert verdict(rows, **WIDE).name == "followed"
    rows.q[30, 0, column] = limit * (1.0 + HAIR)
    found = verdict(rows, **WIDE)
    assert found.name == lost
    assert (found.number, found.limit) == (pytest.approx(limit), limit)
    assert " off at 3 s (limit " in found.what


@pytest.mark.parametrize("k", [1, 10, 49, 50, 60])
def test_the_starts_offset_is_worked_off_evenly(k: int) -> None:
    """From GROWTH times itself to the lasting limit, at half of the time."""
    lasting, start = LIMITS.transient_tractor_m, 2.0
    allowed = GROWTH * start + (lasting - GROWTH * start) * min(k / 50, 1.0)
    for factor, name in ((1.0 - HAIR, "followed"), (1.0 + HAIR, "lost")):
        rows = still()
        rows.q[0, 0, 0] = start
        rows.q[k, 0, 0] = factor * allowed
        assert verdict(rows, **WIDE).name == name


def test_how_long_a_start_may_take_is_said() -> None:
    rows = still()
    rows.q[:15, 0, 0] = 2.0
    assert verdict(rows).name == "followed"
    assert verdict(rows, settling_share=0.1).name == "lost"


def test_a_small_offset_of_the_start_takes_nothing_from_the_lasting_limit() -> None:
    rows = still()
    rows.q[0, 0, 0] = 0.01
    rows.q[1, 0, 0] = 0.9 * LIMITS.transient_tractor_m
    assert verdict(rows).name == "followed"


def test_a_trailer_that_has_spun_round_points_where_it_should() -> None:
    rows = still()
    rows.q[..., 3] = 2.0 * np.pi
    assert verdict(rows).name == "followed"


def test_the_tractor_comes_first_and_the_end_before_a_while() -> None:
    rows = still()
    rows.q[30, 0, 0] = 3.0  # 8.6 times what is allowed
    rows.q[-1, 0, 0] = 0.06  # 1.2 times
    rows.q[-1, 0, 3] = 1.35  # 6.75 times
    assert str(verdict(rows)) == "lost: P 60 mm off in the last fifth of the run (limit 50 mm)"
    rows.q[:, 0, 0] = 0.0
    assert str(verdict(rows)) == (
        "tractor follows, trailer lost: θ2 1.35 rad off in the last fifth of the run "
        "(limit 0.2 rad)"
    )


def test_of_what_was_followed_the_nearest_to_its_limit_is_told() -> None:
    rows = still()
    rows.q[90, 0, 0], rows.q[95, 0, 3] = 0.004, -0.1
    found = verdict(rows)
    assert (found.number, found.limit) == (pytest.approx(0.1), 0.2)
    assert str(found) == (
        "followed: at most θ2 0.1 rad off in the last fifth of the run (limit 0.2 rad)"
    )


def test_without_theta2_in_the_reference_p_alone_is_judged_and_that_is_said() -> None:
    rows = still(theta2=None)
    rows.q[..., 3] = 3.0
    assert str(verdict(rows)) == (
        "followed: at most P 0 mm off in the last fifth of the run (limit 50 mm); "
        "the reference says nothing of the trailer"
    )
    rows.q[-1, 0, :2] = 3.0, 4.0
    assert str(verdict(rows)) == "lost: P 5 m off in the last fifth of the run (limit 50 mm)"


def test_theta2_is_judged_where_it_is_defined() -> None:
    rows = still()
    rows.ref_q[:20, 0, 3] = np.nan
    rows.q[:20, 0, 3] = 3.0
    rows.q[20, 0, 3] = 1.0  # the start of what is defined
    assert verdict(rows).name == "followed"
    rows.q[70, 0, 3] = 1.6
    assert verdict(rows).name == "tractor_follows_trailer_lost"
    rows.ref_q[-30:, 0, 3] = np.nan
    rows.q[70, 0, 3] = 0.0
    rows.q[-30:, 0, 3] = 3.0
    assert verdict(rows).name == "followed"


def test_without_reference_there_is_nothing_to_follow() -> None:
    rows = still()
    rows.ref_q[:] = np.nan
    assert verdict(rows).name == "no_reference"


@pytest.mark.parametrize(
    ("flag", "key", "name"),
    [
        ("est_valid", "blind_share", "blind"),
        ("saturated", "saturated_share", "saturated_throughout"),
    ],
)
def test_shares_have_limits(flag: str, key: str, name: str) -> None:
    """Of 101 samples."""
    rows = still()
    getattr(rows, flag)[:51] = flag == "saturated"
    assert verdict(rows, **{key: 51 / 101 + HAIR}).name == "followed"
    found = verdict(rows, **{key: 50.9 / 101})
    assert found.name == name
    assert found.number == pytest.approx(51 / 101)
    assert "50.5 % of the samples (limit 50.4 %)" in found.what


@pytest.mark.parametrize(
    ("name", "column", "key", "limit"),
    [
        ("tipped_over", "tilt_rad", "tilt_rad", 0.3),
        ("off_the_ground", "height_m", "height_m", 0.02),
    ],
)
def test_footing_has_limits_with_and_without_a_reference(
    name: str, column: str, key: str, limit: float
) -> None:
    rows = still()
    rows.tilt_rad[:], rows.height_m[:], rows.wheels_on_floor[:] = 0.0, 0.0, 2.0
    getattr(rows, column)[40] = limit + HAIR
    assert verdict(rows, **{key: 2 * limit}).name == "followed"
    found = verdict(rows)
    assert (found.name, found.number, found.limit) == (name, limit + HAIR, limit)
    rows.ref_q[:] = np.nan
    assert verdict(rows).name == name
    getattr(rows, column)[40] = limit - HAIR
    assert verdict(rows).name == "no_reference"


def test_wheels_may_leave_the_ground_for_a_share_of_the_time() -> None:
    rows = still()
    rows.tilt_rad[:], rows.height_m[:] = 0.0, 0.0
    rows.wheels_on_floor[:] = 2.0
    rows.wheels_on_floor[:51] = 1.0
    assert verdict(rows, airborne_share=51 / 101 + HAIR).name == "followed"
    found = verdict(rows, airborne_share=50.9 / 101)
    assert (found.name, found.number) == ("off_the_ground", pytest.approx(51 / 101))


def test_no_share_allowed_is_kept_by_none() -> None:
    rows = still()
    assert verdict(rows, blind_share=0.0, saturated_share=0.0).name == "followed"


def test_a_moment_beyond_a_limit_is_no_matter() -> None:
    """0.1 s, all stretches together."""
    for more_s, count in ((0.039, 0), (0.041, 1)):
        spans = ((2.0, 2.06), (7.0, 7.0 + more_s))
        speed = Demand("wheel speed", "rad/s", 41.0, 2.0, 40.0, spans)
        assert len(Feasibility((speed,)).undrivable) == count


def test_a_reference_that_asks_too_much_is_named_if_it_was_not_followed() -> None:
    rows = still()
    hard, easy = demanding(2.1), demanding(2.0)
    assert (len(hard.undrivable), easy.undrivable) == (1, ())
    assert verdict(rows, hard).name == "followed"
    rows.q[-1, 0, 0] = 0.07
    found = verdict(rows, hard)
    assert str(found) == (
        "reference not feasible: the reference turns a wheel at 40.5 rad/s (limit 40 rad/s); "
        "P 70 mm off in the last fifth of the run (limit 50 mm)"
    )
    assert (found.number, found.limit) == (pytest.approx(40.53, abs=0.01), 40.0)
    assert verdict(rows, easy).name == "lost"
    rows.saturated[:] = True
    assert verdict(rows, easy).name == "saturated_throughout"
    assert verdict(rows, hard).name == "reference_not_feasible"
    rows.est_valid[:] = False
    assert verdict(rows, hard).name == "blind"


def test_what_the_hitch_lacks_is_told_of_a_lost_trailer() -> None:
    """An outer circle with its trailer turned by 1 rad: m2·l·|P''|·sin 1 is missing."""
    robot = RobotParameters(servo=Servo(preset="fast"))
    path = FlatCircle(radius_m=0.6, angular_rate_rad_s=1.0).sample(TIME_S, robot)
    path.theta[..., 1] += 1.0
    rows = still()
    rows.q[-1, 0, 3] = 1.0
    found = verdict(rows, check_feasibility(path, robot))
    pull = 0.33 * LENGTH * (0.6 - robot.swing_length_m) * np.sin(1.0)
    assert found.name == "tractor_follows_trailer_lost"
    assert found.what.endswith(
        f"; the reference asks the hitch for {pull:.2g} N·m that it does not have"
    )


@pytest.mark.parametrize("status", ["diverged", "failed", "interrupted"])
def test_a_run_that_broke_off_says_so_whatever_its_rows_are(status: str) -> None:
    rows = still()
    rows.q[50:] = np.nan
    found = tt.judge(rows, ROBOT, status=status, reason="it broke")
    assert (found.name, str(found)) == (status, f"{status}: it broke")


def test_every_verdict_has_words_and_a_meaning() -> None:
    for name, (words, meaning) in VERDICTS.items():
        assert words.replace(",", "").replace(" ", "_") == name
        assert meaning


def test_of_several_verdicts_a_run_gets_the_one_that_is_listed_first() -> None:
    """A run of which all is true, mended piece by piece."""
    rows, demands = still(), demanding(5.0)
    rows.q[:, 0, 0] = 5.0
    rows.wheels_on_floor[:], rows.tilt_rad[:], rows.height_m[:] = 0.0, 1.0, 1.0
    rows.est_valid[:], rows.saturated[:], rows.ref_q[:] = False, True, np.nan
    found = [verdict(rows, demands).name]
    for column, value in (
        ("tilt_rad", 0.0),
        ("height_m", 0.0),
        ("wheels_on_floor", 2.0),
        ("ref_q", 0.0),
        ("est_valid", True),
        (None, None),
        ("saturated", False),
        ("q", 0.0),
    ):
        if column is None:
            demands = demanding(0.1)
        else:
            getattr(rows, column)[:] = value
        found.append(verdict(rows, demands).name)
    assert found[1] == found[2] == "off_the_ground"  # too high, then with wheels in the air
    seen = list(dict.fromkeys(found))
    listed = list(VERDICTS)
    assert seen == [n for n in listed[listed.index("tipped_over") :] if "trailer" not in n]


def test_simulations_are_judged_one_by_one() -> None:
    overrides = ["plant.kind=analytic", "duration_s=1.0", "sensing.position_noise_m=0.001"]
    scenario = tt.load_scenario("inverted_trailer", overrides)
    result = tt.simulate(scenario, nsim=2)
    result.trajectory.q[-1, 1, 0] += 5.0
    names = [verdict.name for verdict in result.verdicts]
    assert names[1] == "lost"
    alone = tt.judge(result.trajectory.simulation(0), scenario.robot, accept=scenario.accept)
    assert result.verdicts[0] == alone
    with pytest.raises(tt.InputError, match="simulation"):
        tt.judge(result.trajectory, scenario.robot)
