"""The command line: parse, call, print. Exit 0 done, 1 the run failed, 2 the input is wrong."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from ttwmr_mj.cli import commands
from ttwmr_mj.errors import RunError, TtwmrError

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
    subparsers = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    def command(name: str, call: Callable[[Any], int], text: str) -> argparse.ArgumentParser:
        sub = subparsers.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        sub.add_argument("--debug", action="store_true", help="show tracebacks")
        sub.set_defaults(call=call)
        return sub

    run = command("run", commands.run, "run a scenario and leave a run folder")
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
        "validate", commands.validate, "check scenario files and print nothing if all is well"
    )
    validate.add_argument("scenarios", nargs="+", metavar="scenario")
    _add_scenario_options(validate)
    compare = command(
        "compare",
        commands.compare,
        "compare contact physics with the analytic model and explain it",
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
    bench = command("bench", commands.bench, "run a suite of controllers on tasks and rank them")
    bench.add_argument("suite", nargs="?", default="quick", help="a TOML file or a shipped suite")
    bench.add_argument("--out", type=Path, metavar="DIR", help="finished rows in it are reused")
    bench.add_argument("--rescore", action="store_true", help="score what --out holds, run nothing")
    bench.add_argument("--workers", type=int, metavar="N", help="processes; default: processors")
    bench.add_argument("--quiet", action="store_true", help="print nothing but errors")
    calibrate = command("calibrate", commands.calibrate, "calibrate a camera with a ChArUco board")
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
    track = command("track", commands.track, "track the robot through a video or a camera's stream")
    track.add_argument("source", help="a video file, or a camera's index")
    track.add_argument("--calibration", type=Path, required=True, metavar="YAML")
    track.add_argument("--scenario", default="lab_circle", help="whose robot is in the pictures")
    track.add_argument("--frames", type=int, metavar="N", help="stop after N frames")
    track.add_argument("--out", type=Path, metavar="DIR", help="for poses.parquet and track.rrd")
    track.add_argument("--force", action="store_true", help="write into a folder that is not empty")
    track.add_argument("--quiet", action="store_true", help="print nothing but errors")
    again = command(
        "reproduce", commands.reproduce, "re-run the article: every figure, every claim"
    )
    again.add_argument("--out", type=Path, metavar="DIR", default=Path("results/reproduce"))
    again.add_argument(
        "--only", action="append", default=[], metavar="FIG", help="one figure; may be given often"
    )
    again.add_argument("--quiet", action="store_true", help="print nothing but errors")
    command("list", commands.list_scenarios, "list the shipped scenarios")
    view = command("view", commands.view, "open a recording in the Rerun viewer")
    view.add_argument("recording", nargs="?", type=Path, help="run folder or .rrd; default: newest")
    command("doctor", commands.doctor, "say what this machine has and what is missing")
    schema = command("export-schema", commands.export_schema, "print the JSON Schema of scenarios")
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


if __name__ == "__main__":
    sys.exit(main())
