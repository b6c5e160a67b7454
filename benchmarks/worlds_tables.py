"""What `worlds.py` runs: tables of README and docs, a scenario and overrides for each cell."""

from __future__ import annotations

from typing import NamedTuple

from ttwmr_mj.assets import shipped_scenarios


class Cell(NamedTuple):
    """One number of a table."""

    scenario: str
    sets: tuple[str, ...] = ()
    measured: str = "F"  # F, P, FP: rms of the second half; end: P, COM and angles at the end


class Table(NamedTuple):
    """Rows of cells, one for each head; None where there is nothing to measure."""

    heads: tuple[str, ...]
    rows: dict[str, list[Cell | None]]


DRY = "robot.hitch.coulomb_friction_n_m=0.001"
LESS = "belief.robot.hitch.coulomb_friction_n_m=0.0007"
MORE = "belief.robot.hitch.coulomb_friction_n_m=0.0013"
TRUTH = 'sensing={kind="truth"}'
COMPUTED = "control.inner_loop=computed_torque"
ANALYTIC = "plant.kind=analytic"
MOTOR = "robot.servo.motor={}"
OUTSIDE = 'reference.side="outside"'
SIDES = ("inside", "outside")


def law(kind: str) -> str:
    return f'controller={{kind="{kind}"}}'


def _readme() -> Table:
    rows: dict[str, list[Cell | None]] = {
        "lab circle, law (32): P": [Cell("lab_circle", (), "P")],
        "1 m circle: P": [Cell("sim_circle", (), "P")],
        "lab circle, analytic plant: P": [Cell("lab_circle", (ANALYTIC,), "P")],
        "1 m circle, analytic plant: P": [Cell("sim_circle", (ANALYTIC,), "P")],
        "lab circle by camera: P": [Cell("lab_circle_camera", (), "P")],
        "lab servo, inside, camera": [Cell("lab_servo_inverted")],
    }
    circle = "inverted_trailer_camera"
    for side, truth, sets in (
        ("outside", "outer_circle", (OUTSIDE,)),
        ("inside", "inverted_trailer", ()),
    ):
        rows[f"{side}, truth"] = [Cell(truth)]
        rows[f"{side}, camera"] = [Cell(circle, sets)]
        rows[f"{side}, camera and friction"] = [Cell(circle, (*sets, DRY))]
    for name, sets in (("camera", ()), ("camera and friction", (DRY,))):
        rows[f"figure eight, {name}"] = [Cell("flat_figure_eight_camera", sets)]
        rows[f"rest to rest, {name}"] = [Cell("rest_to_rest_camera", sets, "end")]
    rows["figure eight, truth"] = [Cell("flat_figure_eight")]
    rows["rest to rest, truth"] = [Cell("rest_to_rest", (), "end")]
    return Table(("measured",), rows)


def _laws() -> Table:
    laws = ("flatness", "tvlqr", "mpc")
    rows: dict[str, list[Cell | None]] = {}
    for name, truth, side in (
        ("outside", "outer_circle", (OUTSIDE,)),
        ("inside", "inverted_trailer", ()),
    ):
        camera = "inverted_trailer_camera"
        rows[f"{name}, truth"] = [Cell(truth, (law(kind),)) for kind in laws]
        rows[f"{name}, camera"] = [Cell(camera, (law(kind), *side)) for kind in laws]
        rows[f"{name}, camera, 1e-3 N·m"] = [Cell(camera, (law(k), *side, DRY)) for k in laws]
        for words, told in (("less", LESS), ("more", MORE)):
            believed = f"{name}, camera, 1e-3 N·m, believed 30 % {words}"
            rows[believed] = [Cell(camera, (law("flatness"), *side, DRY, told)), None, None]
    for words, name, sets in (
        ("truth", "flat_figure_eight", ()),
        ("camera", "flat_figure_eight_camera", ()),
        ("camera, 1e-3 N·m", "flat_figure_eight_camera", (DRY,)),
        ("truth, 1e-3 N·m, believed 30 % less", "flat_figure_eight", (DRY, LESS)),
        ("truth, 1e-3 N·m, believed 30 % more", "flat_figure_eight", (DRY, MORE)),
    ):
        cells: list[Cell | None] = [Cell(name, (law(kind), *sets)) for kind in laws[1:]]
        rows[f"figure eight, {words}"] = [None, *cells]
    return Table(laws, rows)


