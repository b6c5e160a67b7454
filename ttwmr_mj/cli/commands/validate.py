"""`ttwmr validate`: are these scenarios valid?"""

import sys

from ttwmr_mj.cli.engine import argument
from ttwmr_mj.cli.shared import SCENARIO, Overrides, warn
from ttwmr_mj.errors import InputError


class Validate(Overrides, name="validate"):
    """Check scenario files and print nothing if they are valid."""

    scenarios: tuple[str, ...] = argument(SCENARIO)

    def __call__(self) -> int:
        from ttwmr_mj.runs.foresight import foretold

        errors = []
        for scenario in self.scenarios:
            try:
                warn(foretold(self.load(scenario)))
            except InputError as error:
                if self.debug:
                    raise
                errors.append(error)
        for fault in errors:
            print(f"ttwmr: {fault}", file=sys.stderr)
        return 2 if errors else 0
