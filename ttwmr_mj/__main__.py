"""`python -m ttwmr_mj` is the `ttwmr` command."""

import os
import sys
from pathlib import Path

# `python -m` looks for every module in the working directory first: whose files are anybody's
if not sys.flags.safe_path and Path(__file__).parents[1] != Path.cwd():
    sys.path[:] = [place for place in sys.path if place not in ("", os.getcwd())]  # noqa: PTH109

from ttwmr_mj.cli.main import main

sys.exit(main())
