"""Trains in contact physics: their model, agreement with the equations, runs and comparisons."""

import mujoco
import numpy as np
import pytest
from trains import motley, train

import ttwmr_mj as tt
from ttwmr_mj.dynamics.circling import circling
from ttwmr_mj.dynamics.train import swing_matrix
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.analytic import AnalyticPlant
from ttwmr_mj.plants.contact import ContactPlant
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.joints import Joints
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.names import casters, trailer_part
from ttwmr_mj.references.shared.feasibility import check_feasibility
from ttwmr_mj.robot import Casters, RobotParameters
from ttwmr_mj.runs.pushes import Push, forces
from ttwmr_mj.scenario.motion import initial_state, sample_reference
from ttwmr_mj.scenario.schema import PushOptions
from ttwmr_mj.state import RobotState

PERIOD, STEPS = 0.033, 66
TWO = "two_trailers_turn"
CIRCLE = [
    "controller={kind='open_loop',segments=[{duration_s=1.0,wheel_right_rad_s=1.0,wheel_left_rad_s=1.0}]}",
    "reference={kind='flat_circle',radius_m=0.6,angular_rate_rad_s=1.0,circle_of='P'}",
    "initial={kind='on_reference'}",
    "robot.servo.preset=fast",
]


@pytest.mark.parametrize("robot", [train(2), train(3, reach_m=None), motley()])
def test_every_trailer_weighs_what_its_parameters_say(robot: RobotParameters) -> None:
    model = build_model(robot, ContactOptions())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hitch = np.zeros(2)
    for i, trailer in enumerate(robot.trailers):
        parts = [trailer_part("trailer", i), *casters(i + 1)[-2:]]
        bodies = [model.body(name).id for name in parts]
        mass = model.body_mass[bodies]
        com = (mass[:, None] * data.xipos[bodies, :2]).sum(axis=0) / mass.sum()
        inertia = 0.0
        for body, m in zip(bodies, mass, strict=True):
            axes = data.ximat[body].reshape(3, 3)
            own = (axes * model.body_inertia[body]) @ axes.T
            inertia += own[2, 2] + m * ((data.xipos[body, :2] - com) ** 2).sum()
        assert mass.sum() == pytest.approx(trailer.mass_kg, rel=1e-9)
        expected = hitch + [-trailer.com_offset_m, trailer.com_lateral_m]
        np.testing.assert_allclose(com, expected, rtol=0, atol=1e-9)
        assert inertia == pytest.approx(trailer.yaw_inertia_kg_m2, rel=1e-9)
        np.testing.assert_allclose(data.xpos[bodies[0], :2], hitch, atol=1e-12)
        hitch = hitch - [trailer.next_hitch_offset_m or 0.0, 0.0]
    joints = [model.joint(trailer_part("hitch", i)) for i in range(len(robot.trailers))]
    for joint, values in zip(joints, robot.hitches, strict=True):
        assert joint.stiffness[0] == values.stiffness_n_m_rad
        assert joint.damping[0] == values.damping_n_m_s_rad
    q = np.array([[0.1, -0.2, 0.3, *np.arange(len(joints))]])
    places = Joints(model)
    back, _ = places.planar(places.standing(model.qpos0, q), np.zeros((1, model.nv)))
    np.testing.assert_allclose(back, q, atol=1e-14)


def test_bodies_collide_but_for_those_hinged_together() -> None:
    """Folded, the third trailer runs into the first; the second may overlap its neighbours."""
    model = build_model(train(3), ContactOptions())
    data = mujoco.MjData(model)
    hulls = [f"{trailer_part('trailer', i)}_hull" for i in range(3)]
    places = Joints(model)

    def touching(*hitch_rad: float) -> set[frozenset[str]]:
        theta = np.cumsum(hitch_rad)
        q = np.array([[0.0, 0.0, 0.0, *theta]])
        data.qpos[:] = places.standing(model.qpos0, q)[0]
        mujoco.mj_forward(model, data)
        names = [[model.geom(int(g)).name for g in pair] for pair in data.contact.geom]
        return {frozenset(pair) for pair in names if "floor" not in pair}

    assert touching(0.0, 0.0, 0.0) == set()
    assert touching(0.0, 2.0, 0.0) == set()
    assert touching(0.0, 1.6, 2.4) == {frozenset((hulls[0], hulls[2]))}
    assert touching(1.6, 2.4, 0.0) == {frozenset(("tractor_hull", hulls[1]))}


