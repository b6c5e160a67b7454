"""Tests hear the signals that a terminal sends, wherever the shell runs them."""

from __future__ import annotations

import signal


def pytest_configure() -> None:
    """What a shell runs in its background ignores SIGINT and SIGQUIT, and under nohup SIGHUP.

    Its children inherit that.
    """
    for name, handler in (
        ("SIGINT", signal.default_int_handler),
        ("SIGQUIT", signal.SIG_DFL),
        ("SIGHUP", signal.SIG_DFL),
    ):
        if hasattr(signal, name):
            signal.signal(signal.Signals[name], handler)
