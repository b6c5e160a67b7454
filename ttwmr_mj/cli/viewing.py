"""A viewer beside a command that runs."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from ttwmr_mj.cli.last_resort import say
from ttwmr_mj.deadline import step
from ttwmr_mj.recording.stream.live import LiveView
from ttwmr_mj.recording.stream.viewer import choose_viewer

LOOK_EVERY_S = 1.0


@contextmanager
def viewing(wish: str | None) -> Iterator[LiveView | None]:
    """The viewer that is wished for, if any; a page is served on at the end, on a terminal.

    Args:
        wish: as of `choose_viewer`; None: no viewer.

    Raises:
        InputError: there is no such viewer.
        MachineError: Rerun's viewer is not installed.
    """
    if wish is None:
        yield None
        return
    with LiveView(choose_viewer(wish)) as live:
        if live.viewer.page:
            print(f"open in a browser: {live.viewer.page}", flush=True)
        yield live
        if live.fault:
            say(f"warning: the viewer did not show all: {live.fault}")
        if live.viewer.page and live.alive and sys.stdin.isatty():
            print("the page is served until Ctrl-C", flush=True)
            with suppress(KeyboardInterrupt):
                while live.alive:
                    live.wait(LOOK_EVERY_S)
                    step()
                say(f"warning: the viewer ended: {live.fault or 'it was closed'}")
