"""Where a command begins: from here on Ctrl-C ends it in a line, whatever is still to be imported.

So this imports next to nothing before that.
"""

import os
import signal
import sys
from collections.abc import Sequence
from types import FrameType

STOPPING = signal.SIGINT, signal.SIGTERM


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line that these words (None: those of this process) are.

    Returns:
        The exit code.
    """
    ours = STOPPING if words is None else ()
    before = {n: signal.signal(n, _stop) for n in ours if signal.getsignal(n) != signal.SIG_IGN}
    from ttwmr_mj.cli import command_line

    for signum, handler in before.items():  # also for the processes that a law forks
        signal.signal(signum, handler)
    return command_line.main(words)


def _stop(signum: int, frame: FrameType | None) -> None:
    """While nothing has been done: what an import makes of an exception would be a traceback."""
    del signum, frame
    os.write(2, b"ttwmr: stopped\n")
    os._exit(1)


if __name__ == "__main__":
    sys.exit(main())
