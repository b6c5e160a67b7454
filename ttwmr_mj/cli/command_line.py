"""The command line: parse, call, print. Exit 0 done, 1 the run failed, 2 the input is wrong."""

import argparse
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from ttwmr_mj.cli import engine, last_resort, supervisor
from ttwmr_mj.errors import LONGEST_REASON, cut, in_one_line
from ttwmr_mj.runs.process.signals import WAITING, give_back, handled_by, interrupt

TRY = """three to try:
  ttwmr run lab_circle           drive the laboratory's circle, in contact physics
  ttwmr view                     look at the recording of it
  ttwmr list                     what else there is: scenarios, laws, references, studies
"""
EXAMPLES = """examples:
  ttwmr run lab_circle                     a shipped scenario, by name
  ttwmr run my.toml --out results/mine     a scenario of your own
  ttwmr compare lab_circle                 contact physics against the analytic model
  ttwmr run lab_circle --set plant.kind=analytic --set controller.alpha1=40
  ttwmr view                               the newest recording under results/
"""


def main(words: Sequence[str] | None) -> int:
    """As of `ttwmr_mj.cli.main`."""
    code = _main(words)
    if supervisor.own_process:
        last_resort.leave_threads(code)
    return code


def _main(words: Sequence[str] | None) -> int:
    debug, supervisor.own_process = False, words is None
    subcommand = None
    try:
        last_resort.open_streams()
        if supervisor.own_process:
            last_resort.outlast_readers()
        with _ended_like_ctrl_c():
            words = last_resort.readable(sys.argv[1:] if words is None else words)
            subcommand = parse(words)
            last_resort.refuse_narrow_limits()
            last_resort.refuse_late_clock()
            if supervisor.own_process:
                last_resort.forget_variables()
            debug = supervisor.debug = subcommand.debug
            if supervisor.own_process and not debug and not sys.warnoptions:
                _hush_libraries()
            return last_resort.close_streams(subcommand())
    except supervisor.Over as over:
        return last_resort.close_streams(over.code)
    except BaseException as error:
        if isinstance(error, SystemExit) and subcommand is None:  # of argparse, which has told all
            code = error.code if isinstance(error.code, int) else last_resort.FAILED
            raise SystemExit(last_resort.close_streams(code)) from None
        if debug and not isinstance(error, KeyboardInterrupt):
            raise
        return last_resort.close_streams(last_resort.told(error))


def _hush_libraries() -> None:
    """Not to print warnings of numbers, which results tell, but one of ours."""
    warnings.simplefilter("ignore")
    warnings.filterwarnings("always", module=r"ttwmr_mj\.registry")
    others = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        ours = category.__module__ == "ttwmr_mj.registry"
        last_resort.say(str(message)) if ours else others(message, category, *where, **more)

    warnings.showwarning = show


def parse(words: Sequence[str] | None = None) -> engine.Subcommand:
    """The subcommand that the words (None: of this process) ask for, with its options.

    Without words it prints the help and leaves with 0.
    """
    words = sys.argv[1:] if words is None else words
    parser = _Parser(
        prog="ttwmr",
        description="A tractor towing a trailer on spherical wheels: models and contact physics.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, help="print the version and exit")
    subparsers = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    known = engine.load_subcommands("ttwmr_mj.cli.commands")
    for name, kind in known.items():
        engine.add_subcommand(subparsers, name, kind, options=name in words)
    if not words:
        print(f"{parser.format_help()}\n{TRY}", end="")
        parser.exit()
    if not words[0].startswith("-") and words[0] not in known:
        parser.error(
            f"there is no command {words[0]!r}{_like(words[0], list(known))}; ttwmr --help"
        )
    return engine.parse(parser, words)


def _like(word: str, known: list[str]) -> str:
    import difflib

    close = difflib.get_close_matches(word, known, n=1)
    return f"; did you mean {close[0]!r}?" if close else f"; there are {', '.join(known)}"


@contextmanager
def _ended_like_ctrl_c() -> Iterator[None]:
    """While it lasts SIGTERM and a closed terminal end a command like Ctrl-C: files are closed.

    In a process of the command's own neither comes afterwards: what there is to keep is kept, and
    its last words and the interpreter's end are not to be broken off.
    """
    if threading.current_thread() is not threading.main_thread():  # which alone gets signals
        yield
        return
    before = handled_by(interrupt)
    try:
        yield
    finally:
        if supervisor.own_process:
            for signum in WAITING:
                signal.signal(signum, signal.SIG_IGN)
        else:
            give_back(before)


class _Parser(argparse.ArgumentParser):
    """Unlike argparse's own, it repeats no words of any length, nor what a terminal would obey."""

    def error(self, message: str) -> NoReturn:
        super().error(in_one_line(cut(message, LONGEST_REASON)))


class _Version(argparse.Action):
    """Unlike argparse's own, it looks the version up only when asked."""

    def __init__(self, **options: Any) -> None:
        super().__init__(nargs=0, **(options | {"dest": argparse.SUPPRESS}))

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from ttwmr_mj import __version__

        print(f"ttwmr-mj {__version__}")
        parser.exit()
