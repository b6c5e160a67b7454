"""`ttwmr compare`: the analytic model against contact physics, and where the difference is from."""

from ttwmr_mj.studies.compare.pair import Pair, run_pair
from ttwmr_mj.studies.compare.study import Comparison, Options, compare_scenario
from ttwmr_mj.studies.compare.text import plain

__all__ = ["Comparison", "Options", "Pair", "compare_scenario", "plain", "run_pair"]
