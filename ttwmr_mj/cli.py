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
    run.add_argument("--quiet", action="store_true", help="print nothing but errors")
    validate = command(
        "validate", _validate, "check scenario files and print nothing if all is well"
    )
    validate.add_argument("scenarios", nargs="+", metavar="scenario")
    _add_scenario_options(validate)
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
    parser.add_argument("--seed", type=int, help="replace the scenario's seed")


def _run(options: argparse.Namespace) -> int:
    from ttwmr_mj.progress import progress_bar
    from ttwmr_mj.run import run_scenario
    from ttwmr_mj.run_folder import open_run_folder
    from ttwmr_mj.scenario_file import find_scenario, load_scenario

    scenario = load_scenario(options.scenario, options.overrides, options.seed)
    folder = open_run_folder(scenario, options.out, options.force)
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


def _validate(options: argparse.Namespace) -> int:
    from ttwmr_mj.errors import InputError
    from ttwmr_mj.scenario_file import load_scenario

    faults = []
    for scenario in options.scenarios:
        try:
            load_scenario(scenario, options.overrides, options.seed)
        except InputError as error:
            faults.append(str(error))
    if faults:
        raise InputError("\n".join(faults))
    return 0


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