@pytest.mark.parametrize("count", [1, 2, 3])
def test_contact_physics_agrees_with_the_equations(count: int) -> None:
    robot = train(count, damping_n_m_s_rad=1e-3)
    start = RobotState.at_rest(0.0, 0.0, 0.3, [0.9, -0.4, 0.2][:count])
    contact = ContactPlant(robot, ContactOptions(), 1, 1)
    model = AnalyticPlant(robot, 1, PERIOD, 0.011)
    worst = np.zeros(3 + count)
    for plant in (contact, model):
        plant.reset(start)
    for k in range(60):
        command = np.array([[4.0 + np.sin(0.15 * k), 3.0 + np.cos(0.1 * k)]])
        contact.advance(command, STEPS)
        model.advance(command, 1)
        worst = np.maximum(worst, np.abs(contact.state().q - model.state().q)[0])
    # over 0.2 m: 0.06 mm; angles 0.1, 0.6, 0.8 and 1.7 mrad with three
    assert worst[:2].max() < 2e-4
    assert worst[2] < 5e-4
    assert worst[3:].max() < 4e-3


def test_rows_of_a_batch_and_mirrored_trains_are_the_same_in_contact_physics() -> None:
    robot, q = train(2), np.array([[0.1, 0.2, 0.3, 0.9, -0.4]])
    both = np.vstack([q, q * [1.0, -1.0, -1.0, -1.0, -1.0]])
    plant, alone = (ContactPlant(robot, ContactOptions(), n, 1) for n in (2, 1))
    plant.reset(RobotState(both, np.zeros_like(both)))
    alone.reset(RobotState(q, np.zeros_like(q)))
    plant.advance(np.array([[4.0, 3.0], [3.0, 4.0]]), 10 * STEPS)
    alone.advance(np.array([[4.0, 3.0]]), 10 * STEPS)
    end = plant.state().q
    np.testing.assert_array_equal(end[0], alone.state().q[0])
    # contacts are solved one after the other, which a mirror turns round: to the solver's 1e-10
    np.testing.assert_allclose(end[0, 1:], -end[1, 1:], rtol=0, atol=1e-8)


def test_balls_of_all_trailers_resist() -> None:
    robot = train(2).model_copy(update={"casters": Casters(rolling_resistance_m=2e-4)})
    start = RobotState(
        q=np.array([[0.0, 0.0, 0.0, 0.5, 0.9]]), q_rate=np.array([[0.1, 0.0, 0.0, 0.0, 0.0]])
    )
    contact = ContactPlant(robot, ContactOptions(), 1, 1)
    model = AnalyticPlant(robot, 1, PERIOD, 0.011)
    wheels = np.full((1, 2), 0.1 / 0.026)
    for plant, steps in ((contact, STEPS), (model, 1)):
        plant.reset(start)
        for _ in range(45):
            plant.advance(wheels, steps)
    free = AnalyticPlant(train(2), 1, PERIOD, 0.011)
    free.reset(start)
    free.advance(wheels, 45)
    end = model.state().q[0, 3:]
    assert np.abs(end - free.state().q[0, 3:]).max() > 0.05
    np.testing.assert_allclose(contact.state().q[0, 3:], end, rtol=0, atol=0.01)


