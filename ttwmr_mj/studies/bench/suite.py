"""A suite: which controllers are run on which tasks, plants, sensors and disturbances.

A suite file names the choices on each axis and what each changes in a scenario. Rows are the
product of the axes, or of those parts of them that `[[block]]` tables pick:

    [controller.mine]                 # task, plant, sensing and disturbance likewise
    overrides = ['controller={kind="custom", target="mine:Mine"}']

    when.camera = ["sensing.tracker.learn_latency=true"]    # in addition, where combined with it
    not_meant_for = ["inverted_trailer"]                    # run, and marked

    [disturbance.start]
    overrides = ["initial.x_offset_m=0.05"]
    scored = "whole"                  # errors of the whole run, not of its second half

    [[block]]                         # an axis left out takes all of its choices
    sensing = ["camera"]
    seeds = [0, 1]

Of a key that several choices set, the last counts: the overrides of all choices come first, in the
order of `AXES`, then all of their `when`, which say the more particular.
"""

import itertools
import math
import shlex
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError

from ttwmr_mj.assets import sweeps_folder
from ttwmr_mj.config import NAME, WORD, Config
from ttwmr_mj.errors import Fault, InputError, Keys, shown
from ttwmr_mj.files import is_file, read_toml, require_none_but_files
from ttwmr_mj.scenario.faults import faults_of, suggestion
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.scenario.schema import Scenario

Overrides = tuple[str, ...]
AXES = ("controller", "task", "plant", "sensing", "disturbance")
MOST_ROWS = 10_000
LONGEST_NAME = 255  # of a folder
LEAN: Overrides = ("output.recording=false", "output.figures=false")

Name = Annotated[str, Field(pattern=WORD)]


def _each_once(values: list[Any]) -> list[Any]:
    for value, count in Counter(values).most_common(1):
        if count > 1:
            raise ValueError(f"{shown(value)} is there {count} times; give each once")
    return values


Once = AfterValidator(_each_once)
Seeds = Annotated[list[Annotated[int, Field(ge=0, lt=2**32)]], Field(min_length=1), Once]
Scored = Literal["steady", "whole"]
Picked = Annotated[list[str], Field(min_length=1), Once]


class Choice(Config):
    """One value of an axis: what it changes in a scenario."""

    scenario: str | None = Field(
        default=None,
        description="the scenario to start from (tasks only): a shipped one, or a file next "
        "to the suite",
    )
    overrides: list[str] = Field(default=[], description="key.path=value, as for --set")
    when: dict[str, list[str]] = Field(
        default={}, description="name on another axis → overrides in addition, with that choice"
    )
    skip: list[str] = Field(
        default=[], description="names on other axes that this choice is not combined with"
    )
    not_meant_for: list[str] = Field(
        default=[],
        description="names on other axes that this choice is combined with, though not made for "
        "them; the leaderboard marks these lines",
    )
    scored: Scored = Field(
        default="steady",
        description="what errors cover; steady: the second half of a run; whole: all of it, for "
        "disturbances that are over",
    )


class Block(Config):
    """A part of the product: the named choices of each axis, all of them where left out."""

    controller: Picked | None = None
    task: Picked | None = None
    plant: Picked | None = None
    sensing: Picked | None = None
    disturbance: Picked | None = None
    seeds: Seeds | None = Field(
        default=None, description="seeds of this block; default: the suite's"
    )


class Suite(Config):
    """All axes, and the blocks of their product that are run."""

    name: str = Field(pattern=NAME)
    description: str = ""
    seeds: Seeds = Field(
        default=[0], description="one run per seed; several where something is random"
    )
    timeout_s: float = Field(
        default=300.0,
        ge=1e-12,
        le=86_400,
        description="wall time after which a run is killed; several times that of a slow run",
    )
    controller: dict[Name, Choice] = Field(min_length=1)
    task: dict[Name, Choice] = Field(min_length=1)
    plant: dict[Name, Choice] = {"contact": Choice()}
    sensing: dict[Name, Choice] = {"truth": Choice()}
    disturbance: dict[Name, Choice] = {"none": Choice()}
    block: list[Block] = Field(default=[Block()], min_length=1)


