"""The reproduction's theory: it agrees with the controllers, and the errata are proved."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from ttwmr_mj.controllers import lyapunov_pid
from ttwmr_mj.controllers.lyapunov import LyapunovOptions, law
from ttwmr_mj.controllers.lyapunov_pid import LyapunovPidOptions
from ttwmr_mj.robot import RobotParameters
from ttwmr_mj.studies.reproduce.errata import ERRATA
from ttwmr_mj.studies.reproduce.ideal import phase_plane, step_size
from ttwmr_mj.studies.reproduce.ideal.continuous import decade_times
from ttwmr_mj.studies.reproduce.ideal.loop import IdealLoop, Solution, sampled, solve
from ttwmr_mj.studies.reproduce.proofs import proofs
from ttwmr_mj.studies.reproduce.runs import RUNS

LAWS = [
    LyapunovOptions(kind="lyapunov"),
    LyapunovOptions(kind="lyapunov", singular_terms="regularized"),
    LyapunovOptions(kind="lyapunov", singular_terms="published"),
    LyapunovPidOptions(kind="lyapunov_pid"),
    LyapunovPidOptions(kind="lyapunov_pid", gamma="exact", alpha4=7.0),
    LyapunovPidOptions(kind="lyapunov_pid", gamma="regularized", gamma_limit=3.0),
]


@pytest.mark.parametrize("options", LAWS, ids=str)
def test_the_law_on_floats_is_the_controllers_law(options: LyapunovOptions) -> None:
    loop, rng = IdealLoop(options, 0.43, 0.125, 0.35), np.random.default_rng(4)
    for _ in range(50):
        time_s, z = rng.uniform(0, 60), tuple(rng.uniform(-1, 1, 7))
        angle = 0.125 * time_s + 0.35
        radial = np.array([math.cos(angle), math.sin(angle)])
        e1, e2, e3, e4 = loop.errors(time_s, z)
        e, e_rate = np.array([e1, e3]), np.array([e2, e4])
        v = law(e, e_rate, -0.43 * 0.125**2 * radial, options)
        if isinstance(options, LyapunovPidOptions):
            theta2 = np.array(z[4])
            e5 = (z[4] - angle - 0.5 * np.pi + np.pi) % (2 * np.pi) - np.pi
            wanted = lyapunov_pid.pid_acceleration(e5, z[5] - 0.125, z[6], 0.0, options)
            excess = lyapunov_pid.sideways(v, theta2) - RobotParameters().swing_length_m * wanted
            d = lyapunov_pid.denominator(e_rate, theta2, options)
            turn, _ = lyapunov_pid.gamma(np.asarray(excess), d, options)
            v = lyapunov_pid.corrected(v, e_rate, turn, options)
        command = loop.command(time_s, z)
        assert [command.v1, command.v2] == pytest.approx(v, rel=1e-9, abs=1e-9)


def test_sampling_finer_leads_to_the_differential_equation() -> None:
    loop = IdealLoop(LAWS[0], 1.0, 0.5)
    start = loop.at_rest(0.6, -0.3)
    exact = solve(loop, start, 3.0).z[-1]
    misses = [np.abs(sampled(loop, start, 3.0, h).z[-1] - exact)[:4].max() for h in (1e-2, 1e-3)]
    assert misses[1] / misses[0] == pytest.approx(0.1, rel=0.2)  # a held command: first order


def test_the_distance_is_of_p_from_the_point_on_the_circle() -> None:
    loop = IdealLoop(LAWS[0], 1.0, 0.5 * math.pi)
    rows = [(1.3, 9.0, 0.4, 9.0, 0.0, 0.0, 0.0), (0.0, 9.0, 1.2, 9.0, 0.0, 0.0, 0.0)]
    path = Solution(np.array([0.0, 1.0]), np.array(rows), "time")  # at (1, 0), then at (0, 1)
    assert loop.distances(path) == pytest.approx([0.5, 0.2])


def test_an_ideal_loop_without_error_keeps_it_so() -> None:
    loop = IdealLoop(LAWS[0], 1.0, 0.5)
    on_the_circle = (1.0, 0.0, 0.0, 0.5, 0.5 * math.pi, 0.5, 0.0)
    end = solve(loop, on_the_circle, 5.0)
    assert np.hypot(*np.array(loop.errors(5.0, end.z[-1]))[[0, 2]]) < 1e-7
    assert loop.lyapunov(0.0, on_the_circle) == pytest.approx(0.0, abs=1e-30)


def test_all_paths_of_the_printed_law_end_on_e2_zero_but_for_one_ray() -> None:
    study = phase_plane.study()
    assert max(study["end_time_s"]) < 1.0
    # e2 falls to zero like a square root of time: the last step that floats can take is this far
    assert all(abs(path[1][-1]) < 1e-7 for path in study["paths"])
    assert min(abs(e1) for e1 in study["left_e1_m"]) > 0.01
    for (e1, e2), left in zip(study["paths"], study["left_v_share"], strict=True):
        start = 25.0 * e1[0] ** 2 + 10.0 * e2[0] ** 2  # Table II; e2 = 0 in the end
        assert left == pytest.approx(25.0 * e1[-1] ** 2 / start)

    def slope(u: float) -> float:
        """U' for u = e2/e1, which is e2'/e1 − u², the same at every e1."""
        e2, e2_rate = phase_plane.rates(0.0, (0.3, 0.3 * u))
        assert e2 == 0.3 * u
        return e2_rate / 0.3 - u * u

    assert slope(study["invariant_ray_1_s"]) == pytest.approx(0.0, abs=1e-9)
    assert all(slope(u) < 0.0 for u in np.geomspace(1e-6, 1e6, 100))
    assert all(slope(-u) > 0.0 for u in np.geomspace(1e-6, 9.7, 100))
    assert all(slope(-u) < 0.0 for u in np.geomspace(9.8, 1e6, 100))


def test_the_printed_law_stands_still_where_it_first_stops_at_every_small_step() -> None:
    loop = IdealLoop(LAWS[2], 1.0, 0.5, limit_m_s2=9.0)
    start = loop.at_rest(0.6, -0.3)
    ends = []
    for step in (1e-3, 1e-4):
        path = sampled(loop, start, 2.0, step)
        ends.append(math.hypot(*loop.errors(path.time_s[-1], tuple(path.z[-1]))[::2]))
    assert ends[0] == pytest.approx(ends[1], rel=5e-3)
    assert ends[0] > 0.4


def test_law_32_decays_by_its_slow_eigenvalue() -> None:
    """e'' + 10·e' + 2.5·e = 0: ln 10 over 5 − √22.5 for each decade, on samples of 10 ms."""
    slow_1_s = 5.0 - math.sqrt(22.5)
    assert np.diff(decade_times()) == pytest.approx(math.log(10.0) / slow_1_s, abs=0.011)


