"""Checks across keys of a scenario: each finds its fault, and is silent a step away from it."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

from ttwmr_mj.assets import scenarios_folder
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario import checks
from ttwmr_mj.scenario.checks import CHECKS
from ttwmr_mj.scenario.file import check_scenario, load_scenario, set_value

BASE = """
name = "mine"
duration_s = 5.0
plant.kind = "contact"
[reference]
kind = "circle"
radius_m = 0.43
angular_rate_rad_s = 0.125
[controller]
kind = "lyapunov"
"""
SEGMENT = "{duration_s=1.0,wheel_right_rad_s=1.0,wheel_left_rad_s=1.0}"
OPEN_LOOP = ['reference={kind="none"}', f'controller={{kind="open_loop",segments=[{SEGMENT}]}}']
MOVED = "belief.camera.x_m=0.01"
CALIBRATION = scenarios_folder() / "calibration" / "lab_camera.yaml"
PUSH = "plant.pushes=[{start_s=1.0,duration_s=0.1,force_n=[1.0,0.0]}]"
BRIEF = "plant.pushes=[{start_s=0.34, duration_s=0.02, force_n=[0.1, 0.3]}]"
ANALYTIC = "plant.kind=analytic"
CAMERA = 'sensing={kind="camera"}'
TRAIN = "robot.trailers=[{next_hitch_offset_m=0.3},{}]"
BELIEVED = "belief.robot.trailers=[{next_hitch_offset_m=0.3},{}]"
HITCHES = ["robot.hitches=[{},{}]", "belief.robot.hitches=[{},{}]"]
TABLE_ONE_TRAILER = ["robot.trailer.mass_kg=0.33", "robot.trailer.com_offset_m=0.141"]

MOTOR = "robot.servo.motor."


def motor(loop_s: float, window_s: float, delay_s: float) -> str:
    times = f"loop_period_s={loop_s}, encoder_window_s={window_s}, command_delay_s={delay_s}"
    return f"robot.servo.motor={{{times}}}"


# name of the check → (without a fault, with one, the fault's key and words of it)
TERRAIN = "ground.terrain={rms_height_m=0.004, half_size_m=1.0}"
PAIRS: dict[str, list[tuple[list[str], list[str], str, str]]] = {
    "_tractor_masses": [
        (
            ["robot.tractor.mass_kg=0.0611", "robot.tractor.com_offset_m=0.01"],
            ["robot.tractor.mass_kg=0.061", "robot.tractor.com_offset_m=0.01"],
            "robot.tractor.mass_kg",
            "wheels and casters weigh 0.061 kg",
        )
    ],
    "_trailer_masses": [
        (
            ["robot.trailer.mass_kg=0.0021"],
            ["robot.trailer.mass_kg=0.002"],
            "robot.trailer.mass_kg",
            "weigh 0.002 kg and leave nothing",
        )
    ],
    "_belief": [
        ([], [BELIEVED, HITCHES[1]], "belief.robot.trailers", "got 2; allowed: as many as robot")
    ],
    "_open_loop": [
        (
            [*OPEN_LOOP, "initial.kind=at_rest"],
            [*OPEN_LOOP, "initial.kind=on_reference"],
            "initial.kind",
            "got 'on_reference'; with reference.kind = 'none' there is no reference to start on",
        ),
        (
            ["initial.kind=on_reference"],
            [*OPEN_LOOP, "initial.kind=on_reference"],
            "initial.kind",
            "",
        ),
    ],
    "_contact_only": [
        ([PUSH], [PUSH, ANALYTIC], "plant.pushes", "only plant.kind = 'contact' can be pushed"),
        ([ANALYTIC], [PUSH, ANALYTIC], "plant.pushes", ""),
        (
            ["output.physics_rate=true"],
            ["output.physics_rate=true", ANALYTIC],
            "output.physics_rate",
            "got true; only plant.kind = 'contact'",
        ),
        ([ANALYTIC], ["output.physics_rate=true", ANALYTIC], "output.physics_rate", ""),
    ],
    "_terrain": [
        (
            [TERRAIN, "ground.terrain.correlation_length_m=2.0"],
            [TERRAIN, "ground.terrain.correlation_length_m=2.001"],
            "ground.terrain.correlation_length_m",
            "got 2.001; allowed: at most 2, the terrain's side (twice half_size_m)",
        )
    ],
    "_frames": [
        (
            ["output.save_frames=true", CAMERA],
            ["output.save_frames=true"],
            "output.save_frames",
            "got true; sensing.kind = 'truth' has no frames; use sensing.kind = 'camera'",
        ),
        ([], ["output.save_frames=true"], "output.save_frames", ""),
    ],
    "physics_steps": [
        (
            ["control.sampling_time_s=0.0335"],
            ["control.sampling_time_s=0.03325"],
            "control.sampling_time_s",
            "got 0.03325; allowed: a whole number of steps of 0.0005 s (plant.contact.timestep_s); "
            "nearest: 0.033 and 0.0335",
        ),
        (
            ["control.sampling_time_s=0.03325", ANALYTIC],
            ["control.sampling_time_s=0.03325"],
            "control.sampling_time_s",
            "",
        ),
        (
            ["control.sampling_time_s=0.0005"],
            ["control.sampling_time_s=0.0004"],
            "control.sampling_time_s",
            "nearest: 0.0005",
        ),
    ],
    "pushes": [
        ([PUSH], [BRIEF], "plant.pushes.0.duration_s", "at least one control period, 0.033 s")
    ],
    "motor_timing": [
        ([motor(0.001, 0.01, 0.002)], [motor(*faulty)], key, words)
        for faulty, key, words in (
            ((0.0011, 0.011, 0.0022), MOTOR + "loop_period_s", "nearest: 0.001 and 0.0015"),
            ((0.001, 0.0105, 0.002), MOTOR + "encoder_window_s", "nearest: 0.01 and 0.011"),
            ((0.001, 0.01, 0.0015), MOTOR + "command_delay_s", "nearest: 0.001 and 0.002"),
            ((0.002, 0.01, 0.002), "control.sampling_time_s", MOTOR + "loop_period_s"),
        )
    ],
    "_torques": [
        (
            ["control.inner_loop=computed_torque"],
            ["control.inner_loop=torque"],
            "control.inner_loop",
            "lyapunov commands wheel speeds, and no torques",
        )
    ],
    "_torque_input": [
        (
            ["plant.kind=analytic", "plant.analytic.published_spring=true"],
            [
                "plant.kind=analytic",
                "plant.analytic.published_spring=true",
                "control.inner_loop=computed_torque",
            ],
            "plant.analytic.published_spring",
            "which it cannot drive",
        )
    ],
    "latency": [
        (
            ["sensing.latency_s=0.066"],
            ["sensing.latency_s=0.05"],
            "sensing.latency_s",
            "of 0.033 s (control.sampling_time_s); nearest: 0.033 and 0.066",
        ),
        (
            ["sensing.latency_s=0.0"],
            ["sensing.latency_s=1e-9"],
            "sensing.latency_s",
            "nearest: 0 and 0.033",
        ),
        (
            ["sensing.latency_jitter_s=0.066"],
            ["sensing.latency_jitter_s=0.05"],
            "sensing.latency_jitter_s",
            "nearest: 0.033 and 0.066",
        ),
    ],
    "command_latency": [
        (
            ["control.command_jitter_s=0.033"],
            ["control.command_jitter_s=0.01"],
            "control.command_jitter_s",
            "nearest: 0 and 0.033",
        ),
        (
            ["control.command_latency_s=0.01"],
            ["control.command_latency_s=0.01025"],
            "control.command_latency_s",
            "(plant.contact.timestep_s)",
        ),
        (
            [ANALYTIC, "control.sampling_time_s=0.03325"],
            [ANALYTIC, "control.sampling_time_s=0.03325", "control.command_latency_s=0.01"],
            "control.sampling_time_s",
            "(plant.contact.timestep_s)",
        ),
        (
            ["control.command_latency_s=0.528"],
            ["control.command_latency_s=0.561"],
            "control.command_latency_s",
            "at most 16 control periods, 0.528 s",
        ),
        (
            ["control.command_latency_s=0.561", "belief.command_latency_s=0.0"],
            ["belief.command_latency_s=0.561"],
            "belief.command_latency_s",
            "at most 16 control periods",
        ),
    ],
    "_integration": [
        (
            [ANALYTIC, "robot.hitch.damping_n_m_s_rad=1.0"],
            [ANALYTIC, "robot.hitch.damping_n_m_s_rad=10.0"],
            "plant.analytic.max_step_s",
            "allowed: at most 0.0019",
        )
    ],
    "_believed_camera": [
        ([CAMERA, MOVED], [MOVED], "belief.camera", "sensing.kind is 'truth'"),
        (
            [CAMERA, MOVED],
            [CAMERA, MOVED, f"sensing.calibration_path={CALIBRATION}"],
            "belief.camera",
            "names a file",
        ),
        (
            [CAMERA, "belief.camera.height_px=480"],
            [CAMERA, "belief.camera.height_px=240"],
            "belief.camera.height_px",
            "480",
        ),
    ],
    "one_period": [
        (["duration_s=0.033"], ["duration_s=0.0329"], "duration_s", "one control period, 0.033")
    ],
    "_reference": [
        (
            ['reference={kind="planned",plan="rest_to_rest"}', *TABLE_ONE_TRAILER],
            ['reference={kind="planned",plan="rest_to_rest"}', "robot.trailer.mass_kg=0.5"],
            "reference.plan",
            "was made",
        )
    ],
    "_controller": [
        (
            ["controller.kind=tvlqr", "reference.theta2=outward"],
            ["controller.kind=tvlqr", "reference.theta2=none"],
            "reference.theta2",
            "got 'none'",
        )
    ],
}
CASES = [
    pytest.param(*case, id=f"{name}-{i}") for name in PAIRS for i, case in enumerate(PAIRS[name])
]


def refused(overrides: list[str]) -> InputError | None:
    data: dict[str, Any] = tomllib.loads(BASE)
    for override in overrides:
        set_value(data, override)
    try:
        check_scenario(data, "mine.toml")
    except InputError as error:
        return error
    return None


def test_no_check_is_forgotten() -> None:
    names = [check.faults.__name__ for check in CHECKS]
    assert [name for name in names if name != "train_faults"] == list(PAIRS)  # see test_train*


@pytest.mark.parametrize(("sound", "faulty", "key", "words"), CASES)
def test_a_check_finds_its_fault_and_is_silent_beside_it(
    sound: list[str], faulty: list[str], key: str, words: str
) -> None:
    assert refused(sound) is None
    error = refused(faulty)
    assert error is not None
    (fault,) = error.faults
    assert fault.where == key
    assert words in fault.message


def test_a_train_that_is_believed_as_it_is_has_no_fault() -> None:
    assert refused([TRAIN, BELIEVED, *HITCHES]) is None


@pytest.mark.parametrize(
    ("faulty", "expected"),
    [
        # each fault is said, and nothing about what has one already, or depends on it
        (
            ["reference.radius_m=-1.0", "control.sampling_time_s=0.03325"],
            ["reference.radius_m", "control.sampling_time_s"],
        ),
        (["control.sampling_time_s=0.0", "duration_s=0.01"], ["control.sampling_time_s"]),
        # a fault inside a list takes the list, not what stands beside it: the plant is analytic
        (
            [ANALYTIC, "control.sampling_time_s=0.03325", "plant.pushes=[{start_s=1.0}]"],
            ["plant.pushes.0.duration_s", "plant.pushes.0.force_n"],
        ),
        ([ANALYTIC, "plant.analytic.extended={}", PUSH], ["plant.pushes", "plant.analytic.exte"]),
        (["reference={}", "controller={}"], ["reference.kind", "controller.kind"]),
        (["robot.trailer=3", "robot.tractor.mass_kg=0.01"], ["robot.tractor", "robot.trailer"]),
        # items with faults, and pydantic's word that there are too few whole ones
        (
            [OPEN_LOOP[0], 'controller={kind="open_loop",segments=[{duration_s=1.0}]}'],
            ["controller.segments.0.wheel_right_rad_s", "controller.segments.0.wheel_left_rad_s"],
        ),
        (["name=B A D", CAMERA, "sensing.latency_s=0.05"], ["name", "sensing.latency_s"]),
    ],
)
def test_all_faults_come_at_once_and_none_that_follows(
    faulty: list[str], expected: list[str]
) -> None:
    error = refused(faulty)
    assert error is not None
    found = {fault.where for fault in error.faults}
    assert all(any(where.startswith(key) for key in expected) for where in found), found
    assert all(any(where.startswith(key) for where in found) for key in expected), found


def test_a_list_that_is_too_short_says_how_long_it_must_be() -> None:
    error = refused([OPEN_LOOP[0], 'controller={kind="open_loop",segments=[]}'])
    assert error is not None
    assert "controller.segments: got []; allowed: at least 1 of them" in str(error)


def test_a_law_is_asked_about_the_whole_run_and_what_it_looks_ahead() -> None:
    scenario = load_scenario("outer_circle", ["duration_s=3.3"])
    path = checks._path(scenario)
    assert path is not None
    # 100 periods, both ends, and 64 samples beyond
    assert len(path.time_s) == 165
    assert path.time_s[[0, -1]] == pytest.approx([0.0, 164 * 0.033], rel=1e-12)