def _rest() -> Table:
    camera = "rest_to_rest_camera"
    rows: dict[str, list[Cell | None]] = {}
    for words, name, sets in (
        ("truth", "rest_to_rest", ()),
        ("camera", camera, ()),
        ("camera, 1e-3 N·m", camera, (DRY,)),
        ("camera, 1e-3 N·m, believed 30 % less", camera, (DRY, LESS)),
        ("camera, 1e-3 N·m, believed 30 % more", camera, (DRY, MORE)),
    ):
        rows[words] = [Cell(name, (law(kind), *sets), "end") for kind in ("tvlqr", "mpc")]
    return Table(("tvlqr", "mpc"), rows)


def _servo() -> Table:
    """The laboratory's servo, with true states, inside and outside a circle of 0.3 m."""
    outside = (OUTSIDE, "reference.angular_rate_rad_s=0.7")
    heads = tuple(f"{kind} {side}" for kind in ("mpc", "flatness", "tvlqr") for side in SIDES)
    rows: dict[str, list[Cell | None]] = {}
    for friction in ("0", "0.1e-3", "1e-3", "3e-3", "10e-3", "50e-3"):
        dry = f"robot.hitch.coulomb_friction_n_m={float(friction)}"
        rows[f"{friction} N·m"] = [
            Cell("lab_servo_inverted", (TRUTH, law(kind), dry, *sets))
            for kind in ("mpc", "flatness", "tvlqr")
            for sets in ((), outside)
        ]
    return Table(heads, rows)


def _disturbances() -> Table:
    inverted_only = (
        ("sensing.camera.yaw_rad=0.1",),
        ("sensing.camera.exposure.exposure_s=0.016",),
        ("sensing.camera.lens.defocus_px=2.0",),
        ("control.command_latency_s=0.033", "belief.command_latency_s=0.0"),
    )
    both = (
        (),
        ("sensing.camera.x_m=0.01",),
        ("sensing.camera.roll_rad=0.00873",),
        ("sensing.clock_offset_s=0.01",),
        ("sensing.camera.exposure.exposure_s=0.033",),
        ("sensing.camera.exposure.rolling_shutter_s=0.015",),
        ("belief.latency_s=0.0",),
        ("sensing.latency_jitter_s=0.033",),
        ("sensing.drop_probability=0.1",),
        ("control.command_latency_s=0.033",),
        ("control.command_drop_probability=0.05",),
        ("control.command_jitter_s=0.033",),
    )
    rows: dict[str, list[Cell | None]] = {}
    for sets in (*both, *inverted_only):
        circle = Cell("lab_circle_camera", sets, "P") if sets in both else None
        name = "; ".join(f"`{key}`" for key in sets) or "as shipped"
        rows[name] = [Cell("inverted_trailer_camera", sets, "FP"), circle]
    return Table(("inverted", "lab circle"), rows)


