"""`ttwmr validate`: are these scenarios right?"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from ttwmr_mj.cli.engine import argument
from ttwmr_mj.cli.shared import SCENARIO, Overrides
from ttwmr_mj.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Validate(Overrides, name="validate"):
    """Check scenario files and print nothing if all is well."""

    scenarios: tuple[str, ...] = argument(SCENARIO)

    def call(self) -> int:
        """Check all of them, whatever is wrong with the first."""
        errors = []
        for scenario in self.scenarios:
            try:
                self.load(scenario)
            except InputError as error:
                if self.debug:
                    raise
                errors.append(error)
        for fault in errors:
            print(f"ttwmr: {fault}", file=sys.stderr)
        return 2 if errors else 0
