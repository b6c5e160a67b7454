"""`ttwmr drive`: the robot under a person's hands."""

import sys
from contextlib import suppress

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import SCENARIO, NewFolder, Overrides, command_line, ended_early
from ttwmr_mj.errors import InputError, to_copy


class DriveCommand(Overrides, NewFolder, name="drive"):
    """Drive the robot by arrow keys or gamepad, live in the viewer, and leave a run folder."""

    scenario: str = argument(SCENARIO, "lab_circle")
    live: str = option(
        "viewer: auto (a window, or without a display a browser), web, none, or "
        "rerun+http://HOST:PORT/proxy of one that runs",
        "auto",
        metavar="HOW",
    )
    longest: float = option("end after that at the latest", 600.0, metavar="SECONDS")

    def __call__(self) -> int:
        from ttwmr_mj.cli.viewing import viewing
        from ttwmr_mj.runs.by_hand.drive import drive_scenario
        from ttwmr_mj.runs.by_hand.hands import Hands

        if not 0.0 < self.longest <= 3600.0:
            got = f"{self.longest:g}"
            raise InputError.at("--longest", got=got, allowed="more than 0, up to 3600")
        if any(text.partition("=")[0].strip() == "duration_s" for text in self.overrides):
            problem = "a drive lasts until you end it"
            hint = "--longest ends it at the latest"
            raise InputError.at("--set duration_s", problem, hint=hint)
        scenario = self.load(self.scenario)
        hands = Hands()
        opened = self.new_folder(self.results(f"{scenario.name}-driven", scenario.seed))
        with opened as folder, viewing(None if self.live == "none" else self.live) as live:
            with hands:
                print(hands.told, flush=True)
                done = drive_scenario(
                    scenario,
                    hands,
                    folder,
                    longest_s=self.longest,
                    command_line=command_line(),
                    live=live,
                    tell=None if self.quiet else _status,
                )
            if done.outcome.status != "ok":
                raise ended_early(scenario.name, done)
            if self.quiet:
                print(folder)
            else:
                print(f"\ndriven for {done.outcome.time_s:.1f} s; run folder: {folder}")
                print(f"drive it again: {to_copy('run', folder / 'scenario.resolved.toml')}")
            return 0


def _status(text: str) -> None:
    with suppress(OSError):  # the terminal is gone, which the hands notice
        sys.stdout.write(f"\r{text}")
        sys.stdout.flush()