def test_a_flat_circle_leads_every_train() -> None:
    for sides in ("'outside'", "['inside','outside']"):
        scenario = tt.load_scenario(TWO, [*CIRCLE, f"reference.side={sides}", "duration_s=2.0"])
        path = sample_reference(scenario)
        assert path is not None
        check = check_feasibility(path, scenario.robot)
        assert check["free trailer"].kept
        assert check["no side slip"].kept
        outside = scenario.reference.outside(scenario.robot)
        shape = circling(scenario.robot, outside, 0.6)
        np.testing.assert_allclose(np.hypot(*path.position_m[:, 0].T), 0.6, atol=1e-14)
        assert path.flat_derivatives is not None
        radius = np.hypot(*path.flat_derivatives[:, 0, 0].T)
        np.testing.assert_allclose(radius, abs(shape.centre_m[0]), atol=1e-14)
        np.testing.assert_allclose(np.diff(path.theta[:, 0], axis=0), PERIOD, atol=1e-13)
        start = initial_state(scenario, path)
        np.testing.assert_array_equal(start.q, path.q[0])


def test_a_flat_ellipse_leads_trains_that_are_flat() -> None:
    ellipse = "reference={kind='flat_ellipse',half_axes_m=[0.8,0.6],angular_rate_rad_s=0.6}"
    with pytest.raises(InputError, match="centre of oscillation"):
        tt.load_scenario(TWO, [ellipse])
    length = train(1).swing_length_m
    flat = f"robot.trailers=[{{next_hitch_offset_m={length}}},{{}}]"
    free = "robot.hitches=[{},{}]"
    scenario = tt.load_scenario(TWO, [ellipse, flat, free, "reference.side=['outside','inside']"])
    path = sample_reference(scenario)
    assert path is not None
    assert check_feasibility(path, scenario.robot)["free trailer"].worst < 1e-12
    rate = np.gradient(path.theta[:, 0], PERIOD, axis=0)
    np.testing.assert_allclose(rate[1:-1], path.theta_rate[1:-1, 0], atol=1e-3)


@pytest.mark.parametrize("side", ["inside", "outside"])
def test_a_folded_train_needs_room_for_the_second_trailer_beside_the_tractor(side: str) -> None:
    other = {"inside": "outside", "outside": "inside"}[side]
    for reach_m, deep_m in ((0.23, 0.034), (0.28, None)):
        trailers = f"robot.trailers=[{{next_hitch_offset_m={reach_m}}},{{}}]"
        scenario = tt.load_scenario(
            "double_inverted", [trailers, f"reference.side={[side, other]}"]
        )
        model = build_model(scenario.robot, scenario.plant.contact)
        data = mujoco.MjData(model)
        q = sample_reference(scenario).q[0]
        data.qpos[:] = Joints(model).standing(np.array(model.qpos0), q)[0]
        mujoco.mj_forward(model, data)
        deep = {
            tuple(sorted(model.geom(geom).name for geom in contact.geom)): -contact.dist
            for contact in data.contact
            if model.geom("floor").id not in contact.geom
        }
        # half the tractor's width and the bed's far end, less the hitch: 0.062 + 0.202 − d
        expected = {} if deep_m is None else {("tractor_hull", "trailer_2/trailer_hull"): deep_m}
        assert deep == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize("which", [1, 2, 3])
def test_a_push_gives_a_train_the_impulse_it_should(which: int) -> None:
    """The braked tractor stands, the train swings behind it: M·Δω = −F·Δt·(levers about P)."""
    robot = train(3)
    plant = ContactPlant(robot, ContactOptions())
    plant.reset(RobotState.at_rest(0.0, 0.0, 0.0, [0.0, 0.0, 0.0]))
    force_n, steps = 0.02, 20
    options = PushOptions(start_s=0.0, duration_s=0.1, force_n=(0.0, force_n), trailer=which)
    plant.push(forces(Push.drawn((options,), [np.random.default_rng(0)]), 0.0))
    plant.advance(np.zeros((1, 2)), steps)
    # trailers lie along −x: each before the one pushed carries it by its hitch, that by its COM
    towing = [trailer.next_hitch_offset_m or 0.0 for trailer in robot.trailers[: which - 1]]
    levers = np.array([*towing, robot.trailers[which - 1].com_offset_m, *[0.0] * (3 - which)])
    impulse = -force_n * steps * plant.time_step_s * levers
    expected = np.linalg.solve(swing_matrix(np.zeros((1, 3)), robot)[0], impulse)
    # 3 %: the casters' balls roll along and add to M
    np.testing.assert_allclose(plant.state().q_rate[0, 3:], expected, atol=0.03 * np.ptp(expected))


