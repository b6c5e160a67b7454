"""`ttwmr new`: a commented scenario to start from, and a law with its test."""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import NewFiles
from ttwmr_mj.errors import InputError, to_copy


class New(NewFiles, name="new"):
    """Write a commented scenario to start from, and with --controller a law and its test."""

    wanted: str = argument("name of the scenario: lower-case letters, digits, - and _")
    controller: bool = option("also write a law, NAME_law.py, and its test, test_NAME_law.py")
    out: Path = option("folder for the files", Path(), metavar="DIR")

    def __call__(self) -> int:
        from ttwmr_mj.runs.files.template import template_files

        if not re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,57}", self.wanted):
            allowed = "up to 58 lower-case letters, digits, - and _, a letter or digit first"
            raise InputError.at("NAME", got=repr(self.wanted), allowed=allowed)
        files = template_files(self.wanted, controller=self.controller)
        self.refuse_to_replace("NAME", *(self.out / file for file in files))
        self._write(files)
        scenario = self.out / f"{self.wanted}.toml"
        print("\n".join(f"written: {self.out / file}" for file in files))
        print(f"check it: {to_copy('validate', scenario)}\nrun it: {to_copy('run', scenario)}")
        if self.controller:
            test = str(self.out / list(files)[-1])
            print(f"test it: {shlex.join(['python', '-m', 'pytest', test])}")
            if find_spec("pytest") is None:
                print("first, for that: pip install pytest")
        return 0

    def _write(self, files: dict[str, str]) -> None:
        from ttwmr_mj.files import together, write_text

        self.out.mkdir(parents=True, exist_ok=True)
        with together(self.out / file for file in files):
            for file, text in files.items():
                write_text(self.out / file, text)