@dataclass(frozen=True, slots=True)
class SuiteRow:
    """One run of a suite."""

    names: Mapping[str, str]  # axis → name of the choice
    seed: int  # of the run
    scenario: str  # shipped name or path
    overrides: Overrides  # everything that is set
    scored: Scored = "steady"  # what its errors cover
    meant: bool = True  # no choice says that it is not made for another

    @property
    def key(self) -> str:
        """Name of the row's folder."""
        return "-".join([*(self.names[axis] for axis in AXES), str(self.seed)])

    def load(self) -> Scenario:
        """Its resolved scenario, recording and figures left out.

        Raises:
            InputError: it cannot run.
        """
        return load_scenario(self.scenario, [*self.overrides, *LEAN], self.seed)

    def arguments(self, out: Path) -> list[str]:
        """Of `ttwmr`, to run this row."""
        sets = [word for item in (*self.overrides, *LEAN) for word in ("--set", item)]
        return ["run", self.scenario, *sets, "--seed", str(self.seed), "--out", str(out)]

    def command(self) -> str:
        """What a person types to run this row again, with its recording and figures."""
        sets = [word for item in self.overrides for word in ("--set", item)]
        return shlex.join(["ttwmr", "run", self.scenario, *sets, "--seed", str(self.seed)])


def load_suite(name_or_path: str, most_rows: int = MOST_ROWS) -> Suite:
    """Read a suite: a TOML file, or the name of a shipped one.

    A task's scenario is looked for beside the suite's file first.

    Args:
        name_or_path: which.
        most_rows: larger suites are refused.

    Raises:
        InputError: there is no such suite, or it is wrong; with every fault of the file.
    """
    path = _find(name_or_path)
    data = read_toml(path)
    try:
        _refuse_sweep(data, path, name_or_path)
        suite = Suite.model_validate(data)
        faults = _faults(suite) or _of_rows(suite, most_rows)
    except ValidationError as error:
        faults = faults_of(error, Suite)
    if faults:
        raise InputError(*faults, file=str(path))
    tasks = {name: _placed(task, path.parent) for name, task in suite.task.items()}
    return suite.model_copy(update={"task": tasks})


def is_suite(data: dict[str, Any]) -> bool:
    """Whether a TOML file names controllers or tasks; beside suites lie files of `ttwmr sweep`."""
    return "controller" in data or "task" in data


def _refuse_sweep(data: dict[str, Any], path: Path, name: str) -> None:
    if "scenario" in data and not is_suite(data):
        fault = Fault(problem="this is a sweep, not a suite", hint=f"ttwmr sweep {name}")
        raise InputError(fault, file=str(path))


def shipped_suites() -> dict[str, Path]:
    """Name of every shipped suite and its file."""
    paths = sorted(sweeps_folder().glob("*.toml"))
    return {path.stem: path for path in paths if is_suite(read_toml(path))}