def _motor() -> Table:
    off = (
        "gear_friction_n_m=0.0",
        "gear_damping_n_m_s_rad=0.0",
        "dead_band_v=0.0",
        "pwm_steps=0",
        "encoder_counts_per_turn=0",
        "command_delay_s=0.0",
    )

    def but(*keys: str) -> str:
        kept = [word for word in off if word.split("=")[0] not in {k.split("=")[0] for k in keys}]
        return ", ".join((*kept, *(key for key in keys if "=" in key)))

    motors = {
        "OFF": but(),
        "OFF, gear friction and damping of the preset": but(
            "gear_friction_n_m", "gear_damping_n_m_s_rad"
        ),
        "OFF, `dead_band_v=0.5`": but("dead_band_v=0.5"),
        "OFF, `pwm_steps=1023`": but("pwm_steps=1023"),
        "OFF, `pwm_steps=32`": but("pwm_steps=32"),
        "OFF, `encoder_counts_per_turn=1229`": but("encoder_counts_per_turn=1229"),
        "OFF, `command_delay_s=0.001`": but("command_delay_s=0.001"),
        "OFF, `command_delay_s=0.01`": but("command_delay_s=0.01"),
        "OFF, `command_delay_s=0.02`": but("command_delay_s=0.02"),
        "`{}`: all of the preset": "",
        "`supply_voltage_v=9.0`": "supply_voltage_v=9.0",
        "`speed_gain_v_s_rad=0.0, speed_integral_gain_v_rad=0.0`": (
            "speed_gain_v_s_rad=0.0, speed_integral_gain_v_rad=0.0"
        ),
    }
    rows: dict[str, list[Cell | None]] = {
        "no motor": [Cell("lab_circle", (), "P"), Cell("inverted_trailer")]
    }
    for name, keys in motors.items():
        sets = (f"robot.servo.motor={{{keys}}}",)
        rows[name] = [Cell("lab_circle", sets, "P"), Cell("inverted_trailer", sets)]
    return Table(("`lab_circle`, P", "`inverted_trailer`, F"), rows)


def _torques() -> Table:
    rows: dict[str, list[Cell | None]] = {}
    for name, measured in (("lab_circle", "P"), ("inverted_trailer", "F")):
        for words, sets in (("", ()), (f", `{ANALYTIC}`", (ANALYTIC,)), (f", `{MOTOR}`", (MOTOR,))):
            both = ((), (COMPUTED,))
            rows[f"`{name}`, {measured}{words}"] = [
                Cell(name, (*sets, *loop), measured) for loop in both
            ]
    camera = "inverted_trailer_camera"
    rows[f"`{camera}`, F"] = [Cell(camera), Cell(camera, (COMPUTED,))]
    return Table(("velocity servo", "computed torque"), rows)


def _floor() -> Table:
    unequal = "robot.tractor.wheel_radius_difference_m"
    disc = '[{shape="disc",friction=0.05,x_m=0.6,y_m=0.0,radius_m=0.2}]'
    rows: dict[str, list[Cell | None]] = {
        "(none)": [Cell("inverted_trailer", (), "FP"), None, None]
    }
    for key, value in (
        ("ground.slope_rad", "0.0087"),
        ("robot.casters.rolling_resistance_m", "1e-4"),
        ("robot.casters.socket_friction_n_m", "1e-4"),
        (unequal, "2.6e-4"),
        ("robot.trailer.com_lateral_m", "0.005"),
    ):
        true, untold = f"{key}={value}", f"belief.{key}=0.0"
        told = Cell("inverted_trailer", (true, f"belief.{key}={value}"), "FP")
        plain = Cell("inverted_trailer", (true, untold), "FP")
        analytic = Cell("inverted_trailer", (true, untold, ANALYTIC))
        rows[f"`{true}`"] = [told, plain, analytic]
    for what in ("robot.hitch.play_m=2e-4", "robot.hitch.play_m=1e-3", f"ground.regions={disc}"):
        rows[f"`{what}`"] = [None, Cell("inverted_trailer", (what,), "FP"), None]
    return Table(("told, F (P)", "untold, F (P)", "untold, analytic plant, F"), rows)


def _verdicts() -> Table:
    """Every shipped scenario that has a reference."""
    names = [name for name in shipped_scenarios() if name != "open_loop_turn"]
    return Table(("F (P)",), {f"`{name}`": [Cell(name, (), "FP")] for name in names})


TABLES = {
    "verdicts": _verdicts(),
    "readme": _readme(),
    "laws": _laws(),
    "rest": _rest(),
    "servo": _servo(),
    "disturbances": _disturbances(),
    "motor": _motor(),
    "torques": _torques(),
    "floor": _floor(),
}
