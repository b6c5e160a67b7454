"""Which runs are drawn side by side."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes: a title and the runs drawn in it, (name, label)."""

    title: str
    runs: tuple[tuple[str, str], ...]


def _both_plants(stem: str) -> tuple[tuple[str, str], ...]:
    return ((f"{stem}-analytic", "analytic model"), (f"{stem}-contact", "contact physics"))


LAW_32 = (
    Panel("law (32) as printed", _both_plants("law32-published")),
    Panel("without e²/ė", _both_plants("law32-omitted")),
)
SPRUNG = (
    Panel("law (32) as printed", _both_plants("spring-printed-published")),
    Panel(
        "without e²/ė",
        (*_both_plants("spring-printed-omitted"), ("spring-divided-contact", "200 N·m/rad")),
    ),
)
PID = (
    Panel("law (70) as printed", _both_plants("pid-printed-aligned")),
    Panel("law (70) without e²/ė", _both_plants("pid-constant-aligned")),
    Panel("law (47) without e²/ė", _both_plants("pid-exact-aligned")),
    Panel("law (32) without e²/ė", _both_plants("pid-without")),
)
LAB = (
    Panel("law (70) without e²/ė", (("lab-pid", "contact physics"),)),
    Panel("law (32) without e²/ė", (("lab-pid-without", "contact physics"),)),
)
LAB_IN_ONE = (
    Panel("", (("lab-pid", "law (70) without e²/ė"), ("lab-pid-without", "law (32) without e²/ė"))),
)
EIGHT = (
    Panel("law (70) without e²/ė", (("eight-pid", "contact physics"),)),
    Panel("law (32) without e²/ė", (("eight-pid-without", "contact physics"),)),
)
LYAPUNOV_RUNS = (
    ("law32-published-analytic", "law (32) as printed, model"),
    ("law32-published-contact", "law (32) as printed, contact"),
    ("law32-omitted-analytic", "without e²/ė, model"),
    ("law32-omitted-contact", "without e²/ė, contact"),
    ("pid-constant-aligned-contact", "law (70), contact"),
    ("pid-exact-aligned-contact", "law (47), contact"),
)
