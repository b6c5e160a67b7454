"""`ttwmr validate`: are these scenarios valid?"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.last_resort import say
from ttwmr_mj.cli.shared import SCENARIO, Overrides, warn
from ttwmr_mj.cli.supervisor import supervise
from ttwmr_mj.errors import InputError, MachineError, printable

if TYPE_CHECKING:
    from ttwmr_mj.scenario.schema import Scenario


class Validate(Overrides, name="validate"):
    """Check scenario files; says "valid" of each that is."""

    scenarios: tuple[str, ...] = argument(SCENARIO)
    run_code: bool = option(
        "import laws of your own and start them, which runs their code; else their files are read",
        name="--load",
    )

    def __call__(self) -> int:
        from ttwmr_mj.runs.judgement.foresight import foretold

        errors = []
        for name in self.scenarios:
            try:
                scenario = self.load(name)
                self._check(name, scenario)
                warn(foretold(scenario))
            except InputError as error:
                if self.debug:
                    raise
                errors.append(error)
        for fault in errors:
            say(str(fault))
        return 2 if errors else 0

    def _check(self, name: str, scenario: Scenario) -> None:
        """A law of the user's, and what a run builds of the rest.

        Raises:
            InputError: with what is wrong with it.
        """
        from ttwmr_mj.runs.build import refuse_unbuildable
        from ttwmr_mj.runs.rehearsal import rehearsed
        from ttwmr_mj.scenario.file import find_scenario

        file = find_scenario(name)
        if self.run_code:
            supervise(scenario)
        faults = rehearsed(scenario, file.parent, load=self.run_code)
        if faults:
            raise InputError(*faults, file=str(file))
        try:
            with suppress(MachineError):  # what this machine lacks is no fault of the scenario
                refuse_unbuildable(scenario, file.parent)
        except InputError as error:
            raise InputError(*error.faults, file=error.file or str(file)) from error
        print(f"{printable(name)}: valid{self._left_out(scenario)}")

    def _left_out(self, scenario: Scenario) -> str:
        """What only a run finds out, in brackets; empty: nothing."""
        left = []
        if scenario.controller.kind == "custom":
            read = "read, not run; --load imports and starts it"
            done = "imported and started" if self.run_code else read
            left.append(f"{getattr(scenario.controller, 'target', '')} was {done}")
        if scenario.sensing.kind == "camera" and scenario.sensing.calibration_path is None:
            left.append(
                "whether its camera can be calibrated, a run finds out before its first row"
            )
        return f" ({'; '.join(left)})" if left else ""
