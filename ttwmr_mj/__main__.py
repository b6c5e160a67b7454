"""`python -m ttwmr_mj` is the `ttwmr` command."""

import sys

from ttwmr_mj.cli.main import main

sys.exit(main())
