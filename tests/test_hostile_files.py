"""Whatever a file or a command line holds, the answer is a result or an InputError, and soon."""

from __future__ import annotations

import copy
import math
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ttwmr_mj.assets import scenarios_folder, shipped_scenarios
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.files import MOST_LEVELS, parse_toml, read_toml
from ttwmr_mj.planning.points import read_points
from ttwmr_mj.recording.scene.floor import floor_shapes
from ttwmr_mj.runs.judgement.foresight import foretold
from ttwmr_mj.scenario.file import check_scenario, dump_scenario, load_scenario, read_scenario
from ttwmr_mj.studies.bench.suite import load_suite, shipped_suites
from ttwmr_mj.studies.compare.measures.gate import read_tolerances
from ttwmr_mj.studies.sweep.plan.file import load_sweep, shipped_sweeps

LONGEST_S = 5.0  # of processor time: no answer takes that long

VALUES: list[Any] = [
    *(0, 1, -1, 3, -5, 10**18, -(2**63), True, False),
    *(0.0, -0.0, 1e-308, 5e-324, 1e300, -1e308, 1e-9, 1e9, math.inf, -math.inf, math.nan, 0.033),
    *("", "x", "lab", "cameras", "on_refrence", "a\0b", "\x1b[2J", "/etc/passwd", "é" * 300),
    *([], [1], [[1, 2], [3, 4]], ["lab"], [{}], [1e300, 1e-300], [{"kind": "x"}]),
    *({}, {"kind": "x"}, {"a": {}}, {"preset": "lab"}),
]
NAMES = ["", " ", "int", "[key]", "list[int]", "mass[kg]", "a[", "x[0]", "a.b", "é" * 300]

Keys = tuple[str | int, ...]


def keys_of(data: Any, outer: Keys = ()) -> Iterator[Keys]:
    items = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in items:
        yield (*outer, key)
        if isinstance(value, dict | list):
            yield from keys_of(value, (*outer, key))


def mutated(data: dict[str, Any], known: list[Keys], rng: random.Random) -> dict[str, Any]:
    """A copy with one to three values replaced, added at keys old and new, or left out."""
    data = copy.deepcopy(data)
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        *outer, last = rng.choice(known)
        if isinstance(last, str) and rng.random() < 0.1:
            last = rng.choice(NAMES)
        value = copy.deepcopy(rng.choice(VALUES))
        if rng.random() < 0.2:
            value = rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-12.0, 12.0)
        place: Any = data
        try:
            for key in outer:
                listed = isinstance(key, int) or not isinstance(place, dict)
                place = place[key] if listed else place.setdefault(key, {})
            if rng.random() < 0.15:
                place.pop(last)
            elif isinstance(last, str) or isinstance(place, list):
                place[last] = value
        except (LookupError, TypeError, AttributeError):
            continue  # nothing is there
    return data


def survives(read: Callable[[], object], given: object) -> bool:
    """Whether it was accepted; anything but an error for users fails the test."""
    began_s, told = process_time(), None
    try:
        read()
    except (InputError, MachineError) as error:
        told = str(error)
    assert process_time() - began_s < LONGEST_S, given
    assert told is None or told.strip(), given
    return told is None


@pytest.fixture(scope="module")
def scenarios() -> tuple[list[tuple[dict[str, Any], Path]], list[Keys]]:
    """Shipped scenarios as given and with every default, and the keys of all."""
    found = []
    for name, path in shipped_scenarios().items():
        found.append((read_scenario(path), path.parent))
        found.append((parse_toml(dump_scenario(load_scenario(name))), path.parent))
    return found, sorted({key for data, _ in found for key in keys_of(data)}, key=str)


def try_scenarios(scenarios: Any, seeds: range) -> None:
    bases, known = scenarios
    accepted = 0
    for seed in seeds:
        rng = random.Random(seed)
        data, folder = rng.choice(bases)
        data = mutated(data, known, rng)

        def read(data: dict[str, Any] = data, folder: Path = folder) -> None:
            foretold(check_scenario(data, "mine.toml", folder))

        accepted += survives(read, data)
    assert 0 < accepted < len(seeds)