@pytest.mark.parametrize(
    ("override", "key"),
    [
        (
            "sensing={kind='camera',camera={faults={occluders=[{over='trailer',trailer=3}]}}}",
            "sensing.camera.faults.occluders.0.trailer",
        ),
        (
            "sensing={kind='camera',camera={faults={faded=[{label='trailer_rear',trailer=3}]}}}",
            "sensing.camera.faults.faded.0.trailer",
        ),
        (
            "plant.pushes=[{start_s=1.0,duration_s=0.1,force_n=[1.0,0.0],trailer=3}]",
            "plant.pushes.0.trailer",
        ),
        ("controller={kind='flatness'}", "controller.kind"),
        ("controller={kind='tvlqr',recovery='mpc'}", "controller.recovery"),
        (
            f"robot={{trailers=[{'{next_hitch_offset_m=0.23},' * 5}{{}}],hitches=[{'{},' * 6}]}}",
            "robot.trailers: got 6 of them; allowed: at most 5 of them",
        ),
        ("reference={kind='planned',plan='figure_eight'}", "reference.plan.*for 1 trailer, not 2"),
        (
            "reference={kind='flat_arc',radius_m=0.5,angles_rad=[0.0,1.0],peak_rate_rad_s=1.0}",
            "reference.kind",
        ),
        ("initial.more_trailers_rad=[0.1,0.2]", "initial.more_trailers_rad"),
        ("plant.analytic.published_spring=true", "plant.analytic.published_spring"),
        ("robot.hitches=[{play_m=1e-4},{play_m=1e-4}]", r"robot.hitches.1.play_m"),
    ],
)
def test_what_trains_cannot_have_is_refused_with_its_key(override: str, key: str) -> None:
    with pytest.raises(InputError, match=key):
        tt.load_scenario(TWO, [override])


def test_trailers_start_where_they_are_told() -> None:
    told = tt.load_scenario(TWO, ["initial.theta2_rad=0.3", "initial.more_trailers_rad=[-0.2]"])
    np.testing.assert_array_equal(initial_state(told, None).q[0, 3:], [0.3, -0.2])
    alike = tt.load_scenario(TWO, ["initial.theta2_rad=0.3"])
    np.testing.assert_array_equal(initial_state(alike, None).q[0, 3:], [0.3, 0.3])
    off = tt.load_scenario(TWO, [*CIRCLE, "initial.more_trailers_offset_rad=[0.1]"])
    path = sample_reference(off)
    assert path is not None
    np.testing.assert_allclose(
        initial_state(off, path).q[0] - path.q[0, 0], [0.0, 0.0, 0.0, 0.0, 0.1], atol=1e-15
    )


def test_noise_reaches_every_angle() -> None:
    noisy = tt.load_scenario(
        TWO, ["duration_s=2.0", "plant.kind=analytic", "sensing.angle_noise_rad=0.01"]
    )
    rows = tt.simulate(noisy).trajectory
    off = (rows.est_q - rows.q)[:, 0, 2:]
    np.testing.assert_allclose(off.std(axis=0), 0.01, rtol=0.5)
    assert rows.to_table().column_names.count("theta3_rad") == 1


@pytest.mark.slow
def test_a_train_is_compared() -> None:
    overrides = ["duration_s=4.0", "output.figures=false"]
    pair = tt.compare(tt.load_scenario(TWO, overrides))
    assert pair.numbers["theta3_deviation_max_rad"] < 5e-3
    assert pair.numbers["position_deviation_per_path"] < 1e-3
    assert pair.numbers["trailer_equation_residual_rms_n_m"] < 1e-5
    assert "trailer_2/caster_trailer_left_slip_along_max_m_s" in pair.numbers
