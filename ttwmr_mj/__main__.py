"""`python -m ttwmr_mj` is the `ttwmr` command."""

import os
import sys
from pathlib import Path

# `python -m` looks for every module in the working directory first: whose files are anybody's.
# What PYTHONPATH names comes after it, and stays
if (
    not sys.flags.safe_path
    and sys.path[:1] == [os.getcwd()]  # noqa: PTH109  # as it stands there
    and Path(__file__).parents[1] != Path.cwd()
):
    del sys.path[0]

from ttwmr_mj.cli.main import main

sys.exit(main())
