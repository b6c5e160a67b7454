"""The command line."""

from ttwmr_mj.cli.main import main

__all__ = ["main"]