def test_a_study_of_steps_tells_the_distance_at_the_start_and_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(step_size, "STEPS_S", (1e-2,))
    (run,) = step_size.study("law (32), singular terms omitted")["runs"]
    assert run["error_m"][0] == pytest.approx(0.5)  # from (0.6, -0.3) to (1, 0)
    loop = IdealLoop(LAWS[0], 1.0, 0.5)
    exact = solve(loop, loop.at_rest(0.6, -0.3), step_size.DURATION_S)
    # a held command is late by half a step
    assert run["final_error_m"] == pytest.approx(loop.distances(exact)[-1], rel=0.02)


@pytest.mark.parametrize("gamma", ["constant", "regularized"])
def test_what_gamma_can_do_to_the_trailer_goes_through_the_velocity_error(gamma: str) -> None:
    """η = k·θ̇2 − n·w has the rate n·a + θ̇2·(t·w), and ∫(α·w)² dt is what V has lost."""
    loop = IdealLoop(LyapunovPidOptions(kind="lyapunov_pid", gamma=gamma), 1.0, 0.5)
    path = solve(loop, loop.at_rest(0.6, -0.3), 2.0, samples=20001)
    e = np.array([loop.errors(t, tuple(z)) for t, z in zip(path.time_s, path.z, strict=True)])
    theta2, theta2_rate, w = path.z[:, 4], path.z[:, 5], e[:, 1::2]
    along = np.stack([np.cos(theta2), np.sin(theta2)], axis=1)
    across = np.stack([-np.sin(theta2), np.cos(theta2)], axis=1)
    angle = 0.5 * path.time_s
    a = -0.25 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rate = (across * a).sum(axis=1) + theta2_rate * (along * w).sum(axis=1)
    eta = loop.swing_length_m * theta2_rate - (across * w).sum(axis=1)
    # trapezoidal rule over 0.1 ms, of motions of some 100 rad/s
    assert eta[-1] - eta[0] == pytest.approx(np.trapezoid(rate, path.time_s), abs=1e-4)
    v = [loop.lyapunov(path.time_s[i], tuple(path.z[i])) for i in (0, -1)]
    spent = np.trapezoid(100.0 * (w**2).sum(axis=1), path.time_s)
    assert v[0] - v[1] == pytest.approx(spent, rel=1e-4)
    assert np.ptp(theta2_rate) > 1.0  # it did something


