"""`python -m ttwmr_mj` is the `ttwmr` command."""

import os
import sys
from pathlib import Path

try:
    HERE = [os.getcwd()]  # noqa: PTH109  # as it stands in sys.path
except OSError:  # it is gone
    HERE = []

# `python -m` looks for every module in the working directory first: whose files are anybody's.
# What PYTHONPATH names comes after it, and stays
if (
    not sys.flags.safe_path
    and HERE
    and sys.path[:1] == HERE
    and Path(__file__).parents[1] != Path.cwd()
):
    del sys.path[0]

from ttwmr_mj.cli.main import main

sys.exit(main())
