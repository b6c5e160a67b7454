"""The work of a reproduction: runs and studies, in parallel, and not a second time."""

from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path

from ttwmr_mj.files import write_json
from ttwmr_mj.studies.pool.ingredients import made_of_study
from ttwmr_mj.studies.pool.jobs import Failed, Job, run_jobs
from ttwmr_mj.studies.pool.task import PRELOAD, Work, run_task
from ttwmr_mj.studies.reproduce.ideal.studies import STUDIES
from ttwmr_mj.studies.reproduce.runs import RUNS


def run_folder(out: Path, name: str) -> Path:
    """Folder of a run."""
    return out / "runs" / name


def study_file(out: Path, name: str) -> Path:
    """File of a study's result."""
    return out / "studies" / f"{name}.json"


def missing_tasks(out: Path, runs: Iterable[str], studies: Iterable[str]) -> list[Work]:
    """The tasks whose results are missing or outdated.

    Args:
        out: the reproduction's folder.
        runs: names of `runs.RUNS`.
        studies: names of `studies.STUDIES`.
    """
    tasks = [_run_task(out, name) for name in runs]
    # a camera's frames take longest: first, or one core waits for the other at the end
    tasks.sort(key=lambda task: task.made_of["scenario"]["sensing"]["kind"] != "camera")
    tasks += [_study_task(out, name) for name in studies]
    return [task for task in tasks if not task.is_done]


def execute(tasks: list[Work], progress: Callable[[float], None] | None = None) -> list[Failed]:
    """Do tasks, as many at a time as there are processors.

    Args:
        tasks: of `missing_tasks`.
        progress: called with the number of finished tasks.

    Returns:
        What could not be done.
    """
    by_name = {task.job.name: task for task in tasks}
    failures = []
    with closing(run_jobs([task.job for task in tasks], preload=PRELOAD)) as events:
        for count, event in enumerate(events, start=1):
            if isinstance(event, Failed):
                failures.append(event)
            else:
                by_name[event.job.name].mark_done()
            if progress:
                progress(float(count))
    return failures


def _run_task(out: Path, name: str) -> Work:
    spec = RUNS[name]
    return run_task(name, spec.scenario(), run_folder(out, name), spec.command())


def _study_task(out: Path, name: str) -> Work:
    study, path = STUDIES[name], study_file(out, name)
    libraries = ("sympy",) if name == "proofs" else ("numpy", "scipy")
    made_of = made_of_study(getattr(study, "func", study).__module__, libraries)
    job = Job(name, do_study, (name, path.absolute()), places=(path.absolute(),))
    return Work(made_of, path.with_suffix(".made_of.json"), (path,), job=job)


def do_study(name: str, path: Path) -> None:
    """One study into its file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, {"result": STUDIES[name]()})
