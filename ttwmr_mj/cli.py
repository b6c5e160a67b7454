"""The command line: parse, call, print. Exit 0 done, 1 the run failed, 2 the input is wrong."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from ttwmr_mj.errors import RunError, TtwmrError

if TYPE_CHECKING:
    from ttwmr_mj.run import Run

EXAMPLES = """examples:
  ttwmr run lab_circle                     a shipped scenario, by name
  ttwmr run my.toml --out results/mine     your own
  ttwmr compare lab_circle                 contact physics against the analytic model
  ttwmr run lab_circle --set plant.kind=analytic --set controller.alpha1=40
  ttwmr view                               the newest recording under results/
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        return int(options.call(options))
    except KeyboardInterrupt:
        print("ttwmr: stopped", file=sys.stderr)
        return 1
    except TtwmrError as error:
        if options.debug:
            raise
        print(f"ttwmr: {error}", file=sys.stderr)
        return 1 if isinstance(error, RunError) else 2
    except BrokenPipeError:  # the reader of our output left; that is its right
        sys.stderr.close()
        return 0


def _interrupt(signum: int, frame: Any) -> NoReturn:
    """SIGTERM ends a run like Ctrl-C, so that its files are closed."""
    del signum, frame
    raise KeyboardInterrupt


def make_parser() -> argparse.ArgumentParser:
    """All commands and options."""
    parser = argparse.ArgumentParser(
        prog="ttwmr",
        description="A tractor with a spherical-wheeled trailer, in models and contact physics.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, help="print the version and leave")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def command(name: str, call: Callable[[Any], int], text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        sub.add_argument("--debug", action="store_true", help="show tracebacks")
        sub.set_defaults(call=call)
        return sub

    run = command("run", _run, "run a scenario and leave a run folder")
    run.add_argument("scenario", help="a TOML file, or the name of a shipped scenario")
    _add_scenario_options(run)
    run.add_argument("--out", type=Path, metavar="DIR", help="the run folder")
    run.add_argument("--force", action="store_true", help="write into a folder that is not empty")
    run.add_argument(
        "--save-frames",
        action="append_const",
        const="output.save_frames=true",
        dest="overrides",
        help="keep the camera's frames, with COCO keypoint annotations",
    )
    run.add_argument("--quiet", action="store_true", help="print nothing but errors")
    validate = command(
        "validate", _validate, "check scenario files and print nothing if all is well"
    )
    validate.add_argument("scenarios", nargs="+", metavar="scenario")
    _add_scenario_options(validate)
    compare = command(
        "compare", _compare, "compare contact physics with the analytic model and explain it"
    )
    compare.add_argument("scenario", help="a TOML file, or the name of a shipped scenario")
    _add_scenario_options(compare)
    compare.add_argument(
        "--mode",
        choices=("open_loop", "closed_loop"),
        default="open_loop",
        help="one command history for both plants, or each under its own controller",
    )
    compare.add_argument(
        "--real-wheels",
        action="store_true",
        help="open loop: drive the analytic model by the wheels' real speeds: slip alone is left",
    )
    compare.add_argument("--no-attribution", action="store_true", help="deviations only; fast")
    compare.add_argument("--converge", action="store_true", help="refine the contact physics")
    compare.add_argument("--fit", action="store_true", help="fit an extended analytic model")
    compare.add_argument(
        "--validate-on", metavar="SCENARIO", help="validate the fit there; default: a shipped one"
    )
    compare.add_argument(
        "--tolerance", type=Path, metavar="FILE", help="TOML of allowed values; beyond them: exit 1"
    )
    compare.add_argument("--out", type=Path, metavar="DIR", help="the folder of the results")
    compare.add_argument("--force", action="store_true", help="write into a non-empty folder")
    compare.add_argument("--quiet", action="store_true", help="print nothing but errors")
    bench = command("bench", _bench, "run a suite of controllers on tasks and rank them")
    bench.add_argument("suite", nargs="?", default="quick", help="a TOML file or a shipped suite")
    bench.add_argument("--out", type=Path, metavar="DIR", help="finished rows in it are reused")
    bench.add_argument("--rescore", action="store_true", help="score what --out holds, run nothing")
    bench.add_argument("--workers", type=int, metavar="N", help="processes; default: processors")
    bench.add_argument("--quiet", action="store_true", help="print nothing but errors")
    calibrate = command("calibrate", _calibrate, "calibrate a camera with a ChArUco board")
    calibrate.add_argument(
        "scenario", nargs="?", default="lab_circle_camera", help="whose simulated camera is shown"
    )
    _add_scenario_options(calibrate)
    calibrate.add_argument(
        "--images",
        type=Path,
        metavar="DIR",
        help="a real camera's pictures instead: DIR/held, DIR/origin and DIR/flat",
    )
    calibrate.add_argument(
        "--board", type=Path, metavar="PNG", help="write the board to print, and do nothing else"
    )
    calibrate.add_argument("--out", type=Path, metavar="YAML", default=Path("calibration.yaml"))
    track = command("track", _track, "track the robot through a video or a camera's stream")
    track.add_argument("source", help="a video file, or a camera's index")
    track.add_argument("--calibration", type=Path, required=True, metavar="YAML")
    track.add_argument("--scenario", default="lab_circle", help="whose robot is in the pictures")
    track.add_argument("--frames", type=int, metavar="N", help="stop after N frames")
    track.add_argument("--out", type=Path, metavar="DIR", help="for poses.parquet and track.rrd")
    track.add_argument("--force", action="store_true", help="write into a folder that is not empty")
    track.add_argument("--quiet", action="store_true", help="print nothing but errors")
    again = command("reproduce", _reproduce, "re-run the article: every figure, every claim")
    again.add_argument("--out", type=Path, metavar="DIR", default=Path("results/reproduce"))
    again.add_argument(
        "--only", action="append", default=[], metavar="FIG", help="one figure; may be given often"
    )
    again.add_argument("--quiet", action="store_true", help="print nothing but errors")
    command("list", _list, "list the shipped scenarios")
    view = command("view", _view, "open a recording in the Rerun viewer")
    view.add_argument("recording", nargs="?", type=Path, help="run folder or .rrd; default: newest")
    command("doctor", _doctor, "say what this machine has and what is missing")
    schema = command("export-schema", _export_schema, "print the JSON Schema of scenarios")
    schema.add_argument("--out", type=Path, metavar="FILE", help="write it to a file instead")
    return parser


class _Version(argparse.Action):
    def __init__(self, **options: Any) -> None:
        super().__init__(nargs=0, **options)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from ttwmr_mj import __version__

        print(f"ttwmr-mj {__version__}")
        parser.exit()


def _add_scenario_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        dest="overrides",
        metavar="KEY.PATH=VALUE",
        help="override one value of the scenario; may be given often",
    )
    parser.add_argument(
        "--fragment", type=Path, metavar="FILE", help="TOML merged into the scenario, as of --fit"
    )
    parser.add_argument("--seed", type=int, help="replace the scenario's seed")


