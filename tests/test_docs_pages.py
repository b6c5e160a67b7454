"""README and every page of docs/: scenarios are valid, commands parse, links lead somewhere."""

from __future__ import annotations

import re
import shlex
import shutil
import tomllib
from itertools import combinations
from pathlib import Path

import pytest

from ttwmr_mj.cli.command_line import parse
from ttwmr_mj.scenario.file import load_scenario

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
PLAN = ROOT / "ttwmr_mj" / "references" / "data" / "waypoints_lab.csv"
SWEEPS = DOCS / "howto" / "sweeps.md"  # has a test of its own
REST = {
    "name": 'name = "rest"',
    "duration_s": "duration_s = 1.0",
    "reference": 'reference = {kind = "flat_circle", radius_m = 0.6, angular_rate_rad_s = 1.0}',
    "controller": 'controller = {kind = "tvlqr"}',
}
every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


def blocks(language: str, page: Path) -> list[str]:
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.M | re.S)


def lines(page: Path) -> list[str]:
    """Of all blocks for a shell, continued lines joined; what a `cat` writes is no command."""
    text = "\n".join(blocks("sh", page)).replace("\\\n", " ")
    return re.sub(r"<<'END'.*?^END$", "", text, flags=re.M | re.S).splitlines()


@every_page
def test_its_scenarios_are_valid(page: Path, tmp_path: Path) -> None:
    shutil.copy(PLAN, tmp_path / "my_path.csv")  # as the pages before have made one
    for block in blocks("toml", page) if page != SWEEPS else ():
        given = tomllib.loads(block)
        missing = "\n".join(line for key, line in REST.items() if key not in given)
        (tmp_path / "mine.toml").write_text(f"{missing}\n{block}")
        load_scenario(str(tmp_path / "mine.toml"))


@every_page
def test_its_commands_parse(page: Path) -> None:
    for line in lines(page) if page != SWEEPS else ():
        words = shlex.split(line, comments=True)
        if words[:1] == ["ttwmr"] and words[1:]:
            parse(words[1:])  # argparse leaves with SystemExit on what it does not know


@every_page
def test_the_tests_that_it_names_exist(page: Path) -> None:
    code = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").glob("*.py"))
    there = set(re.findall(r"^ *def (test_\w+)", code, flags=re.M))
    assert not set(re.findall(r"`(test_\w+)`", page.read_text(encoding="utf-8"))) - there


@every_page
def test_its_scripts_exist(page: Path) -> None:
    for line in lines(page):
        for script in re.findall(r"\bpython3? (\S+\.py)", line):
            assert (ROOT / script).is_file(), line


@every_page
def test_its_links_lead_to_files(page: Path) -> None:
    links = re.findall(r"\]\((?!http)([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    made = [link for link in links if "gallery/" in link]  # by the build, each from a script
    for link in made:
        name = re.sub(r"^sphx_glr_|_\d+$", "", Path(link).stem)
        assert name == "index" or (ROOT / "examples" / f"{name}.py").is_file(), link
    assert [link for link in links if link not in made and not (page.parent / link).exists()] == []


def written(page: Path) -> set[Path]:
    """What its blocks write, without endings: beside a plan go its scenario and its picture."""
    code = "\n".join(blocks("sh", page) + blocks("python", page) + blocks("toml", page))
    named = r'(?:--out |-o |cat > |\bPath\("|^name = ")([\w./-]+)'
    return {Path(name).with_suffix("") for name in re.findall(named, code, flags=re.M)}


def test_no_two_pages_write_the_same_file() -> None:
    """Who types both would find one refused, or lose what a third one goes on with."""
    pages = {page: written(page) for page in PAGES}
    assert Path("results/filmed") in pages[DOCS / "tutorial" / "with_the_camera.md"]
    for one, other in combinations(pages, 2):
        assert not pages[one] & pages[other], (one.name, other.name)


@every_page
def test_it_is_in_a_table_of_contents(page: Path) -> None:
    if page.name in ("README.md", "index.md"):
        return
    assert re.search(rf"^{page.stem}$", (page.parent / "index.md").read_text("utf-8"), re.M)


def test_pages_are_in_the_structure_only() -> None:
    rooms = {page.parent.name for page in PAGES[1:] if page.parent != DOCS}
    assert rooms == {"tutorial", "howto", "theory", "reference", "results", "project"}
    assert [page.name for page in PAGES if page.parent == DOCS] == ["index.md"]