@pytest.mark.filterwarnings("error")
def test_scenarios_of_all_kinds(scenarios: Any) -> None:
    try_scenarios(scenarios, range(500))


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_a_great_many_scenarios(scenarios: Any) -> None:
    try_scenarios(scenarios, range(1_000, 21_000))


def try_files(folder: Path, seeds: range) -> None:
    """Suites, sweeps and tolerances."""
    kinds: list[tuple[list[dict[str, Any]], Callable[[Path], object]]] = [
        ([read_toml(p) for p in shipped_suites().values()], lambda p: load_suite(str(p))),
        ([read_toml(p) for p in shipped_sweeps().values()], lambda p: load_sweep(str(p))),
        ([{"a": 1.0, "b": 2}], lambda p: read_tolerances(p, ["a", "b"])),
    ]
    file = folder / "mine.toml"
    for seed in seeds:
        rng = random.Random(seed)
        bases, read = kinds[seed % len(kinds)]
        known = sorted({key for data in bases for key in keys_of(data)}, key=str)
        data = mutated(rng.choice(bases), known, rng)
        file.write_text(tomli_w.dumps(data), encoding="utf-8")
        survives(lambda read=read: read(file), data)


@pytest.mark.filterwarnings("error")
def test_suites_sweeps_and_tolerances(tmp_path: Path) -> None:
    try_files(tmp_path, range(450))


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_a_great_many_suites_sweeps_and_tolerances(tmp_path: Path) -> None:
    try_files(tmp_path, range(1_000, 6_000))


@pytest.mark.filterwarnings("error")
@settings(max_examples=200, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.binary(max_size=200), st.sampled_from([".csv", ".svg", ".toml"]))
def test_bytes_for_files(tmp_path: Path, content: bytes, suffix: str) -> None:
    file = tmp_path / f"mine{suffix}"
    file.write_bytes(content)
    readers: list[Callable[[], object]] = [lambda: read_points(file), lambda: read_toml(file)]
    for read in readers:
        survives(read, content)


WORDS = [
    *("validate", "run", "list", "lab_circle", "no.toml", "--set", "--seed", "-1", "--out"),
    *("seed=1", "sensing.kind=cameras", "initial.kind=on_refrence", 'sensing.preset=["lab"]'),
    *("duration_s=1e-308", "duration_s=1e300", "duration_s=" + "9" * 5000, "a=" + "[" * 5000),
    *("int=1", "a[=1", "robot.trailer.mass[kg]=0.3", "plant.pushes[0].start_s=1", "[key]=1"),
    *("=", ".", "a..b=1", "reference=1", "accept=[]", "--quie", "", "\0", "é", "--fragment"),
]


@settings(max_examples=60, suppress_health_check=list(HealthCheck), deadline=None)
@given(st.lists(st.sampled_from(WORDS), max_size=5))
def test_command_lines(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    line = ["validate", "lab_circle", *(word for word in words if word not in ("run", "list"))]
    try:
        code: object = main(line)
    except SystemExit as end:
        code = end.code
    told = capsys.readouterr().err
    assert code in (0, 2)
    assert "Traceback" not in told
    assert "unexpected" not in told
    assert (code == 0) or told.strip()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a = " + "[" * 5000 + "]" * 5000, "more than 32 deep"),
        ("a = " + "[" * 33 + "]" * 33, "more than 32 deep"),
        ("[" + ".".join(["a"] * 40) + "]", "more than 32 deep"),
        ("a = " + "9" * 5000, "4300 digits"),
        ("a = [{b = 9223372036854775808}]", "64 bits"),
    ],
)
def test_toml_of_no_reasonable_shape(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=told) as caught:
        read_toml(file)
    assert str(file) in str(caught.value)


def test_toml_of_a_shape_that_is_allowed() -> None:
    deep = "[" * (MOST_LEVELS - 1) + "9223372036854775807" + "]" * (MOST_LEVELS - 1)
    assert parse_toml(f"a = {deep}")


def test_a_device_is_not_read_for_ever() -> None:
    with pytest.raises(InputError, match="larger than 16,000,000 bytes"):
        read_toml(Path("/dev/zero"))


def test_a_tolerance_is_finite(tmp_path: Path) -> None:
    file = tmp_path / "t.toml"
    file.write_text("a = 1e309")
    with pytest.raises(InputError, match="a finite number"):
        read_tolerances(file, ["a"])


