"""Laws (47) and (70): γ does what it is for, the corrective terms do what they can."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.controllers.base import Task
from ttwmr_mj.controllers.lyapunov import Lyapunov, LyapunovOptions, law
from ttwmr_mj.controllers.lyapunov_pid import (
    LyapunovPid,
    LyapunovPidOptions,
    corrected,
    denominator,
    gamma,
    pid_acceleration,
    sideways,
    spring_push,
)
from ttwmr_mj.dynamics.hitch import published_spring_acceleration
from ttwmr_mj.dynamics.hybrid import trailer_acceleration
from ttwmr_mj.references.circle import Circle
from ttwmr_mj.references.flat_circle import FlatCircle
from ttwmr_mj.references.nothing import Nothing
from ttwmr_mj.references.shared.path import ReferencePath
from ttwmr_mj.robot import Hitch, RobotParameters, Servo
from ttwmr_mj.runs.experiment import Experiment
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.sensing import Estimate
from ttwmr_mj.state import RobotState

PERIOD = 0.033
ROBOT = RobotParameters(servo=Servo(preset="fast"))
K = ROBOT.swing_length_m
POINTS = 500


def options(**changes: object) -> LyapunovPidOptions:
    return LyapunovPidOptions.model_validate({"kind": "lyapunov_pid", **changes})


def motion(seed: int = 0) -> dict[str, np.ndarray]:
    """Errors, v, θ2 and w of many states; α4 ≠ α2 in the options of the tests that use it."""
    rng = np.random.default_rng(seed)
    return {
        "e": rng.uniform(-1, 1, (POINTS, 2)),
        "e_rate": rng.uniform(-1, 1, (POINTS, 2)),
        "v": rng.uniform(-3, 3, (POINTS, 2)),
        "theta2": rng.uniform(-7, 7, POINTS),
        "wanted": rng.uniform(-20, 20, POINTS),
    }


def circle(theta2: str = "aligned", radius: float = 0.43) -> ReferencePath:
    reference = Circle(radius_m=radius, angular_rate_rad_s=0.125, theta2=theta2)  # type: ignore[arg-type]
    return reference.sample(PERIOD * np.arange(300))


def started(
    chosen: LyapunovPidOptions, reference: ReferencePath | None, nsim: int = 1
) -> LyapunovPid:
    controller = LyapunovPid(chosen)
    controller.start(Task(ROBOT, reference, PERIOD, nsim, np.random.default_rng(0)))
    return controller


def estimate(q: np.ndarray, rate: np.ndarray) -> Estimate:
    state, n = RobotState(q, rate), len(q)
    return Estimate(state, np.zeros(n), np.ones(n, bool), np.full(n, np.nan))


def off_the_circle(nsim: int = 1, seed: int = 1) -> Estimate:
    rng = np.random.default_rng(seed)
    q = np.array([0.45, 0.02, 1.6, 1.4]) + rng.uniform(-0.05, 0.05, (nsim, 4))
    rate = np.array([0.0, 0.05, 0.1, 0.1]) + rng.uniform(-0.02, 0.02, (nsim, 4))
    return estimate(q, rate)


def test_gamma_exact_gives_the_wanted_acceleration_of_the_trailer() -> None:
    chosen, m = options(gamma="exact", alpha4=7.0), motion()
    d = denominator(m["e_rate"], m["theta2"], chosen)
    turn, cut = gamma(sideways(m["v"], m["theta2"]) - K * m["wanted"], d, chosen)
    got = trailer_acceleration(m["theta2"], corrected(m["v"], m["e_rate"], turn, chosen), ROBOT)
    assert not cut.any()
    # relative to γ·D/k, which cancels to w: rounding grows as D shrinks
    assert got == pytest.approx(m["wanted"], rel=1e-9, abs=1e-9)


def test_eq_60_gives_the_spring_of_eq_41_as_printed() -> None:
    sprung = RobotParameters(hitch=Hitch(stiffness_n_m_rad=200.0, damping_n_m_s_rad=200.0))
    chosen, m = options(gamma="exact", correction="spring_damper"), motion()
    rng = np.random.default_rng(2)
    angle, rate = rng.uniform(-1, 1, (2, POINTS))
    d = denominator(m["e_rate"], m["theta2"], chosen)
    turn, _ = gamma(-spring_push(angle, rate, chosen), d, chosen)
    got = trailer_acceleration(m["theta2"], corrected(m["v"], m["e_rate"], turn, chosen), ROBOT)
    free = trailer_acceleration(m["theta2"], m["v"], ROBOT)
    wanted = free + published_spring_acceleration(angle, rate, sprung)
    assert got == pytest.approx(wanted, rel=1e-9, abs=1e-9)


def test_the_correction_cancels_in_the_rate_of_v_and_keeps_the_speed_error() -> None:
    chosen, m = options(alpha4=7.0), motion()
    push = corrected(m["v"], m["e_rate"], m["wanted"], chosen) - m["v"]
    power = chosen.alpha2 * m["e_rate"][:, 0] * push[:, 0]
    power += chosen.alpha4 * m["e_rate"][:, 1] * push[:, 1]
    assert power == pytest.approx(np.zeros(POINTS), abs=1e-9)
    equal = corrected(m["v"], m["e_rate"], m["wanted"], options()) - m["v"]
    assert (equal * m["e_rate"]).sum(axis=1) == pytest.approx(np.zeros(POINTS), abs=1e-9)


def test_a_tractor_that_tracks_gets_no_correction_whatever_gamma() -> None:
    v, still = motion()["v"], np.zeros((POINTS, 2))
    assert np.array_equal(corrected(v, still, np.full(POINTS, 1e9), options()), v)


def test_law_71_by_hand() -> None:
    chosen = options()
    v, theta2 = np.array([[0.2, 0.5]]), np.array([0.0])
    wanted = pid_acceleration(np.array([0.1]), np.array([0.02]), np.array([0.05]), 0.3, chosen)
    assert wanted == pytest.approx([0.3 - 12 * 0.02 - 48 * 0.1 - 64 * 0.05])
    turn, _ = gamma(sideways(v, theta2) - K * wanted, np.array([99.0]), chosen)
    assert turn == pytest.approx([2.5 * (0.5 - K * (0.3 - 0.24 - 4.8 - 3.2))])
    got = corrected(v, np.array([[0.03, -0.04]]), turn, chosen)
    assert got == pytest.approx(np.array([[0.2 - 0.4 * turn[0], 0.5 - 0.3 * turn[0]]]))


def test_forms_of_one_over_d() -> None:
    excess, d = np.array([2.0, 2.0, 2.0, -2.0]), np.array([4.0, 1e-9, 0.0, 1e-9])
    exact, _ = gamma(excess, d, options(gamma="exact"))
    assert exact == pytest.approx([0.5, 2e9, 0.0, -2e9])
    soft, _ = gamma(excess, d, options(gamma="regularized", gamma_regularization_m_s2=0.01))
    assert soft[0] == pytest.approx(0.5, rel=1e-5)
    assert np.abs(soft).max() <= 2.0 / (2 * 0.01)  # its bound, |excess|/(2ε)
    cut, flags = gamma(excess, d, options(gamma="exact", gamma_limit=10.0))
    assert cut == pytest.approx([0.5, 10.0, 0.0, -10.0])
    assert flags.tolist() == [False, True, False, True]


def test_without_gamma_it_is_law_32() -> None:
    """ρ = 0 takes the correction away: the same wheels, to the bit."""
    plain = Lyapunov(LyapunovOptions(kind="lyapunov"))
    plain.start(Task(ROBOT, circle(), PERIOD, 3, np.random.default_rng(0)))
    ours = started(options(rho=0.0), circle(), nsim=3)
    for k in range(20):
        seen = off_the_circle(nsim=3, seed=k)
        assert np.array_equal(
            plain.command(k, seen).wheel_speed_rad_s, ours.command(k, seen).wheel_speed_rad_s
        )


def test_a_batch_is_its_single_simulations() -> None:
    together = started(options(), circle(), nsim=4)
    alone = [started(options(), circle()) for _ in range(4)]
    for k in range(10):
        seen = off_the_circle(nsim=4, seed=k)
        wheels = together.command(k, seen).wheel_speed_rad_s
        for i, controller in enumerate(alone):
            q, rate = seen.state.q[i : i + 1], seen.state.q_rate[i : i + 1]
            assert np.array_equal(
                controller.command(k, estimate(q, rate)).wheel_speed_rad_s, wheels[i : i + 1]
            )


def integral(controller: LyapunovPid) -> float:
    return float(controller._integral[0])


def test_the_integral_counts_and_a_new_start_forgets_it() -> None:
    controller = started(options(), circle())
    seen = off_the_circle()
    for k in range(10):
        controller.command(k, seen)
    errors = [seen.state.q[0, 3] - circle().theta2_rad[k, 0] for k in range(10)]
    assert integral(controller) == pytest.approx(PERIOD * sum(errors), rel=1e-12)
    controller.start(Task(ROBOT, circle(), PERIOD, 1, np.random.default_rng(0)))
    assert integral(controller) == 0.0


def test_anti_windup_holds_the_integral_while_gamma_is_cut() -> None:
    free = started(options(gamma_limit=1e-6), circle())
    held = started(options(gamma_limit=1e-6, anti_windup="conditional"), circle())
    for k in range(10):
        free.command(k, off_the_circle())
        held.command(k, off_the_circle())
    assert integral(free) != 0.0
    assert integral(held) == 0.0


def test_e5_is_taken_on_the_circle() -> None:
    """A trailer wound up once around is where it was."""
    near, wound = off_the_circle(), off_the_circle()
    wound.state.q[:, 3] += 2.0 * np.pi
    a = started(options(), circle()).command(0, near).wheel_speed_rad_s
    b = started(options(), circle()).command(0, wound).wheel_speed_rad_s
    assert b == pytest.approx(a, abs=1e-9)


def test_where_theta2_has_no_reference_the_correction_pauses() -> None:
    reference = circle()
    reference.theta[5:, :, 1] = np.nan
    reference.theta_rate[5:, :, 1] = np.nan
    plain = Lyapunov(LyapunovOptions(kind="lyapunov"))
    plain.start(Task(ROBOT, reference, PERIOD, 1, np.random.default_rng(0)))
    ours = started(options(), reference)
    assert np.array_equal(
        ours.command(7, off_the_circle()).wheel_speed_rad_s,
        plain.command(7, off_the_circle()).wheel_speed_rad_s,
    )
    assert integral(ours) == 0.0


def test_what_it_needs_is_asked_for() -> None:
    (fault,) = options().faults(Nothing(), None)
    assert "'lyapunov_pid' needs a reference" in str(fault)
    reference = Circle(radius_m=0.43, angular_rate_rad_s=0.125)
    (fault,) = options().faults(reference, circle("none"))
    assert str(fault).startswith("reference.theta2: got 'none'; which leaves θ2 undefined")
    assert options(theta2_reference="tractor").faults(reference, circle("none")) == []
    assert options().faults(reference, circle("outward")) == []
    for other in ({"theta2_reference": "tractor"}, {"correction": "spring_damper"}):
        command = started(options(**other), circle("none")).command(0, off_the_circle())
        assert np.isfinite(command.wheel_speed_rad_s).all()


def test_the_tractor_may_be_the_trailers_reference() -> None:
    """θ2d = θ1 does not accelerate: e5 and its rate are the hitch's."""
    law, seen = started(options(theta2_reference="tractor"), circle()), off_the_circle()
    error, rate, feedforward = law._theta2_error(0, seen.state)
    assert error == pytest.approx(seen.state.q[:, 3] - seen.state.q[:, 2])
    assert rate == pytest.approx(seen.state.q_rate[:, 3] - seen.state.q_rate[:, 2])
    assert feedforward == 0.0