def _find(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if is_file(path):
        return path
    shipped = {file.stem: file for file in sorted(sweeps_folder().glob("*.toml"))}
    if name_or_path not in shipped:
        require_none_but_files(path)
        suites = list(shipped_suites())
        hint = suggestion(name_or_path, suites)
        raise InputError(
            Fault(
                key=(name_or_path,),
                problem=f"no such suite file, and no shipped suite of that name{hint}",
                allowed=f"a TOML file, or shipped: {', '.join(suites)}",
            )
        )
    return shipped[name_or_path]


def _placed(task: Choice, folder: Path) -> Choice:
    """The task with its scenario's path from here, if it lies beside the suite."""
    beside = folder / str(task.scenario)
    return task.model_copy(update={"scenario": str(beside)}) if is_file(beside) else task


def _faults(suite: Suite) -> list[Fault]:
    """What the keys do not show one by one."""
    faults = [
        Fault(key=("task", name, "scenario"), problem="missing; name a scenario")
        for name, task in suite.task.items()
        if task.scenario is None
    ]
    names = {axis: list(getattr(suite, axis)) for axis in AXES}
    for axis in AXES:
        others = {other: names[other] for other in AXES if other != axis}
        for name, choice in getattr(suite, axis).items():
            for key in ("when", "skip", "not_meant_for"):
                faults += _unclear((axis, name, key), getattr(choice, key), others)
            changes = [*choice.overrides, *itertools.chain(*choice.when.values())]
            faults += [
                Fault(key=(axis, name, "overrides"), got=repr(change), hint="a suite has `seeds`")
                for change in changes
                if change.partition("=")[0].strip() == "seed"
            ]
        for i, block in enumerate(suite.block):
            faults += _unknown(("block", i, axis), getattr(block, axis) or (), names[axis])
    return faults


def _of_rows(suite: Suite, most: int) -> list[Fault]:
    """What is wrong with the number of rows, counted before any is made, or with their names."""
    count = sum(_combinations(suite, block) for block in suite.block)
    if count > most:
        hint = "take several suites, or --max-rows where this many are meant"
        return [Fault(key=("block",), got=f"{count} rows", allowed=f"at most {most}", hint=hint)]
    longest = max((row.key for row in rows_of(suite)), key=len, default="")
    if not longest:
        return [Fault(key=("block",), problem="no row is left: `skip` leaves all of them out")]
    allowed = f"names of choices that together have {LONGEST_NAME} letters"
    long = Fault(key=("block",), got=shown(longest), allowed=allowed)
    return [long] if len(longest) > LONGEST_NAME else []


def _combinations(suite: Suite, block: Block) -> int:
    """Rows of a block, skipped ones included."""
    picked = (getattr(block, axis) or getattr(suite, axis) for axis in AXES)
    return math.prod(map(len, picked)) * len(block.seeds or suite.seeds)


def _unknown(key: Keys, given: Collection[str], allowed: list[str]) -> list[Fault]:
    """A fault for each name that is not allowed."""
    return [
        Fault(key=key, got=f"{name!r}{suggestion(name, allowed)}", allowed=", ".join(allowed))
        for name in given
        if name not in allowed
    ]


def _unclear(key: Keys, given: Collection[str], others: dict[str, list[str]]) -> list[Fault]:
    """A fault for each name that no other axis has (axis → names), or that several have."""
    faults = _unknown(key, given, [name for names in others.values() for name in names])
    for name in given:
        if len(axes := [axis for axis, names in others.items() if name in names]) > 1:
            problem = f"{name!r} is a choice of {' and of '.join(axes)}"
            faults.append(Fault(key=key, problem=problem, hint="give them different names"))
    return faults


def rows_of(suite: Suite) -> list[SuiteRow]:
    """Every row, block by block, seeds innermost; what several blocks name is one row."""
    rows = {row.key: row for block in suite.block for row in _rows_of_block(suite, block)}
    return list(rows.values())


def _rows_of_block(suite: Suite, block: Block) -> Iterator[SuiteRow]:
    axes = [getattr(suite, axis) for axis in AXES]
    picked = [getattr(block, axis) or list(getattr(suite, axis)) for axis in AXES]
    for names in itertools.product(*picked):
        choices: list[Choice] = [axis[name] for axis, name in zip(axes, names, strict=True)]
        others = [(*names[:i], *names[i + 1 :]) for i in range(len(names))]
        pairs = [(one, name) for one, rest in zip(choices, others, strict=True) for name in rest]
        if any(name in choice.skip for choice, name in pairs):
            continue
        scenario = choices[AXES.index("task")].scenario or ""
        own = [item for choice in choices for item in choice.overrides]
        together = [item for choice, name in pairs for item in choice.when.get(name, ())]
        scored: Scored = "whole" if any(c.scored == "whole" for c in choices) else "steady"
        meant = not any(name in choice.not_meant_for for choice, name in pairs)
        for seed in block.seeds or suite.seeds:
            named = dict(zip(AXES, names, strict=True))
            yield SuiteRow(named, seed, scenario, (*own, *together), scored, meant)


def checked_scenarios(rows: list[SuiteRow]) -> dict[str, Scenario]:
    """SuiteRow's key → its resolved scenario, recording and figures left out.

    Raises:
        InputError: some rows cannot run; with the faults of all of them.
    """
    scenarios, faults, wrong = {}, list[Fault](), 0
    for row in rows:
        try:
            scenarios[row.key] = row.load()
        except InputError as error:
            wrong += 1
            file = f"{error.file}: " if error.file else ""
            key = (f"row {row.key}",)
            faults += [Fault(key=key, problem=f"{file}{fault}") for fault in error.faults]
    if faults:
        count = "1 row" if wrong == 1 else f"{wrong} rows"
        hint = "exclude combinations that do not go together with `skip` or blocks"
        raise InputError(f"{count} cannot run; {hint}", *faults)
    return scenarios
