"""`ttwmr new`: a commented scenario to start from, and a law with its test."""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

from ttwmr_mj.cli.engine import argument, option
from ttwmr_mj.cli.shared import NewFiles
from ttwmr_mj.errors import InputError, to_copy

ALLOWED = "up to 58 lower-case letters, digits, - and _, a letter or digit first"


class New(NewFiles, name="new"):
    """Write a commented scenario to start from, and with --controller a law and its test."""

    name: str = argument(f"name of the scenario: {ALLOWED}")
    controller: bool = option(
        "also write a law, NAME_law.py, and its test, test_NAME_law.py; in these names - becomes "
        "_, and my_ is put before a digit at the beginning"
    )
    out: Path = option("folder for the files", Path(), metavar="DIR")

    def __call__(self) -> int:
        from ttwmr_mj.runs.files.template import template_files

        if not re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,57}", self.name):
            raise InputError.at("NAME", got=repr(self.name), allowed=ALLOWED)
        files = template_files(self.name, controller=self.controller)
        self.refuse_to_replace("NAME", *(self.out / file for file in files))
        self._write(files)
        scenario = self.out / f"{self.name}.toml"
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
