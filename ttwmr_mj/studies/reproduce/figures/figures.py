"""Every figure of the report (figures.toml): what it shows, and what the article reports of it."""

from dataclasses import dataclass
from typing import Any

from ttwmr_mj.studies.reproduce.claims.computed import Numbers
from ttwmr_mj.studies.reproduce.claims.limits import LIMITS
from ttwmr_mj.studies.reproduce.evidence import Evidence
from ttwmr_mj.studies.reproduce.words import mm, read_toml, told


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes: a title and the runs drawn in it, (name, label)."""

    title: str
    runs: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class FigureSpec:
    """One figure."""

    name: str  # as in `--only`
    kind: str  # how it is drawn, a key of `drawings.DRAWERS`
    panels: tuple[Panel, ...]  # the runs in it
    title: str  # its heading
    reported: str  # what the article says it shows
    found: str  # what our runs show, with numbers in braces
    metric: str  # whose value in every run is the number `errors`; "": of none
    numbers: Numbers  # what else is told, and all runs and studies that are needed

    def caption(self, evidence: Evidence) -> str:
        """What our runs show."""
        values = LIMITS | self.numbers.values(evidence)
        return told(self.found, {**values, "errors": self._errors(evidence)})

    def _errors(self, evidence: Evidence) -> str:
        """The metric of every run, panel by panel."""
        parts = []
        for panel in self.panels if self.metric else ():
            runs = ((evidence.value(run, self.metric), label) for run, label in panel.runs)
            parts.append(f"{panel.title}: {', '.join(f'{mm(m)} ({label})' for m, label in runs)}")
        return "; ".join(parts)


def _figure(name: str, entry: dict[str, Any], every_panel: dict[str, Any]) -> FigureSpec:
    panels = tuple(
        Panel(title, tuple((run, label) for label, run in runs.items()))
        for title, runs in every_panel.get(entry.get("panels", ""), {}).items()
    )
    shown = tuple(run for panel in panels for run, _ in panel.runs)
    return FigureSpec(
        name=name,
        kind=entry["kind"],
        panels=panels,
        title=entry["title"],
        reported=entry["reported"],
        found=entry["found"],
        metric=entry.get("metric", ""),
        numbers=Numbers.of(entry, shown),
    )


def _read() -> dict[str, FigureSpec]:
    read = read_toml(__package__, "figures.toml")
    panels = read.pop("panels")
    return {name: _figure(name, entry, panels) for name, entry in read.items()}


FIGURES = _read()
