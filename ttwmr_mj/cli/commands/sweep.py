"""`ttwmr sweep`: thousands of runs that differ in numbers."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import Quiet, kept_in, warn
from ttwmr_mj.errors import InputError, RunError, printable, to_copy

if TYPE_CHECKING:
    from ttwmr_mj.studies.sweep.compute import Compute
    from ttwmr_mj.studies.sweep.folder.part import Part
    from ttwmr_mj.studies.sweep.plan.plan import Plan
    from ttwmr_mj.studies.sweep.record import Wish


class Sweep(Quiet, name="sweep"):
    """Run a scenario thousands of times with other numbers, and sum up."""

    sweep: str | None = argument("a TOML file, or the name of a shipped sweep", None)
    out: Path | None = option(
        "folder for the results; what it holds of this sweep is not computed again; default: "
        "results/sweeps/NAME",
        metavar="DIR",
    )
    dry_run: bool = option("check the rows, print the plan and the time it takes, run nothing")
    overrides: tuple[str, ...] = option(
        "override a value on every row; repeatable", name="--set", metavar="KEY.PATH=VALUE"
    )
    extend: bool = option("the sweep in --out has grown: keep its rows and compute the new ones")
    shard: str | None = option("compute only this part of the rows, such as 2/8", metavar="I/N")
    merge: tuple[str, ...] = option(
        "join the folders of several machines in --out", metavar="DIR", several=True
    )
    record: str | None = option(
        "then run rows again with recordings: worst:N, best:N, median or failed:N",
        metavar="WHICH:N",
    )
    scheduler: str | None = option(
        "compute on a Dask cluster, such as tcp://head:8786", metavar="ADDRESS"
    )
    workers: int | None = option(
        "processes at a time; default: one per processor", metavar="N", least=1
    )
    chunk: int | None = option(
        "rows in a shard of the table; default: by what is run", metavar="N", least=1
    )
    max_rows: int = option("refuse larger sweeps", 10_000_000, metavar="N", least=1)

    def __call__(self) -> int:
        from ttwmr_mj.studies.sweep.folder.part import Part
        from ttwmr_mj.studies.sweep.record import Wish

        part, wish = Part.of(self.shard), Wish.of(self.record) if self.record else None
        compute = self._compute()
        if self.merge:
            plan, folder = self._merged()
        else:
            plan = self._plan()
            if self.dry_run:
                self._tell(plan)
                return 0
            folder = self._folder(plan)
            self._open(plan, folder)
        with kept_in(folder, lambda: "what is done is kept"):
            complete = self._fill(plan, folder, part, compute)
            if wish and not complete:
                raise RunError("rows are recorded once all are there; join the parts first")
            if wish:
                self._record(plan, folder, wish)
            self._conclude(plan, folder, part, complete)
        return 0

    def _plan(self) -> Plan:
        """The plan, every row of it checked, unless the folder holds it already."""
        from ttwmr_mj.runs.process.progress import progress_bar
        from ttwmr_mj.studies.sweep.folder.plan_file import stored_plan
        from ttwmr_mj.studies.sweep.laws import check_laws
        from ttwmr_mj.studies.sweep.plan.build import build_plan, completed
        from ttwmr_mj.studies.sweep.plan.checks import check_plan
        from ttwmr_mj.studies.sweep.plan.file import load_sweep, shipped_sweeps
        from ttwmr_mj.studies.sweep.words import remarks

        if self.sweep is None:
            allowed = f"a TOML file, or shipped: {', '.join(shipped_sweeps())}"
            raise InputError.at("SWEEP", "missing", allowed=allowed)
        request = load_sweep(self.sweep, self.overrides)
        plan = build_plan(request, self.max_rows)
        stored = stored_plan(self._folder(plan))
        if self.dry_run or stored is None or not stored.has_rows_of(plan):
            with progress_bar("checking rows", 1.0, "", self.quiet) as progress:
                check_plan(plan, request.source, workers=self.workers, progress=progress)
            check_laws(plan, request.source, workers=self.workers)
        plan = completed(plan)
        if not self.quiet:
            warn(remarks(plan))
        return plan

    def _folder(self, plan: Plan) -> Path:
        return self.out or Path("results") / "sweeps" / plan.name

    def _tell(self, plan: Plan) -> None:
        """What would be done, and how long it would take."""
        from ttwmr_mj.studies.sweep.plan.checks import checked_text
        from ttwmr_mj.studies.sweep.words import duration, estimated_time_s, plan_text

        print(printable(f"{plan_text(plan)}\n\nchecked: {checked_text(plan)}"))
        time_s = estimated_time_s(plan, self.workers or os.cpu_count() or 1)
        told = "unknown" if time_s is None else f"about {duration(time_s)} on this machine"
        print(f"time: {told}")

    def _open(self, plan: Plan, folder: Path) -> None:
        """Make the plan the folder's, if it is not."""
        from ttwmr_mj.studies.sweep.folder.extend import extend
        from ttwmr_mj.studies.sweep.folder.plan_file import (
            refuse_foreign,
            refuse_other,
            stored_plan,
            write_plan,
        )

        refuse_foreign(folder)
        stored = stored_plan(folder)
        if stored is None:
            write_plan(folder, plan)
        elif self.extend and stored.digest != plan.digest:
            extend(folder, stored, plan)
        else:
            refuse_other(folder, stored, plan)

    def _merged(self) -> tuple[Plan, Path]:
        """The plan of folders that were joined in one."""
        from ttwmr_mj.studies.sweep.folder.merge import merge
        from ttwmr_mj.studies.sweep.folder.plan_file import refuse_foreign
        from ttwmr_mj.studies.sweep.folder.shards import rows_done

        unused = {
            "SWEEP": self.sweep,
            "--set": self.overrides,
            "--dry-run": self.dry_run,
            "--extend": self.extend,
            "--shard": self.shard,
        }
        if given := [name for name, value in unused.items() if value]:
            problem = "the folders that are joined know their sweep"
            raise InputError.at(given[0], problem, hint="leave it out, or leave --merge out")
        if self.out is None:
            raise InputError.at(
                "--merge", "--out is missing", hint="name the folder to join them in"
            )
        refuse_foreign(self.out)
        plan = merge(tuple(map(Path, self.merge)), self.out, self.max_rows)
        if missing := int((~rows_done(self.out, plan)).sum()):
            raise RunError(
                f"joined in {self.out}, where {missing} of {plan.rows} rows are missing; "
                f"ttwmr sweep with --out {self.out} and without --shard computes them"
            )
        return plan, self.out

    def _fill(self, plan: Plan, folder: Path, part: Part, compute: Compute) -> bool:
        """Compute what is missing; whether all is there."""
        from ttwmr_mj.studies.sweep.execute import fill
        from ttwmr_mj.studies.sweep.progress import sweep_progress

        start, stop = part.rows(plan)
        with sweep_progress(plan.name, stop - start, self.quiet) as told:
            return fill(plan, folder, compute, part=part, chunk=self.chunk, told=told, warn=warn)

    def _compute(self) -> Compute:
        if self.scheduler is not None:
            from ttwmr_mj.studies.sweep.cluster import on_cluster

            return on_cluster(self.scheduler)
        from ttwmr_mj.studies.sweep.compute import in_processes

        return in_processes(self.workers)

    def _conclude(self, plan: Plan, folder: Path, part: Part, complete: bool) -> None:
        """Write the report, if all rows are there; say what there is."""
        from ttwmr_mj.studies.sweep.answers.report import write_report

        if complete:
            told = write_report(folder)
        else:
            start, stop = part.rows(plan)
            rows = f"rows {start} to {stop - 1}" if start < stop else "which has no rows"
            told = (
                f"{plan.name}: part {part.index}/{part.count}, {rows}, is done "
                f"in {folder}\njoin the parts: ttwmr sweep --merge DIR DIR ... --out DIR"
            )
        print(folder if self.quiet else printable(told))

    def _record(self, plan: Plan, folder: Path, wish: Wish) -> None:
        from ttwmr_mj.studies.sweep.record import record

        for run in record(plan, folder, wish, workers=self.workers):
            if not self.quiet:
                print(f"recorded: {to_copy('view', run)}")