def test_a_reference_without_the_option_is_named_by_its_kind() -> None:
    (fault,) = options().faults(FlatCircle(radius_m=0.4, angular_rate_rad_s=1.0), circle("none"))
    assert str(fault).startswith("reference.kind: got 'flat_circle'; which leaves θ2 undefined")


def test_the_defaults_are_table_ii() -> None:
    scenario = load_scenario("lab_circle", ["controller.kind=lyapunov_pid"])
    chosen = scenario.controller
    assert isinstance(chosen, LyapunovPidOptions)
    alphas = (chosen.alpha1, chosen.alpha2, chosen.alpha3, chosen.alpha4)
    assert alphas == (25.0, 10.0, 25.0, 10.0)
    assert (chosen.k_d, chosen.k_p, chosen.k_i, chosen.rho) == (12.0, 48.0, 64.0, 2.5)
    assert (chosen.k_t, chosen.c_t) == (200.0, 200.0)


def test_the_singular_terms_are_those_of_law_32() -> None:
    m = motion()
    for terms in ("omitted", "regularized", "published"):
        ours = law(m["e"], m["e_rate"], m["v"], options(singular_terms=terms))
        plain = LyapunovOptions.model_validate({"kind": "lyapunov", "singular_terms": terms})
        assert np.array_equal(ours, law(m["e"], m["e_rate"], m["v"], plain))


def test_it_runs_in_a_scenario_and_is_worse_than_no_correction() -> None:
    """The reproduction in small: the correction costs the tractor its path."""
    told = ["plant.kind=analytic", "duration_s=20.0", "reference.theta2=aligned"]
    ends = {}
    for kind in ("lyapunov", "lyapunov_pid"):
        rows = Experiment(load_scenario("lab_circle", [*told, f"controller.kind={kind}"])).run()
        miss = (rows.trajectory.q - rows.trajectory.ref_q)[-1, 0, :2]
        ends[kind] = float(np.hypot(*miss))
    assert ends["lyapunov"] < 0.01
    assert ends["lyapunov_pid"] > 0.1
