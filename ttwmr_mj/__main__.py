"""`python -m ttwmr_mj` is the `ttwmr` command."""

import os
import sys

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
    and os.path.dirname(os.path.dirname(__file__)) != HERE[0]  # noqa: PTH120  # pathlib may be one
):
    del sys.path[0]

from ttwmr_mj.cli.main import main

sys.exit(main())