def _run(options: argparse.Namespace) -> int:
    from ttwmr_mj.progress import progress_bar
    from ttwmr_mj.run import run_scenario
    from ttwmr_mj.run_folder import open_folder, results_folder
    from ttwmr_mj.scenario_file import find_scenario, load_scenario

    scenario = load_scenario(options.scenario, options.overrides, options.seed, options.fragment)
    folder = options.out or results_folder(scenario.name, scenario.seed)
    open_folder(folder, options.force)
    with progress_bar(scenario.name, scenario.duration_s, "s", options.quiet) as progress:
        run = run_scenario(
            scenario,
            folder,
            scenario_folder=find_scenario(options.scenario).parent,
            command_line=["ttwmr", *sys.argv[1:]],
            progress=progress,
        )
    if run.outcome.status != "ok":
        if options.debug and run.outcome.cause:
            raise run.outcome.cause
        raise RunError(
            f"{scenario.name} {run.outcome.status} at {run.outcome.time_s:.3f} s: "
            f"{run.outcome.reason}; what was recorded is in {folder}"
        )
    if not options.quiet:
        _print_run(run)
    return 0


def _print_run(run: Run) -> None:
    from ttwmr_mj.run import RESULT_ROWS, in_unit

    for key, label, scale, unit in RESULT_ROWS:
        print(f"{label:38s} {in_unit(run.metrics[key], scale, unit)}")
    print(f"{'real time factor':38s} {run.metrics['real_time_factor']:.3g}")
    print(f"\nrun folder: {run.folder}\nlook at it: ttwmr view {run.folder}")


