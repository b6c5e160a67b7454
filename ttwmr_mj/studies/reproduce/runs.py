"""Every run of the reproduction: a shipped scenario and what is changed in it.

`ttwmr run SCENARIO --set ...` with these overrides gives the same trajectory; so does
`ttwmr run runs/NAME/scenario.resolved.toml`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario

TRUTH: tuple[str, ...] = ()
CAMERA = (
    "sensing.kind=camera",
    "sensing.preset=lab",
    "sensing.latency_s=0.033",
    "sensing.calibration_path=calibration/lab_camera.yaml",
)
# Figs. 11-19 show an experiment with a camera in the loop. With CAMERA here, their claims are
# judged; with TRUTH the verdict is "evidence missing".
EXPERIMENT_SENSING: tuple[str, ...] = CAMERA

HITCH_FRICTION_N_M = 1e-3  # of the laboratory's hitch: assumed; see the friction sweep
SWEEP_FRICTION_N_M = (0.0, 3e-5, 1e-4, 2e-4, 2.5e-4, 3e-4, 3.5e-4, 5e-4, 1e-3, 1e-1)
PRINTED_AS_TORQUE = 9.306  # N·m/rad: what 200 in Eq. 41 amounts to, 200·m2·l


@dataclass(frozen=True, slots=True)
class RunSpec:
    """One run.

    Attributes:
        name: of its folder under runs/.
        base: the shipped scenario.
        overrides: `key.path=value`, as on the command line.
        recording: whether it leaves a run.rrd.
    """

    name: str
    base: str
    overrides: tuple[str, ...]
    recording: bool = True

    def scenario(self) -> Scenario:
        """The scenario, checked."""
        told = [
            *self.overrides,
            f"name={self.name}",
            f"output.recording={str(self.recording).lower()}",
            "output.figures=false",
        ]
        return load_scenario(self.base, told)

    def command(self) -> list[str]:
        """How to run it alone, word by word."""
        told = (word for override in self.overrides for word in ("--set", override))
        return ["ttwmr", "run", self.base, *told]


FREE = ("robot.hitch.damping_n_m_s_rad=0.0",)
ANALYTIC = ("plant.kind=analytic",)
CONTACT = ("plant.kind=contact",)
PRINTED = ("controller.singular_terms=published",)
FAST = ("robot.servo.preset=fast",)
ALIGNED, OUTWARD = ("reference.theta2=aligned",), ("reference.theta2=outward",)
PID = ("controller.kind=lyapunov_pid",)
EXACT = ("controller.gamma=exact",)
PLANTS = {"analytic": ANALYTIC, "contact": CONTACT}


def _spring(value: float) -> tuple[str, ...]:
    return (
        f"robot.hitch.stiffness_n_m_rad={value}",
        f"robot.hitch.damping_n_m_s_rad={value}",
    )


def _simulated_circle() -> list[RunSpec]:
    """Figs. 3-6: Eq. 37 from Table II's start, free hitch, then spring and damper at P."""
    runs = []
    for terms, told in (("omitted", ()), ("published", PRINTED)):
        for plant, kind in PLANTS.items():
            runs.append(
                RunSpec(f"law32-{terms}-{plant}", "sim_circle", kind + FREE + ALIGNED + told)
            )
    # divided by k as printed, 200/k is 1268 1/s: the analytic plant is stable below 2 ms
    printed = ("plant.analytic.published_spring=true", "plant.analytic.max_step_s=0.0018")
    for terms, told in (("omitted", ()), ("published", PRINTED)):
        runs += [
            RunSpec(
                f"spring-printed-{terms}-analytic",
                "sim_circle",
                ANALYTIC + _spring(200.0) + printed + ALIGNED + told,
            ),
            RunSpec(
                f"spring-printed-{terms}-contact",
                "sim_circle",
                CONTACT + _spring(PRINTED_AS_TORQUE) + ALIGNED + told,
            ),
        ]
    runs.append(RunSpec("spring-divided-contact", "sim_circle", CONTACT + _spring(200.0) + ALIGNED))
    return runs


def _simulated_lab() -> list[RunSpec]:
    """Figs. 7-8: Eq. 72-73 under the Lyapunov-PID laws, free hitch, a servo that keeps up.

    "printed" has e²/ė, "constant" and "exact" are without: the kinder reading of law (70) and (47).
    """
    runs = []
    for plant, kind in PLANTS.items():
        for theta2, reference in (("aligned", ALIGNED), ("outward", OUTWARD)):
            runs.append(
                RunSpec(
                    f"pid-constant-{theta2}-{plant}",
                    "lab_circle",
                    kind + FREE + FAST + reference + PID,
                )
            )
        runs.append(
            RunSpec(
                f"pid-exact-aligned-{plant}",
                "lab_circle",
                kind + FREE + FAST + ALIGNED + PID + EXACT,
            )
        )
        runs += [
            RunSpec(
                f"pid-printed-aligned-{plant}",
                "lab_circle",
                kind + FREE + FAST + ALIGNED + PID + PRINTED,
            ),
            RunSpec(f"pid-without-{plant}", "lab_circle", kind + FREE + FAST + ALIGNED),
        ]
    virtual = (*PID, *EXACT, "controller.correction=spring_damper")
    runs.append(
        RunSpec("virtual-spring-analytic", "lab_circle", ANALYTIC + FREE + FAST + ALIGNED + virtual)
    )
    return runs


