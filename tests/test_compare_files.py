"""The comparison's files, its report in words, its gate, and what it refuses to begin."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from comparisons import TURN, open_loop

from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.compare import study
from ttwmr_mj.studies.compare.measures.gate import breaches, read_tolerances
from ttwmr_mj.studies.compare.pair import known_numbers, run_pair
from ttwmr_mj.studies.compare.study import Options, compare_scenario
from ttwmr_mj.studies.compare.text import fixed, markdown, plain


def test_the_gate_names_what_exceeded_what(tmp_path: Path) -> None:
    file = tmp_path / "tolerance.toml"
    file.write_text("theta2_deviation_max_rad = 1e-3\nposition_deviation_per_path = 1.0\n")
    numbers = {"theta2_deviation_max_rad": 2e-3, "position_deviation_per_path": None}
    found = breaches(read_tolerances(file, numbers), numbers)
    assert [str(breach) for breach in found] == [
        "theta2_deviation_max_rad: got 0.002, allowed: 0.001 at most",
        "position_deviation_per_path: got undefined, allowed: 1 at most",
    ]
    (close,) = breaches({"path_length_m": 0.284651}, {"path_length_m": 0.28465102})
    assert str(close) == "path_length_m: got 0.28465102, allowed: 0.284651 at most"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no tolerance"),
        ("a = ", "cannot be read"),
        ("theta2_deviation_max = 1.0", "did you mean 'theta2_deviation_max_rad'"),
        ("theta2_deviation_max_rad = -1.0", "0 or more"),
        ("theta2_deviation_max_rad = true", "0 or more"),
        ("theta2_deviation_max_rad = nan", "0 or more"),
    ],
)
def test_bad_tolerances_are_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "tolerance.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        read_tolerances(file, ["theta2_deviation_max_rad"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (Options(mode="closed_loop", real_wheels=True), "--real-wheels"),
        (Options(validate_on="spline"), "add --fit"),
        (Options(fit=True, validate_on="open_loop_turn"), "on another scenario"),
    ],
)
def test_contradictions_are_refused(tmp_path: Path, options: Options, message: str) -> None:
    with pytest.raises(InputError, match=message):
        compare_scenario(load_scenario("open_loop_turn"), tmp_path, options)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("options", [Options(), Options(attribute=False, converge=True)])
def test_what_knows_the_plain_model_only_refuses_the_extended_one(
    tmp_path: Path, options: Options
) -> None:
    extended = "plant.analytic.extended={wheel_radius_m=0.026, track_width_m=0.119}"
    with pytest.raises(InputError, match=r"plant\.analytic\.extended: .*--no-attribution"):
        compare_scenario(load_scenario("open_loop_turn", [extended]), tmp_path, options)
    assert not any(tmp_path.iterdir())


def test_a_fit_is_validated_on_what_the_fitted_robot_can_drive(tmp_path: Path) -> None:
    from ttwmr_mj.scenario.file import load_scenario

    options = Options(fit=True, validate_on="inverted_trailer")  # whose law tows one trailer
    with pytest.raises(InputError, match=r"--validate-on.*inverted_trailer") as error:
        compare_scenario(load_scenario("two_trailers_turn"), tmp_path, options)
    assert "controller.kind" in str(error.value)
    assert not any(tmp_path.iterdir())


def test_tolerances_are_known_before_anything_runs() -> None:
    assert known_numbers(1) == list(run_pair(open_loop((0.1, 1.0, 1.0))).numbers)


def test_tolerances_are_those_of_the_scenarios_trailers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["compare", "two_trailers_turn", "--no-attribution", "--quiet"]
    for override in ("duration_s=0.3", "output.figures=false", "output.recording=false"):
        words += ["--set", override]
    gate, out = tmp_path / "gate.toml", tmp_path / "out"
    gate.write_text("theta4_deviation_rms_rad = 0.5\n")
    assert main([*words, "--tolerance", str(gate), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert (
        "theta4_deviation_rms_rad: unknown key (did you mean 'theta3_deviation_rms_rad'?)" in said
    )
    assert "trailer_2/caster_trailer_left_slip_aside_max_m_s" in said.split("allowed: ")[1]
    assert not out.exists()
    # every number that compare.json has is one that may be bounded
    assert main([*words, "--out", str(out)]) == 0
    report = json.loads((out / "compare.json").read_text())
    numbers = [key for key in report if re.search("_m$|_rad$|_s$|_j$", key)]
    bounds = {key: 2.0 * abs(report[key]) + 1e-9 for key in numbers}
    assert {"theta3_deviation_rms_rad", "trailer_2/caster_trailer_right_slip_along_max_m_s"} <= (
        bounds.keys()
    )
    gate.write_text("".join(f'"{key}" = {bound!r}\n' for key, bound in bounds.items()))
    assert main([*words, "--tolerance", str(gate), "--out", str(out), "--force"]) == 0
    gate.write_text('"trailer_2/caster_trailer_right_slip_along_max_m_s" = 0.0\n')
    assert main([*words, "--tolerance", str(gate), "--out", str(out), "--force"]) == 1
    assert "trailer_2/caster_trailer_right_slip_along_max_m_s: got" in capsys.readouterr().err


def test_the_files(tmp_path: Path) -> None:
    scenario = open_loop(*TURN)
    options = Options(attribute=False)
    done = compare_scenario(scenario, tmp_path, options, command_line=["ttwmr", "compare"])
    names = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert {"compare.json", "manifest.json", "contact.parquet", "analytic.parquet"} <= names
    assert {"run.rrd", "figures/deviation.svg", "figures/paths.png", "report.html"} <= names
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["command_line"] == ["ttwmr", "compare"]
    report = json.loads((tmp_path / "compare.json").read_text())
    assert report == done.report
    assert report["attribution"] is None
    assert report["mode"] == "open_loop"
    for key in (
        "position_deviation_max_m",
        "position_deviation_per_path",
        "theta1_deviation_max_rad",
        "theta2_deviation_rms_rad",
        "theta2_deviation_max_rad",
    ):
        assert report[key] > 0.0
    page = (tmp_path / "report.html").read_text()
    assert page.count('<svg class="drawing"') == 4
    assert '<a href="run.rrd">' in page
    assert f"{1e3 * report['position_deviation_max_m']:.3g} mm</b><span>P, largest" in page
    assert "Where it comes from" not in page
    assert "ttwmr compare scenario.resolved.toml --no-attribution" in page


def test_two_controllers_are_told_to_leave_nothing_to_attribute(tmp_path: Path) -> None:
    scenario = load_scenario("lab_circle", ["duration_s=0.2"])
    options = Options(mode="closed_loop", converge=True, recording=False, figures=False)
    report = compare_scenario(scenario, tmp_path, options).report
    assert report["attribution"] is None
    left_out, refined = report["notes"]
    assert "compare in open loop" in left_out
    assert refined.startswith("convergence: made in open loop")
    page = (tmp_path / "report.html").read_text()
    assert left_out in page
    assert "Where it comes from" not in page
    assert "ttwmr compare scenario.resolved.toml --mode closed_loop --converge" in page
    for words in (plain(report), markdown(report)):
        assert "compare in open loop" in words.replace("\n", " ")


def test_a_fit_refuses_commands_that_are_late(tmp_path: Path) -> None:
    late = load_scenario("open_loop_turn", ["control.command_latency_s=0.01"])
    with pytest.raises(InputError, match=r"--fit: .*control\.command_latency_s"):
        compare_scenario(late, tmp_path, Options(fit=True))


def test_the_page_tells_where_the_deviation_comes_from(tmp_path: Path) -> None:
    options = Options(recording=False, figures=False)
    report = compare_scenario(open_loop((0.2, 5.0, 4.0)), tmp_path, options).report
    page = (tmp_path / "report.html").read_text()
    row = report["attribution"]["theta2"]["caster_inertia"]
    cells = re.search(
        r"<tr><td>caster inertia</td>\s*(.*?)</tr>", page.split("<h3>θ2</h3>")[1], re.S
    )
    assert cells is not None
    told = re.findall(r"<td[^>]*>([^<]*)</td>", cells[1])
    sizes = [row[f"{name}_rad"] for name in ("alone", "interaction", "contribution")]
    assert told == [*(fixed(1e3 * size) for size in sizes), f"{100 * row['share']:.1f} %"]
    assert (tmp_path / "attribution.parquet").is_file()
    assert "run.rrd" not in page


def test_a_report_in_words(tmp_path: Path) -> None:
    options = Options(converge=True, recording=False, figures=False)
    report = compare_scenario(open_loop((0.2, 5.0, 4.0)), tmp_path, options).report
    words = plain(report)
    deviation = 1e3 * report["position_deviation_max_m"]
    assert re.search(rf"^P, largest deviation +{deviation:.4g} mm$", words, re.MULTILINE)
    order = report["convergence"]["order"]["theta2_deviation_max_rad"]
    assert re.search(rf"^order of convergence of θ2 +{order:.4g}$", words, re.MULTILINE)
    assert "undefined" not in words
    row = report["attribution"]["theta2"]["caster_inertia"]
    size, share = 1e3 * row["contribution_rad"], 100.0 * row["share"]
    assert re.search(rf"^ +caster inertia .* {size:.4f} mrad +{share:.1f} %$", words, re.MULTILINE)
    assert "| caster inertia | " in markdown(report)
    assert f"{size:.4f} mrad | {share:.1f} % |" in markdown(report)
    gain = {"scenario": "straight_line", "factor": {"fell": 20.0, "rose": 0.05}}
    words = plain(report | {"fit": {"parameters": {}, "validation": gain}})
    assert re.search(r"^  fell +fell to 1/20$", words, re.MULTILINE)
    assert re.search(r"^  rose +rose 20-fold$", words, re.MULTILINE)


def test_the_recording_holds_both_robots(tmp_path: Path) -> None:
    from rerun.chunk import RrdReader

    compare_scenario(open_loop(*TURN), tmp_path, Options(attribute=False, figures=False))
    reader = RrdReader(str(tmp_path / "run.rrd"))
    paths = {str(chunk.entity_path).strip("/") for chunk in reader.stream()}
    assert {"world/tractor", "world/analytic/tractor", "world/deviation"} <= paths
    assert {"plots/position/true", "plots/angles/true", "report"} <= paths
    assert not any(path.startswith("world/analytic/floor") for path in paths)


def test_the_command_line_is_a_gate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gate = tmp_path / "gate.toml"
    gate.write_text("position_deviation_max_m = 1e-9\n")
    common = ["compare", "open_loop_turn", "--no-attribution", "--quiet", "--set", "duration_s=1.0"]
    common += ["--set", "output.recording=false", "--set", "output.figures=false"]
    out = ["--out", str(tmp_path / "a"), "--tolerance", str(gate)]
    assert main([*common, *out]) == 1
    assert "position_deviation_max_m: got" in capsys.readouterr().err
    gate.write_text("position_deviation_max_m = 1.0\n")
    assert main([*common, *out, "--force"]) == 0
    gate.write_text("position = 1.0\n")
    assert main([*common, *out, "--force"]) == 2


def test_one_progress_bar_is_split_over_the_parts() -> None:
    shown: list[float] = []
    for part in study._parts(shown.append, 2):
        assert part is not None
        part(0.25)
    assert shown == [0.125, 0.625]
    for part in study._parts(None, 1):
        assert part is not None
        part(0.5)  # nobody looks


@pytest.mark.slow
def test_a_run_in_which_nothing_moves_is_no_fault(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    segment = "controller.segments=[{duration_s=0.3,wheel_right_rad_s=0,wheel_left_rad_s=0}]"
    words = ["compare", "open_loop_turn", "--no-attribution", "--quiet", "--set", segment]
    words += ["--set", "duration_s=0.3", "--set", "output.figures=false"]
    assert main([*words, "--converge", "--out", str(tmp_path / "a")]) == 0
    study = json.loads((tmp_path / "a" / "compare.json").read_text())["convergence"]
    assert study["position_deviation_per_path"] == [None] * 4
    assert study["order"]["position_deviation_per_path"] is None
    assert main([*words, "--fit", "--out", str(tmp_path / "b")]) == 1
    assert "nothing can be fitted to open_loop_turn" in capsys.readouterr().err