def test_a_camera_that_the_scene_lacks_is_an_input_error() -> None:
    scenario = load_scenario("lab_circle_camera", ["sensing.camera.name=above"])
    with pytest.raises(InputError, match="got 'above'; allowed: 'overhead'"):
        foretold(scenario)


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("control.sampling_time_s=1e-5", r"at least 2\.5e-05: 2,000,000 periods"),
        ("reference.centre_m=[100000.0, 0.0]", r"reference: leads 1e\+05 m away; allowed: within"),
    ],
)
def test_what_would_not_fit_is_refused(override: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        load_scenario("lab_circle", ["plant.kind=analytic", override])


def test_the_grid_of_a_large_floor_is_bounded() -> None:
    for extent_m, lines in ((1.0, 10), (100.0, 1000), (5e3, 500)):
        _, grid = floor_shapes(np.array([[-0.05, -0.05], [extent_m - 0.05, extent_m - 0.05]]))
        assert grid.strips is not None
        assert abs(len(grid.strips.as_arrow_array()) - 2 * lines) <= 2


@pytest.mark.parametrize(
    ("text", "first", "left"),
    [
        ("plant = {pushes = [" + "{}," * 200 + "]}", "plant.pushes.0.start_s: missing", 500),
        ("plant = {pushes = [" + "{}," * 20_000 + "]}", "plant.pushes.0.start_s: missing", 900),
        ("\n".join(f"k{i} = 1" for i in range(20_000)), "k0: unknown key", 900),
    ],
)
def test_of_many_faults_the_first_are_told(
    text: str, first: str, left: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A hundred of them; no more than a thousand are looked for, in a second or two."""
    whole = (shipped_scenarios()["lab_circle"]).read_text(encoding="utf-8")
    (tmp_path / "a.toml").write_text(text + "\n" + whole, encoding="utf-8")
    assert main(["validate", str(tmp_path / "a.toml")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert first in lines[1]
    assert lines[101:] == [f"  and {left} more"]


PUSH = "plant.pushes=[{start_s=0.1,duration_s=0.1,force_n=[1.0,0.0]}]"
CAMERA = str(scenarios_folder() / "calibration" / "lab_camera.yaml")


@pytest.mark.parametrize("number", ["9" * 5000, "²"])
@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["sweep", "gains", "--record", "worst:{}"], "--record: got"),
        (["sweep", "gains", "--shard", "1/{}"], "--shard: got"),
        (["validate", "lab_circle", "--set", PUSH, "--set", "plant.pushes.{}.x=1"], "got index"),
        (["track", "99999999999", "--calibration", CAMERA], "no such video"),
    ],
)
def test_a_number_of_any_length_is_told(
    words: list[str], told: str, number: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([word.replace("{}", number) for word in words]) == 2
    err = capsys.readouterr().err
    assert told in err
    assert "unexpected" not in err
    assert len(err) < 500


MANY = "\n".join(f"k{i} = 1" for i in range(20_000))


@pytest.mark.parametrize(
    ("read", "text", "told"),
    [
        (load_sweep, MANY, "\n  and 900 more"),
        (load_suite, f"{MANY}\n[controller.a]", "\n  and 900 more"),
        (load_sweep, "seeds = 400_000_000", "seeds: got 400000000; allowed: 1 to 1000000, or a l"),
        (load_sweep, f"seeds = [{'1,' * 100_000}]", "..; allowed: one or more, each once"),
    ],
)
def test_a_sweep_or_suite_of_any_size_is_told_of_soon(
    read: Callable[[str], object], text: str, told: str, tmp_path: Path
) -> None:
    file, began_s = tmp_path / "mine.toml", process_time()
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        read(str(file))
    assert told in str(caught.value)
    assert len(str(caught.value)) < 20_000
    assert process_time() - began_s < LONGEST_S


def test_words_of_any_length_are_not_repeated(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", "lab_circle", "--set", f"{'a' * 9000}=1"]) == 2
    with pytest.raises(SystemExit):
        main(["run", "lab_circle", "--" + "a" * 9000])
    assert max(map(len, capsys.readouterr().err.splitlines())) < 1100
