"""What each command of the command line does; imports that cost time are made where needed.

Every function takes the parsed options and returns the exit code.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from ttwmr_mj.errors import RunError

if TYPE_CHECKING:
    from ttwmr_mj.run.execute import Run


def run(options: Namespace) -> int:
    """Run a scenario and leave a run folder."""
    from ttwmr_mj.run.execute import run_scenario
    from ttwmr_mj.run.folder import open_folder, results_folder
    from ttwmr_mj.run.progress import progress_bar
    from ttwmr_mj.scenario.file import find_scenario, load_scenario

    scenario = load_scenario(options.scenario, options.overrides, options.seed, options.fragment)
    folder = options.out or results_folder(scenario.name, scenario.seed)
    open_folder(folder, options.force)
    with progress_bar(scenario.name, scenario.duration_s, "s", options.quiet) as progress:
        done = run_scenario(
            scenario,
            folder,
            scenario_folder=find_scenario(options.scenario).parent,
            command_line=["ttwmr", *sys.argv[1:]],
            progress=progress,
        )
    if done.outcome.status != "ok":
        if options.debug and done.outcome.cause:
            raise done.outcome.cause
        raise RunError(
            f"{scenario.name} {done.outcome.status} at {done.outcome.time_s:.3f} s: "
            f"{done.outcome.reason}; what was recorded is in {folder}"
        )
    if not options.quiet:
        _print_run(done)
    return 0


def _print_run(run: Run) -> None:
    from ttwmr_mj.run.execute import RESULT_ROWS, in_unit

    for key, label, scale, unit in RESULT_ROWS:
        print(f"{label:38s} {in_unit(run.metrics[key], scale, unit)}")
    print(f"{'real time factor':38s} {run.metrics['real_time_factor']:.3g}")
    print(f"\nrun folder: {run.folder}\nlook at it: ttwmr view {run.folder}")


def compare(options: Namespace) -> int:
    """Compare contact physics with the analytic model."""
    from ttwmr_mj.run.folder import open_folder, results_folder
    from ttwmr_mj.run.progress import progress_bar
    from ttwmr_mj.scenario.file import find_scenario, load_scenario
    from ttwmr_mj.studies.compare import Options, compare_scenario, plain

    scenario = load_scenario(options.scenario, options.overrides, options.seed, options.fragment)
    wanted = Options(
        mode=options.mode,
        real_wheels=options.real_wheels,
        attribute=not options.no_attribution,
        converge=options.converge,
        fit=options.fit,
        validate_on=options.validate_on,
        tolerance=options.tolerance,
        recording=scenario.output.recording,
        figures=scenario.output.figures,
    )
    folder = options.out or results_folder(f"{scenario.name}-compared", scenario.seed)
    open_folder(folder, options.force)
    with progress_bar(scenario.name, 1.0, "", options.quiet) as progress:
        done = compare_scenario(
            scenario,
            folder,
            wanted,
            scenario_folder=find_scenario(options.scenario).parent,
            command_line=["ttwmr", *sys.argv[1:]],
            progress=progress,
        )
    if not options.quiet:
        print(f"{plain(done.report)}\n\nfolder: {folder}\nlook at it: ttwmr view {folder}")
    if done.breaches:
        lines = "\n".join(f"  {breach}" for breach in done.breaches)
        raise RunError(f"{scenario.name} exceeds {options.tolerance}; see {folder}\n{lines}")
    return 0


def validate(options: Namespace) -> int:
    """Check scenario files; silent if all is well."""
    from ttwmr_mj.errors import InputError
    from ttwmr_mj.scenario.file import load_scenario

    faults = []
    for scenario in options.scenarios:
        try:
            load_scenario(scenario, options.overrides, options.seed, options.fragment)
        except InputError as error:
            faults.append(str(error))
    if faults:
        raise InputError("\n".join(faults))
    return 0


def bench(options: Namespace) -> int:
    """Run a suite and rank what it ran; or rank what was run before."""
    from ttwmr_mj.run.folder import open_folder, results_folder
    from ttwmr_mj.run.progress import progress_bar
    from ttwmr_mj.studies.bench.execute import run_suite
    from ttwmr_mj.studies.bench.leaderboard import to_summary, write_leaderboard
    from ttwmr_mj.studies.bench.scoring import collect
    from ttwmr_mj.studies.bench.suite import load_suite, rows_of

    suite = load_suite(options.suite)
    folder = options.out or results_folder("bench", suite.name)
    if not options.rescore:
        open_folder(folder, force=True)
        with progress_bar(suite.name, len(rows_of(suite)), "runs", options.quiet) as progress:
            run_suite(suite, folder, workers=options.workers, progress=progress)
    board = collect(suite, folder)
    title = f"{suite.name}: {suite.description}" if suite.description else suite.name
    write_leaderboard(board, folder, title)
    if not options.quiet:
        print(to_summary(board, title))
        print(f"written to {folder}")
    return 0


def calibrate(options: Namespace) -> int:
    """Calibrate a camera, simulated or real, or write the board."""
    from ttwmr_mj.scenario.file import load_scenario
    from ttwmr_mj.studies.calibrate import calibrate_from_images, calibrate_scenario, write_board
    from ttwmr_mj.vision.calibration.file import save_calibration

    if options.board is not None:
        write_board(options.board)
        return 0
    if options.images is not None:
        calibration = calibrate_from_images(options.images)
    else:
        scenario = load_scenario(
            options.scenario, options.overrides, options.seed, options.fragment
        )
        calibration = calibrate_scenario(scenario)
    save_calibration(calibration, options.out)
    print(
        f"{calibration.views} views, reprojection {calibration.reprojection_rms_px:.3f} px rms, "
        f"on the floor {calibration.floor_rms_px:.3f} px rms\nwritten to {options.out}"
    )
    return 0


def track(options: Namespace) -> int:
    """Track the robot through a video."""
    from ttwmr_mj.run.folder import open_folder, results_folder
    from ttwmr_mj.run.progress import progress_bar
    from ttwmr_mj.scenario.file import load_scenario
    from ttwmr_mj.studies.track.track import track as track_source

    robot = load_scenario(options.scenario).robot
    folder = options.out or results_folder("track", Path(options.source).stem)
    open_folder(folder, options.force)
    with progress_bar("tracking", options.frames, "frames", options.quiet) as progress:
        done = track_source(
            options.source,
            options.calibration,
            folder,
            robot,
            max_frames=options.frames,
            progress=progress,
        )
    if not options.quiet:
        print(f"{done.frames} frames, robot known in {done.tracked}\nwritten to {done.folder}")
    return 0


def reproduce(options: Namespace) -> int:
    """Re-run the article."""
    from ttwmr_mj.studies.reproduce.study import reproduce as reproduce_article
    from ttwmr_mj.studies.reproduce.study import verdict_table

    done = reproduce_article(options.out, options.only, quiet=options.quiet)
    if not options.quiet:
        print(f"{verdict_table(done.judgements)}\n\nreport: {done.report}".lstrip())
    for name, reason in done.failures.items():
        print(f"ttwmr: {name} could not be run: {reason}", file=sys.stderr)
    return 1 if done.runs_failed else 0


def list_scenarios(options: Namespace) -> int:
    """List the shipped scenarios."""
    del options
    import tomllib

    from ttwmr_mj.assets import shipped_scenarios

    for name, path in shipped_scenarios().items():
        print(f"{name:20s} {tomllib.loads(path.read_text()).get('description', '')}")
    return 0


def view(options: Namespace) -> int:
    """Open a recording in the viewer."""
    from ttwmr_mj.recording.viewer import open_viewer

    return open_viewer(options.recording)


def doctor(options: Namespace) -> int:
    """Say what this machine has and lacks."""
    del options
    from ttwmr_mj.cli.doctor import examine

    text, healthy = examine()
    print(text)
    return 0 if healthy else 1


def export_schema(options: Namespace) -> int:
    """Print or write the JSON Schema of scenarios."""
    import json

    from ttwmr_mj.files import write_text
    from ttwmr_mj.scenario.schema import Scenario

    text = json.dumps(Scenario.model_json_schema(), indent=2, ensure_ascii=False) + "\n"
    if options.out:
        write_text(options.out, text)
    else:
        print(text, end="")
    return 0
