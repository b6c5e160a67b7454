"""The file of a sweep: which scenario, what is varied, how it is sampled."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, ValidationError

from ttwmr_mj.assets import sweeps_folder
from ttwmr_mj.config import NAME, WORD, Config
from ttwmr_mj.errors import Fault, InputError, shown
from ttwmr_mj.files import is_file, read_toml, require_none_but_files
from ttwmr_mj.results.metrics import METRICS
from ttwmr_mj.scenario.faults import MOST_FAULTS, faults_of, suggestion
from ttwmr_mj.scenario.file import paths_set
from ttwmr_mj.studies.bench.suite import is_suite
from ttwmr_mj.studies.sweep.plan.axes import OWN_KEYS, Axis, Table, as_toml, axes_of, split_belief
from ttwmr_mj.studies.sweep.plan.parameters import Range, Value

Sampling = Literal["grid", "random", "latin_hypercube", "sobol"]
Seed = Annotated[int, Field(ge=0, lt=2**32)]
Name = Annotated[str, Field(pattern=WORD)]
MOST_SEEDS = 1_000_000


class Variant(Config):
    """One of several scenarios side by side, such as a law: what it changes."""

    overrides: list[str] = Field(default=[], description="key.path=value, as for --set")


class SweepFile(Config):
    """A sweep as its file gives it; what [parameters] holds is read by `parameter_of`."""

    name: str = Field(pattern=NAME)
    description: str = ""
    scenario: str = Field(description="a TOML file next to the sweep, or a shipped scenario")
    overrides: list[str] = Field(default=[], description="key.path=value, as for --set")
    seeds: Annotated[
        Annotated[int, Tag("int")] | Annotated[list[Seed], Tag("list[int]")],
        Discriminator(lambda given: "list[int]" if isinstance(given, list) else "int"),
    ] = Field(default=1, description="how many, counted from first_seed, or the seeds themselves")
    first_seed: Seed = Field(
        default=0, description="the first of seeds that are a number; other than those tuned on"
    )
    sampling: Sampling = "grid"
    samples: int | None = Field(
        default=None, ge=1, description="how many, for every sampling but a grid"
    )
    sampling_seed: Seed = Field(default=0, description="of the samples, not of the runs")
    sensitivity: bool = Field(
        default=False,
        description="with sampling = 'sobol': two sets of samples and their mixtures, from which "
        "first-order and total Sobol indices are computed",
    )
    timeout_s: float = Field(
        default=300.0,
        ge=0.1,
        le=86_400,
        description="wall time for each run of a chunk, after which its process is killed; "
        "several times that of a slow run",
    )
    metric: str | None = Field(
        default=None, description="what the report is about; default: by what the reference says"
    )
    parameters: Table = {}
    together: list[Table] = Field(
        default=[], description="tables of parameters that vary together, value by value"
    )
    belief: Table = Field(
        default={}, description="what the controller is told: values, or parameters as above"
    )
    variants: dict[Name, Variant] = Field(
        default={}, description="scenarios side by side, each on the same values and seeds"
    )


@dataclass(frozen=True, slots=True)
class SweepRequest:
    """A sweep that is sound as a file; whether its rows can run is not known yet.

    Attributes:
        file: what it says.
        source: where it says so, for messages.
        folder: where files that it names are looked for first.
        axes: what is varied.
        overrides: on every row.
        seeds: of the runs.
    """

    file: SweepFile
    source: str
    folder: Path
    axes: tuple[Axis, ...]
    overrides: tuple[str, ...]
    seeds: tuple[int, ...]


def shipped_sweeps() -> dict[str, Path]:
    """Name of every shipped sweep and its file; suites of `ttwmr bench` lie beside them."""
    paths = sorted(sweeps_folder().glob("*.toml"))
    return {path.stem: path for path in paths if not is_suite(_read(path))}


def load_sweep(name_or_path: str, overrides: tuple[str, ...] = ()) -> SweepRequest:
    """Read a sweep: a TOML file, or the name of a shipped one.

    Args:
        name_or_path: which.
        overrides: more of them, after those of the file.

    Raises:
        InputError: there is none, or it is wrong; with every fault of the file.
    """
    path = _find(name_or_path)
    data = _read(path)
    if is_suite(data):
        problem = "this is a suite of controllers and tasks, not a sweep"
        raise InputError(Fault(problem=problem, hint=f"ttwmr bench {name_or_path}"), file=str(path))
    faults: list[Fault] = []
    try:
        file = SweepFile.model_validate(data)
    except ValidationError as error:
        faults = faults_of(error, SweepFile)
        if error.error_count() > MOST_FAULTS:
            raise InputError(*faults, file=str(path)) from error
        file = _sound_part(data, faults)
    constants, believed = split_belief(file.belief, faults)
    axes = tuple(axes_of(file.parameters, believed, file.together, faults))
    faults += _faults(file, axes)
    faults += _override_faults(file, overrides, axes, constants)
    if faults:
        raise InputError(*faults, file=str(path))
    seeds = tuple(_seeds(file))
    every = (*file.overrides, *constants, *overrides)
    return SweepRequest(file, str(path), path.parent, axes, every, seeds)


def _find(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if is_file(path):
        return path
    places = {file.stem: file for file in sorted(sweeps_folder().glob("*.toml"))}
    named = path.stem if path.parent.name == "sweeps" and path.suffix == ".toml" else name_or_path
    if named in places:
        return places[named]
    require_none_but_files(path)
    shipped = list(shipped_sweeps())
    problem = "no such sweep file, and no shipped sweep of that name"
    raise InputError(
        Fault(
            problem=f"{problem}{suggestion(path.stem, shipped)}",
            hint=f"shipped: {', '.join(shipped)}",
        ),
        file=name_or_path,
    )


def _read(path: Path) -> Table:
    return read_toml(path)


def _sound_part(data: Table, faults: list[Fault]) -> SweepFile:
    """The file without what is wrong, so that the rest is looked at too."""
    wrong = {fault.key[0] for fault in faults if fault.key}
    sound = {"name": "unnamed", "scenario": ""} | {k: v for k, v in data.items() if k not in wrong}
    return SweepFile.model_validate(sound)


def _seeds(file: SweepFile) -> Iterable[int]:
    """Of the runs."""
    if isinstance(file.seeds, list):
        return file.seeds
    return range(file.first_seed, file.first_seed + file.seeds)


def _seed_faults(seeds: int | list[int], first: int) -> Iterator[Fault]:
    if isinstance(seeds, list):
        if not seeds or len(set(seeds)) < len(seeds):
            yield Fault(key=("seeds",), got=shown(seeds), allowed="one or more, each once")
        if first:
            yield Fault(key=("first_seed",), got=str(first), allowed="where seeds is a number")
    elif not 1 <= seeds <= MOST_SEEDS:
        yield Fault(key=("seeds",), got=str(seeds), allowed=f"1 to {MOST_SEEDS}, or a list")
    elif first + seeds > 2**32:
        allowed = f"at most {2**32 - seeds} with {seeds} seeds"
        yield Fault(key=("first_seed",), got=str(first), allowed=allowed)


def _faults(file: SweepFile, axes: tuple[Axis, ...]) -> Iterator[Fault]:
    """What the keys do not show one by one."""
    yield from _seed_faults(file.seeds, file.first_seed)
    if file.metric is not None and file.metric not in METRICS:
        hint = suggestion(file.metric, list(METRICS))
        yield Fault(key=("metric",), got=f"{file.metric!r}{hint}", allowed=", ".join(METRICS))
    yield from _sampling_faults(file)
    yield from _variant_faults(file, {path for axis in axes for path in axis.parameters})
    for axis in axes:
        yield from _axis_faults(file, axis)


def _override_faults(
    file: SweepFile, more: tuple[str, ...], axes: tuple[Axis, ...], constants: list[str]
) -> Iterator[Fault]:
    """What is set on every row and comes to nothing."""
    believed = {
        path: ("this key is set in [belief]", "set it once")
        for given in constants
        for path in paths_set(given)
    }
    varied = {
        path: ("this key is varied", "vary it, or set it")
        for axis in axes
        for path in axis.parameters
    }
    seed = {"seed": ("cannot be set", "seeds are given in `seeds`")}
    for where, overrides, taken in (
        ("overrides", file.overrides, believed | varied | seed),
        ("--set", more, varied | seed),
    ):
        for given in overrides:
            for path in paths_set(given):
                if path in taken:
                    problem, hint = taken[path]
                    yield Fault(key=(where,), got=given, problem=problem, hint=hint)


def _variant_faults(file: SweepFile, varied: set[str]) -> Iterator[Fault]:
    """What a variant sets and does not get."""
    alike: dict[tuple[str, ...], str] = {}
    for name, variant in file.variants.items():
        where = ("variants", name, "overrides")
        for given in variant.overrides:
            for path in paths_set(given):
                if path in OWN_KEYS:
                    hint = "all variants have the seeds in `seeds`" if path == "seed" else ""
                    problem = "cannot be set by a variant"
                    yield Fault(key=where, got=given, problem=problem, hint=hint)
                if path in varied:
                    problem = "this key is varied, and so the same in all variants"
                    yield Fault(key=where, got=given, problem=problem, hint="vary it, or set it")
        other = alike.setdefault(tuple(variant.overrides), name)
        if other != name:
            yield Fault(key=where, problem=f"the same as those of {other}: nothing to compare")


def _sampling_faults(file: SweepFile) -> Iterator[Fault]:
    if file.sampling == "grid" and file.samples is not None:
        hint = "leave it out, or choose random, latin_hypercube or sobol"
        yield Fault(key=("samples",), got=str(file.samples), problem="a grid has none", hint=hint)
    if file.sampling != "grid" and file.samples is None:
        problem = f"missing; sampling = {file.sampling!r} needs a number"
        yield Fault(key=("samples",), problem=problem)
    if file.sensitivity and file.sampling != "sobol":
        allowed = "with sampling = 'sobol' only"
        yield Fault(key=("sensitivity",), got="true", allowed=allowed)
    samples = file.samples or 1
    if file.sampling == "sobol" and samples & (samples - 1):
        near = 1 << samples.bit_length()
        allowed = f"a power of two, such as {near // 2} or {near}: other sets lose their balance"
        yield Fault(key=("samples",), got=str(samples), allowed=allowed)


def _axis_faults(file: SweepFile, axis: Axis) -> Iterator[Fault]:
    counts = {path: p.values and len(p.values) for path, p in axis.parameters.items()}
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{path}: {count or 'a continuum'}" for path, count in counts.items())
        allowed = "as many values for each"
        yield Fault(key=("together",), got=told, problem="they vary together", allowed=allowed)
    elif len({p.drawn for p in axis.parameters.values()}) > 1:
        problem = "they vary together, and only some are distributions"
        yield Fault(key=("together",), got=axis.name, problem=problem)
    for path, parameter in axis.parameters.items():
        key = ("parameters", path)
        if file.sampling == "grid" and isinstance(parameter, Range) and parameter.count is None:
            problem = "missing; a grid needs to know how many values"
            yield Fault(key=(*key, "count"), problem=problem)
        values: tuple[Value, ...] | None = parameter.values
        if values is not None and len(values) == 1:
            override = as_toml(f"{path}={as_toml(values[0])}")
            hint = f"overrides = [{override}] sets it on every row"
            yield Fault(key=key, got=repr(values[0]), problem="one value varies nothing", hint=hint)