@pytest.mark.parametrize("gamma", ["constant", "regularized"])
def test_a_tractor_without_error_tows_a_free_trailer_whatever_gamma_is(gamma: str) -> None:
    pid = LyapunovPidOptions(kind="lyapunov_pid", gamma=gamma)
    start = (1.0, 0.0, 0.0, 0.5, 2.0, -0.3, 0.0)  # on the circle, the trailer 0.4 rad off
    free, towed = (
        solve(IdealLoop(law, 1.0, 0.5), start, 3.0).z[-1]
        for law in (LyapunovOptions(kind="lyapunov"), pid)
    )
    assert towed[:6] == pytest.approx(free[:6], abs=1e-6)  # of the solver
    assert abs(free[4] - start[4] - 1.5) > 0.1  # it is not aligned, and moves


def test_exact_gamma_ends_within_a_fraction_of_a_second() -> None:
    loop = IdealLoop(LyapunovPidOptions(kind="lyapunov_pid", gamma="exact"), 1.0, 0.5)
    path = solve(loop, loop.at_rest(0.6, -0.3), 5.0, until=lambda t, z: loop.command(t, z).d)
    assert path.end == "singular"
    assert path.time_s[-1] < 0.2


@pytest.mark.parametrize("name", list(proofs.all_proofs()))
def test_the_errata_are_proved(name: str) -> None:
    assert proofs.all_proofs()[name]().proved


def test_without_sympy_the_study_says_what_to_install() -> None:
    code = (
        "import sys; sys.modules['sympy'] = None\n"
        "from ttwmr_mj.studies.reproduce.proofs import proofs\n"
        "from ttwmr_mj.errors import MachineError\n"
        "try: proofs.study()\nexcept MachineError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install 'ttwmr-mj[reproduce]'" in done.stdout


def test_every_erratum_names_a_proof_and_every_error_has_an_erratum() -> None:
    assert {erratum.proof for erratum in ERRATA} <= set(proofs.all_proofs())
    where = " ".join(erratum.where for erratum in ERRATA)
    for equation in (23, 32, 41, 48, 58, 68):
        assert f"Eq. {equation}" in where


def test_200_as_printed_is_this_torque() -> None:
    robot = RUNS["spring-printed-omitted-contact"].scenario().robot
    torque = 200.0 * robot.trailer.mass_kg * robot.trailer.com_offset_m
    assert robot.hitch.stiffness_n_m_rad == pytest.approx(torque, abs=5e-4)
    assert robot.hitch.damping_n_m_s_rad == robot.hitch.stiffness_n_m_rad
