"""A subcommand is one file: what its types and fields become on the command line."""

from __future__ import annotations

import argparse
import sys
from dataclasses import FrozenInstanceError
from pathlib import Path

import pytest

from ttwmr_mj.cli import engine

GREET = '''
from pathlib import Path
from typing import Literal

from ttwmr_mj.cli.engine import Subcommand, argument, option


class Greet(Subcommand, name="greet"):
    """Greet people.

    More that the help leaves out.
    """

    people: tuple[str, ...] = argument("who")
    tone: Literal["warm", "dry"] = option("how", "warm")
    times: int = option("how often", metavar="N")
    cards: tuple[Path, ...] = option("what to bring", name="--card")

    def __call__(self) -> int:
        print(self.tone, self.times * self.people, self.cards)
        return 3
'''


@pytest.fixture
def parser(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> argparse.ArgumentParser:
    """A command line of which all commands are in a package with one file."""
    (tmp_path / "greetings").mkdir()
    (tmp_path / "greetings" / "__init__.py").touch()
    (tmp_path / "greetings" / "greet.py").write_text(GREET)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(engine.Subcommand, "registry", {})
    for name in ("greetings", "greetings.greet"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    parser = argparse.ArgumentParser(prog="test")
    subparsers = parser.add_subparsers(required=True)
    for name, kind in engine.load_subcommands("greetings").items():
        engine.add_subcommand(subparsers, name, kind)
    return parser


def test_a_file_in_the_package_is_a_subcommand(
    parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "greet Ada Emmy --times 2 --card a.png --tone dry --card b.png"
    greet = engine.parse(parser, words.split())
    assert greet() == 3
    assert capsys.readouterr().out == (
        f"dry ('Ada', 'Emmy', 'Ada', 'Emmy') {(Path('a.png'), Path('b.png'))}\n"
    )
    plain = engine.parse(parser, ["greet", "Ada", "--times", "1"])
    assert (plain.tone, plain.cards, plain.debug) == ("warm", (), False)  # type: ignore[attr-defined]
    with pytest.raises(FrozenInstanceError):
        plain.debug = True  # type: ignore[misc]


def test_its_help(parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        engine.parse(parser, ["--help"])
    assert "greet greet people" in " ".join(capsys.readouterr().out.split())
    with pytest.raises(SystemExit):
        engine.parse(parser, ["greet", "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert shown == (
        "usage: test greet [-h] [--tone {warm,dry}] --times N [--card CARDS] [--debug] "
        "PEOPLE [PEOPLE ...] Greet people. positional arguments: PEOPLE who options: "
        "-h, --help show this help message and exit --tone {warm,dry} how; default: warm "
        "--times N how often --card CARDS what to bring --debug show tracebacks"
    )


@pytest.mark.parametrize("words", ["greet --times 1", "greet Ada", "greet Ada --times one"])
def test_what_is_required_or_misread_is_refused(
    parser: argparse.ArgumentParser, words: str
) -> None:
    with pytest.raises(SystemExit) as left:
        engine.parse(parser, words.split())
    assert left.value.code == 2
