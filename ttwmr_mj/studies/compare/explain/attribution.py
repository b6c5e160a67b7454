"""How much of the deviation each effect contributes: a factorial design around both ends.

Let δ(S) be the deviation over time, contact physics minus analytic model, with the effects S on in
both plants, under one command history. The ideal is δ(∅), the full model δ(all). For an effect e

    alone      A = δ({e} ∪ n) − δ(n)              n: what e needs, else nothing
    removed    O = δ(all − d) − δ(all − d − {e})  d: what needs e, else nothing

Both are vectors over time, so they add. Half their sum, C = (A + O)/2, is e's Shapley value as far
as interactions of two effects go: each is shared evenly by the two. What three or more do together
is the row of higher interactions, H = δ(all) − δ(∅) − Σ C. The unexplained remainder is R:

    δ(all) = Σ C + H + R

Three effects cannot be switched off completely: the ideal still has a step, a stiffness, balls of
some mass. The deviation is proportional to them (`convergence` measures it), so their A and O are
extrapolated from the share that was removed to all of it, and R is what this leaves. Friction in
the hitch, which the analytic model has too, changes what the ideal's rest of them does, and seems
to do something alone: its A is extrapolated from ideals of all and of half of that rest.

Over time each adds to the deviation by its part along it: of P, C·δ/|δ| at every sample, which make
|δ|; of an angle, C itself, which make δ.

To get numbers, each is projected onto the total: c = ⟨C, δ⟩/‖δ‖², times the rms of δ. The column
adds up to the total, exactly. A negative contribution reduces the total.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ttwmr_mj.robot.parameters import MOST_TRAILERS
from ttwmr_mj.scenario.schema import Scenario
from ttwmr_mj.state import FloatArray
from ttwmr_mj.studies.compare.explain.convergence import refined
from ttwmr_mj.studies.compare.explain.deviations import deviation_under
from ttwmr_mj.studies.compare.explain.effects import EFFECTS, with_effects
from ttwmr_mj.studies.compare.measures.deviation import rms
from ttwmr_mj.studies.compare.variants import Progress, in_threads

EXPLAINED_REST = 0.1  # share of the total up to which the rest needs no explanation
LARGE_RAD = 0.5  # deviation of θ2 (rms) beyond which effects no longer add up


TRAILERS = {f"theta{i}": f"θ{i}" for i in range(2, MOST_TRAILERS + 2)}


def unit_of(quantity: str) -> str:
    """Of "position" or of an angle."""
    return "m" if quantity == "position" else "rad"


def _columns(width: int) -> dict[str, list[int]]:
    """Columns of Deviation.q, of which there are 3 and one for each trailer, by quantity."""
    return {"position": [0, 1], **{f"theta{i}": [i + 1] for i in range(1, width - 1)}}


@dataclass(frozen=True, slots=True)
class Contribution:
    """One line of a table, in the quantity's unit."""

    name: str  # of the effect, or "higher_interactions", "rest", "total"
    alone: float | None  # switched on from the ideal; None where that means nothing
    interaction: float | None  # half of (removed − alone)
    size: float  # alone + interaction; these add up to the total
    share: float | None  # size per total; None if the total is zero
    rms: float  # over time, whatever its direction

    def as_json(self, unit: str) -> dict[str, float | None]:
        """Plain data with the unit in the keys."""
        return {
            f"alone_{unit}": self.alone,
            f"interaction_{unit}": self.interaction,
            f"contribution_{unit}": self.size,
            "share": self.share,
            f"rms_{unit}": self.rms,
        }


@dataclass(frozen=True, slots=True)
class Attribution:
    """What each effect contributes to the deviation.

    Attributes:
        present: effects the scenario has; the others contribute nothing.
        tables: quantity ("position", "theta1", "theta2", …) → contributions, the total last.
        curves: quantity → the same names → (n,) what each adds at every sample; all but the total
            make the total.
        time_s: (n,) of the samples.
    """

    present: tuple[str, ...]
    tables: dict[str, tuple[Contribution, ...]]
    curves: dict[str, dict[str, FloatArray]] = field(default_factory=dict)
    time_s: FloatArray = field(default_factory=lambda: np.zeros(0))

    def as_json(self) -> dict[str, Any]:
        """Plain data with the unit in the keys."""
        tables = {
            quantity: {row.name: row.as_json(unit_of(quantity)) for row in rows}
            for quantity, rows in self.tables.items()
        }
        notes = {name: note for name in self.tables if (note := self.note(name))}
        solver = {name: self.solver_share(name) for name in self.tables}
        return {"present": list(self.present), **tables, "notes": notes, "solver_share": solver}

    def to_table(self) -> Any:
        """attribution.parquet, a `pyarrow.Table`: a column per quantity and contribution."""
        import pyarrow as pa

        columns = {"time_s": self.time_s}
        for quantity, curves in self.curves.items():
            unit = unit_of(quantity)
            columns |= {f"{quantity}_{name}_{unit}": values for name, values in curves.items()}
        return pa.table(columns)

    def solver_share(self, quantity: str) -> float | None:
        """What the solver's own effects contribute, per total; None if the total is zero."""
        own = {effect.name for effect in EFFECTS if effect.solver}
        shares = [row.share for row in self.tables[quantity] if row.name in own]
        known = [share for share in shares if share is not None]
        return sum(known) if len(known) == len(shares) else None

    def note(self, quantity: str) -> str | None:
        """Why the remainder is more than a tenth of the total; None if it is not."""
        *effects, _, rest, _ = self.tables[quantity]
        if rest.share is None or abs(rest.share) <= EXPLAINED_REST:
            return None
        apart = max(rows[-1].rms for name, rows in self.tables.items() if name in TRAILERS)
        if apart > LARGE_RAD:
            return (
                f"the remainder is large because the trailers are {apart:.2g} rad apart and pull "
                "in different directions: where small effects decide which way an unstable or "
                "spinning trailer goes, they do not add up; compare over a shorter time "
                "(--set duration_s=...)"
            )
        gross = sum(abs(row.size) for row in effects)
        return (
            "the remainder is large relative to the total because effects cancel, or do not add "
            "up where a trailer is unstable; it is "
            f"{100 * abs(rest.size) / gross:.1f} % of the sum of their magnitudes"
        )


