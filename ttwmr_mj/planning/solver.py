"""CasADi's solver, which takes Ctrl-C for a failure of its own and comments on it."""

import io
from contextlib import redirect_stderr
from typing import Any

from ttwmr_mj.runs.process.signals import noted


def solved(problem: Any) -> Any:
    """The solution of a `casadi.Opti`.

    Raises:
        KeyboardInterrupt: the user broke it off.
        RuntimeError: there is none.
    """
    with noted() as came, redirect_stderr(io.StringIO()):
        try:
            return problem.solve()
        finally:
            if came:
                raise KeyboardInterrupt
