"""Every option of every subcommand: its help, and how it is read."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from ttwmr_mj.cli.command_line import parse
from ttwmr_mj.cli.commands.bench import Bench
from ttwmr_mj.cli.commands.calibrate import Calibrate
from ttwmr_mj.cli.commands.compare import Compare
from ttwmr_mj.cli.commands.doctor import Doctor
from ttwmr_mj.cli.commands.drive import DriveCommand
from ttwmr_mj.cli.commands.export_schema import ExportSchema
from ttwmr_mj.cli.commands.list import List
from ttwmr_mj.cli.commands.new import New
from ttwmr_mj.cli.commands.plan import PlanCommand
from ttwmr_mj.cli.commands.reproduce import Reproduce
from ttwmr_mj.cli.commands.run import RunCommand
from ttwmr_mj.cli.commands.score import Score
from ttwmr_mj.cli.commands.sweep import Sweep
from ttwmr_mj.cli.commands.track import TrackCommand
from ttwmr_mj.cli.commands.validate import Validate
from ttwmr_mj.cli.commands.video import VideoCommand
from ttwmr_mj.cli.commands.view import View
from ttwmr_mj.cli.engine import load_subcommands, make_dataclass
from ttwmr_mj.cli.main import main

NAMES = (
    "bench",
    "calibrate",
    "compare",
    "doctor",
    "drive",
    "export-schema",
    "list",
    "new",
    "plan",
    "reproduce",
    "run",
    "score",
    "sweep",
    "track",
    "validate",
    "video",
    "view",
)
for kind in load_subcommands("ttwmr_mj.cli.commands").values():
    make_dataclass(kind)  # a command line makes one only of the subcommand that it names
SHARED = "--set a.b=1 --set c=x --fragment f.toml --fragment g.toml --seed 3"
OVERRIDES: dict[str, Any] = {
    "overrides": ("a.b=1", "c=x"),
    "fragments": (Path("f.toml"), Path("g.toml")),
    "seed": 3,
}
FOLDER: dict[str, Any] = {"out": Path("o"), "force": True, "quiet": True}
EVERYTHING = {
    "sweep a.toml --out o --dry-run --set a.b=1 --extend --shard 1/2 --merge p q --record median "
    "--scheduler tcp://h:1 --workers 3 --chunk 4 --max-rows 5 --quiet --debug": Sweep(
        sweep="a.toml",
        out=Path("o"),
        dry_run=True,
        overrides=("a.b=1",),
        extend=True,
        shard="1/2",
        merge=("p", "q"),
        record="median",
        scheduler="tcp://h:1",
        workers=3,
        chunk=4,
        max_rows=5,
        quiet=True,
        debug=True,
    ),
    f"run a.toml {SHARED} --out o --force --quiet --save-frames --paper-plots --require lost "
    "--live --pace 0.5 --debug": RunCommand(
        scenario="a.toml",
        live="auto",
        pace=0.5,
        save_frames=True,
        paper_plots=True,
        require="lost",
        debug=True,
        **OVERRIDES,
        **FOLDER,
    ),
    f"validate a.toml b.toml {SHARED} --load --debug": Validate(
        scenarios=("a.toml", "b.toml"), run_code=True, debug=True, **OVERRIDES
    ),
    f"compare a {SHARED} --mode closed_loop --real-wheels --no-attribution --converge --fit "
    "--validate-on b --tolerance t.toml --out o --force --quiet --live=web --pace 2 "
    "--debug": Compare(
        live="web",
        pace=2.0,
        scenario="a",
        mode="closed_loop",
        real_wheels=True,
        no_attribution=True,
        converge=True,
        fit=True,
        validate_on="b",
        tolerance=Path("t.toml"),
        debug=True,
        **OVERRIDES,
        **FOLDER,
    ),
    "bench s.toml --out o --rescore --workers 2 --max-rows 9 --quiet --debug": Bench(
        suite="s.toml", out=Path("o"), rescore=True, workers=2, max_rows=9, quiet=True, debug=True
    ),
    f"calibrate c {SHARED} --images i --board b.png --out c.yaml --force --debug": Calibrate(
        scenario="c",
        images=Path("i"),
        board=Path("b.png"),
        out=Path("c.yaml"),
        force=True,
        debug=True,
        **OVERRIDES,
    ),
    "track v.avi --calibration c.yaml --scenario a --frames 7 --out o --force --quiet --debug "
    "--live=rerun+http://h:1/proxy --pace 0": TrackCommand(
        source="v.avi",
        calibration=Path("c.yaml"),
        scenario="a",
        frames=7,
        live="rerun+http://h:1/proxy",
        pace=0.0,
        debug=True,
        **FOLDER,
    ),
    f"drive a {SHARED} --live=none --longest 9 --out o --force --quiet --debug": DriveCommand(
        scenario="a", live="none", longest=9.0, debug=True, **OVERRIDES, **FOLDER
    ),
    "video r -o r.gif --view chase --speed 2 --start 1 --stop 3 --force --quiet --debug": (
        VideoCommand(
            run=Path("r"),
            out=Path("r.gif"),
            view="chase",
            speed=2.0,
            start=1.0,
            stop=3.0,
            force=True,
            quiet=True,
            debug=True,
        )
    ),
    "reproduce --out o --only fig-3 --only fig-4 --quiet --debug": Reproduce(
        out=Path("o"), only=("fig-3", "fig-4"), quiet=True, debug=True
    ),
    "score r --quiet --debug": Score(run=Path("r"), quiet=True, debug=True),
    "new mine --controller --out o --force --debug": New(
        name="mine", controller=True, out=Path("o"), force=True, debug=True
    ),
    f"plan a.svg {SHARED} --out o.csv --force --closed --duration 9 --scenario s --workspace 2 1 "
    "--hitch-angle 90 --scale 0.01 --quiet --debug": PlanCommand(
        points=Path("a.svg"),
        out=Path("o.csv"),
        force=True,
        closed=True,
        duration=9.0,
        scenario="s",
        workspace=(2.0, 1.0),
        hitch_angle=90.0,
        scale=0.01,
        quiet=True,
        debug=True,
        **OVERRIDES,
    ),
    "list --debug": List(debug=True),
    "view r.rrd --web --debug": View(recording=Path("r.rrd"), web=True, debug=True),
    "doctor --debug": Doctor(debug=True),
    "export-schema --out s.json --force --debug": ExportSchema(
        out=Path("s.json"), force=True, debug=True
    ),
}
NOTHING = {
    "run a": {
        "scenario": "a",
        "require": None,
        "save_frames": False,
        "paper_plots": False,
        "live": None,
        "pace": None,
        "overrides": (),
        "fragments": (),
        "seed": None,
        "out": None,
        "force": False,
        "quiet": False,
        "debug": False,
    },
    "compare a": {
        "mode": "open_loop",
        "real_wheels": False,
        "no_attribution": False,
        "converge": False,
        "fit": False,
        "validate_on": None,
        "tolerance": None,
    },
    "bench": {"suite": "quick", "out": None, "rescore": False, "workers": None},
    "calibrate": {
        "scenario": "lab_circle_camera",
        "images": None,
        "board": None,
        "out": Path("calibration.yaml"),
        "force": False,
    },
    "track 0 --calibration c.yaml": {"source": "0", "scenario": "lab_circle", "frames": None},
    "reproduce": {"out": Path("results/reproduce"), "only": ()},
    "view": {"recording": None, "web": False},
    "drive": {"scenario": "lab_circle", "live": "auto", "longest": 600.0},
    "video r": {
        "out": Path("run.mp4"),
        "view": "both",
        "speed": 1.0,
        "start": 0.0,
        "stop": None,
        "force": False,
    },
    "export-schema": {"out": None, "force": False},
    "new a": {"name": "a", "controller": False, "out": Path()},
    "plan a": {
        "points": Path("a"),
        "closed": False,
        "duration": None,
        "scenario": None,
        "workspace": (),
        "hitch_angle": 115.0,
        "scale": 1e-3,
    },
}


@pytest.mark.parametrize("words", EVERYTHING)
def test_every_option_is_read_as_its_type(words: str) -> None:
    wanted = EVERYTHING[words]
    assert parse(words.split()) == wanted
    given = {entry.name for entry in fields(wanted) if getattr(wanted, entry.name) != entry.default}
    assert given == {entry.name for entry in fields(wanted)}, "an option this test does not give"


def test_no_subcommand_is_forgotten() -> None:
    assert tuple(sorted(load_subcommands("ttwmr_mj.cli.commands"))) == NAMES
    assert {type(wanted) for wanted in EVERYTHING.values()} == {
        *load_subcommands("ttwmr_mj.cli.commands").values()
    }


@pytest.mark.parametrize("words", NOTHING)
def test_what_is_not_given_has_its_default(words: str) -> None:
    options = parse(words.split())
    assert {name: getattr(options, name) for name in NOTHING[words]} == NOTHING[words]


@pytest.mark.parametrize(
    ("words", "fault"),
    [
        ("run", "required: SCENARIO"),
        ("validate", "required: SCENARIO"),
        ("track v.avi", "required: --calibration"),
        ("run a --seed x", "argument --seed: invalid int value: 'x'"),
        ("compare a --mode sideways", "invalid choice: 'sideways'"),
        ("run a --sped 3", "unrecognized arguments: --sped"),
        ("list lab_circle", "unrecognized arguments: lab_circle"),
        ("list \x1b[31m", r"unrecognized arguments: \x1b[31m"),
        ("run a --\x1b[2J=3", r"unrecognized arguments: --\x1b[2J=3"),
    ],
)
def test_wrong_words_leave_with_exit_code_2(
    words: str, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        parse(words.split())
    assert left.value.code == 2
    assert fault in capsys.readouterr().err


@pytest.mark.parametrize("name", NAMES)
def test_help_says_what_every_option_does(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        parse([name, "--help"])
    assert left.value.code == 0
    shown = " ".join(capsys.readouterr().out.split())
    kind = load_subcommands("ttwmr_mj.cli.commands")[name]
    assert kind.__doc__
    assert kind.__doc__.splitlines()[0] in shown
    for entry in fields(kind):
        assert entry.metadata["help"] in shown, entry.name
        assert entry.metadata.get("metavar") is None or entry.metadata["metavar"] in shown


def test_the_overview_names_every_command_and_the_version_is_that_of_the_package(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as left:
        parse(["--help"])
    assert left.value.code == 0
    shown = " ".join(capsys.readouterr().out.split())
    for name, kind in load_subcommands("ttwmr_mj.cli.commands").items():
        summary = (kind.__doc__ or "").splitlines()[0].rstrip(".")
        assert f"{name} {summary[0].lower()}{summary[1:]}" in shown
    assert "ttwmr run lab_circle a shipped scenario, by name" in shown
    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    from importlib.metadata import version

    assert capsys.readouterr().out == f"ttwmr-mj {version('ttwmr-mj')}\n"