def attribute(
    scenario: Scenario,
    commands: FloatArray,
    progress: Progress | None = None,
    *,
    real_wheels: bool = False,
) -> Attribution:
    """Run the design around a full model and make the tables.

    Args:
        scenario: the full model.
        commands: wheel speeds (n, 2) (right, left), one per control period [rad/s].
        progress: called with the share of the work done.
        real_wheels: drive the analytic model with each variant's actual wheel speeds. The servo
            then has no part in the deviation, and stays as it is in every variant.
    """
    studied = [effect for effect in EFFECTS if not (real_wheels and effect.wheels)]
    present = [effect for effect in studied if effect.present(scenario)]
    names = frozenset(effect.name for effect in present)
    # effect → the sets with it and without it: near the ideal, near the full model
    pairs: dict[str, tuple[frozenset[str], ...]] = {}
    for effect in present:
        it, below = {effect.name}, names.intersection(effect.needs)
        above = names - {other.name for other in present if effect.name in other.needs}
        pairs[effect.name] = (below | it, below, above, above - it)

    deviation = deviation_under(commands, real_wheels=real_wheels)
    sets = sorted({frozenset(), names}.union(*pairs.values()), key=sorted)
    nearer = [on for effect in present if effect.shared for on in pairs[effect.name][:2]]
    variants = [with_effects(scenario, on, present) for on in sets]
    variants += [refined(with_effects(scenario, on, present), 1, servo=False) for on in nearer]
    found = [apart.q for apart in in_threads(deviation, variants, progress)]
    delta = dict(zip(sets, found, strict=False))
    delta_nearer = dict(zip(nearer, found[len(sets) :], strict=True))
    contributions = {}
    higher = delta[names] - delta[frozenset()]
    for effect in present:
        ideal_with, ideal, full, full_without = (delta[on] for on in pairs[effect.name])
        alone, removed = ideal_with - ideal, full - full_without
        higher -= 0.5 * (removed + alone)
        if effect.shared:
            half_as_far, ideal = (delta_nearer[on] for on in pairs[effect.name][:2])
            alone = 2.0 * (half_as_far - ideal) - alone
        reach = effect.reach(scenario)
        contributions[effect.name] = (alone / reach, 0.5 * (removed - alone) / reach)
    tables, curves = {}, {}
    for quantity, columns in _columns(higher.shape[1]).items():
        tables[quantity] = table(contributions, higher, delta[names], columns)
        curves[quantity] = over_time(contributions, higher, delta[names], columns)
    time_s = scenario.control.sampling_time_s * np.arange(len(higher), dtype=np.float64)
    return Attribution(tuple(e.name for e in present), tables, curves, time_s)


def table(
    contributions: dict[str, tuple[FloatArray, FloatArray]],
    higher: FloatArray,
    total: FloatArray,
    columns: list[int],
) -> tuple[Contribution, ...]:
    """The table of one quantity.

    Args:
        contributions: effect → alone and interaction over time, (n, 4) each.
        higher: (n, 4) the higher interactions.
        total: (n, 4) δ(all).
        columns: of δ, that make the quantity.
    """
    whole = total[:, columns]
    size, power = _size(whole), float((whole**2).sum())

    def row(name: str, part: FloatArray, alone: FloatArray | None = None) -> Contribution:
        along = project(part)
        first = None if alone is None else project(alone)
        second = None if first is None else along - first
        share = along / size if size else None
        return Contribution(name, first, second, along, share, _size(part[:, columns]))

    def project(part: FloatArray) -> float:
        return float((part[:, columns] * whole).sum() / power) * size if size else 0.0

    parts = _parts(contributions, higher, total)
    return tuple(
        row(name, part, *([contributions[name][0]] if name in contributions else []))
        for name, part in parts.items()
    )


def over_time(
    contributions: dict[str, tuple[FloatArray, FloatArray]],
    higher: FloatArray,
    total: FloatArray,
    columns: list[int],
) -> dict[str, FloatArray]:
    """What each adds to one quantity at every sample (n,); arguments as `table`."""
    whole = total[:, columns]
    size = np.hypot.reduce(whole, axis=1)[:, None]
    # an angle deviates to one side or the other; a point has no side, only a distance
    along = whole / np.where(size > 0.0, size, 1.0) if len(columns) > 1 else np.ones_like(whole)
    parts = _parts(contributions, higher, total)
    return {name: (part[:, columns] * along).sum(axis=1) for name, part in parts.items()}


def _parts(
    contributions: dict[str, tuple[FloatArray, FloatArray]], higher: FloatArray, total: FloatArray
) -> dict[str, FloatArray]:
    """All rows of a table over time (n, 4), the total last."""
    effects = {name: alone + interaction for name, (alone, interaction) in contributions.items()}
    rest = total - sum(effects.values(), higher)
    return {**effects, "higher_interactions": higher, "rest": rest, "total": total}


def _size(part: FloatArray) -> float:
    """Rms over time of a vector (n, columns)."""
    return rms(np.hypot.reduce(part, axis=1))