def _compare(options: argparse.Namespace) -> int:
    from ttwmr_mj.progress import progress_bar
    from ttwmr_mj.run_folder import open_folder, results_folder
    from ttwmr_mj.scenario_file import find_scenario, load_scenario
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


def _validate(options: argparse.Namespace) -> int:
    from ttwmr_mj.errors import InputError
    from ttwmr_mj.scenario_file import load_scenario

    faults = []
    for scenario in options.scenarios:
        try:
            load_scenario(scenario, options.overrides, options.seed, options.fragment)
        except InputError as error:
            faults.append(str(error))
    if faults:
        raise InputError("\n".join(faults))
    return 0


def _bench(options: argparse.Namespace) -> int:
    from ttwmr_mj.progress import progress_bar
    from ttwmr_mj.run_folder import open_folder, results_folder
    from ttwmr_mj.studies.bench.execute import run_suite
    from ttwmr_mj.studies.bench.leaderboard import collect, to_markdown, write_leaderboard
    from ttwmr_mj.studies.bench.suite import load_suite, rows_of

    suite = load_suite(options.suite)
    folder = options.out or results_folder("bench", suite.name)
    open_folder(folder, force=True)
    if not options.rescore:
        count = len(list(rows_of(suite)))
        with progress_bar(suite.name, count, "runs", options.quiet) as progress:
            run_suite(suite, folder, workers=options.workers, progress=progress)
    lines = collect(folder)
    title = f"{suite.name}: {suite.description}" if suite.description else suite.name
    write_leaderboard(lines, folder, title)
    if not options.quiet:
        print(to_markdown(lines, title))
        print(f"written to {folder}")
    return 0


def _calibrate(options: argparse.Namespace) -> int:
    from ttwmr_mj.calibrate import calibrate_from_images, calibrate_scenario, write_board
    from ttwmr_mj.scenario_file import load_scenario
    from ttwmr_mj.vision.calibration_file import save_calibration

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


def _track(options: argparse.Namespace) -> int:
    from ttwmr_mj.progress import progress_bar
    from ttwmr_mj.run_folder import open_folder, results_folder
    from ttwmr_mj.scenario_file import load_scenario
    from ttwmr_mj.track import track

    robot = load_scenario(options.scenario).robot
    folder = options.out or results_folder("track", Path(options.source).stem)
    open_folder(folder, options.force)
    with progress_bar("tracking", options.frames, "frames", options.quiet) as progress:
        done = track(
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


def _reproduce(options: argparse.Namespace) -> int:
    from ttwmr_mj.studies.reproduce.study import reproduce, verdict_table

    done = reproduce(options.out, options.only, quiet=options.quiet)
    if not options.quiet:
        print(f"{verdict_table(done.judgements)}\n\nreport: {done.report}".lstrip())
    for name, reason in done.failures.items():
        print(f"ttwmr: {name} could not be run: {reason}", file=sys.stderr)
    return 1 if done.runs_failed else 0


def _list(options: argparse.Namespace) -> int:
    del options
    import tomllib

    from ttwmr_mj.assets import shipped_scenarios

    for name, path in shipped_scenarios().items():
        print(f"{name:20s} {tomllib.loads(path.read_text()).get('description', '')}")
    return 0


def _view(options: argparse.Namespace) -> int:
    from ttwmr_mj.viewer import open_viewer

    return open_viewer(options.recording)


def _doctor(options: argparse.Namespace) -> int:
    del options
    from ttwmr_mj.doctor import examine

    text, healthy = examine()
    print(text)
    return 0 if healthy else 1


def _export_schema(options: argparse.Namespace) -> int:
    import json

    from ttwmr_mj.run_folder import write_text
    from ttwmr_mj.scenario import Scenario

    text = json.dumps(Scenario.model_json_schema(), indent=2, ensure_ascii=False) + "\n"
    if options.out:
        write_text(options.out, text)
    else:
        print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