def _laboratory() -> list[RunSpec]:
    """Figs. 11-19: contact physics, lab servo, dry hitch friction."""
    hitch = (*FREE, f"robot.hitch.coulomb_friction_n_m={HITCH_FRICTION_N_M:g}")
    lab = (*CONTACT, *hitch, *ALIGNED, *EXPERIMENT_SENSING)
    return [
        RunSpec("lab-pid", "lab_circle", lab + PID),
        RunSpec("lab-pid-without", "lab_circle", lab),
        RunSpec("lab-analytic", "lab_circle", (*ANALYTIC, *hitch, *ALIGNED)),
        RunSpec("eight-pid", "figure_eight", lab + PID),
        RunSpec("eight-pid-without", "figure_eight", lab),
    ]


def _disturbed() -> list[RunSpec]:
    """The lab circle with noise as of the labels, while no camera makes its own."""
    noise = (
        "sensing.position_noise_m=0.0002",
        "sensing.angle_noise_rad=0.001",
        "sensing.velocity_noise_m_s=0.0021",  # differences over four frames
        "sensing.rate_noise_rad_s=0.0107",
        "sensing.latency_s=0.033",
    )
    return [
        replace(spec, name=f"{spec.name}-disturbed", overrides=spec.overrides + noise)
        for spec in _laboratory()[:2]
        if EXPERIMENT_SENSING == TRUTH
    ]


def _gains() -> list[RunSpec]:
    """All α halved and doubled: "higher gains, better performance"."""
    return [
        RunSpec(
            f"gains-{name}",
            "lab_circle",
            (
                *ANALYTIC,
                *FREE,
                *FAST,
                *ALIGNED,
                *(f"controller.alpha{i}={25.0 * scale}" for i in (1, 3)),
                *(f"controller.alpha{i}={10.0 * scale}" for i in (2, 4)),
            ),
            recording=False,
        )
        for name, scale in (("half", 0.5), ("double", 2.0))
    ]


def _choices() -> list[RunSpec]:
    """What the article leaves open, tried out: is there a reading of law (47)/(70) that works?"""
    runs = []
    limits: dict[str, tuple[str, ...]] = {
        "unlimited": (),
        "limit-10": ("controller.gamma_limit=10.0", "controller.anti_windup=conditional"),
        "limit-1": ("controller.gamma_limit=1.0", "controller.anti_windup=conditional"),
    }
    for gamma in ("constant", "exact", "regularized"):
        for limit, told in limits.items():
            for theta2, reference in (("aligned", ALIGNED), ("outward", OUTWARD)):
                runs.append(
                    RunSpec(
                        f"choice-{gamma}-{limit}-{theta2}",
                        "lab_circle",
                        (
                            *ANALYTIC,
                            *FREE,
                            *FAST,
                            *reference,
                            *PID,
                            f"controller.gamma={gamma}",
                            *told,
                        ),
                        recording=False,
                    )
                )
    return runs


def _friction() -> list[RunSpec]:
    """The lab circle, entered on the reference with the trailer aligned, at many frictions."""
    on_reference = ("initial={kind='on_reference'}", *ALIGNED, *CONTACT, *FREE)
    runs = [
        RunSpec(
            friction_run(friction),
            "lab_circle",
            (*on_reference, f"robot.hitch.coulomb_friction_n_m={friction:g}", "duration_s=45.0"),
            recording=False,
        )
        for friction in SWEEP_FRICTION_N_M
    ]
    viscous = ("robot.hitch.damping_n_m_s_rad=0.001", "duration_s=45.0")
    return [
        *runs,
        RunSpec("friction-viscous", "lab_circle", on_reference + viscous, recording=False),
    ]


def friction_run(friction_n_m: float) -> str:
    """Name of a run of the friction sweep."""
    return f"friction-{friction_n_m * 1e6:.0f}-unm"


RUNS: dict[str, RunSpec] = {
    spec.name: spec
    for group in (
        _simulated_circle,
        _simulated_lab,
        _laboratory,
        _disturbed,
        _gains,
        _choices,
        _friction,
    )
    for spec in group()
}

# law (70) and law (32) under disturbance: a camera's own, or noise like it
DISTURBED = tuple(
    name if EXPERIMENT_SENSING != TRUTH else f"{name}-disturbed"
    for name in ("lab-pid", "lab-pid-without")
)
