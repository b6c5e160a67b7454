"""What report.html, its figures and failed.csv say of a sweep, against its table."""

from __future__ import annotations

import csv
import html
import json
import re
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.stats
from drawn import drawn
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from sweeps_drawn import FRICTION, HEADLINE, MASS, RATE, drawn_sweep

from sweeps import SMALL, here, plan_of
from ttwmr_mj.results.metrics import meaning_of
from ttwmr_mj.scenario.file import load_scenario
from ttwmr_mj.studies.sweep.answers.figures import _place_axis
from ttwmr_mj.studies.sweep.answers.findings import find
from ttwmr_mj.studies.sweep.answers.read import Sweep
from ttwmr_mj.studies.sweep.answers.report import write_report
from ttwmr_mj.studies.sweep.answers.slices import Slicing
from ttwmr_mj.studies.sweep.answers.words import parameter_label
from ttwmr_mj.studies.sweep.execute import fill
from ttwmr_mj.studies.sweep.folder.plan_file import write_plan

FRICTIONS = {"values": [0.0, 5e-4, 1e-3]}
RATES = {"values": [0.2, 0.6, 1.0]}
FIGURES = {
    "verdicts", "distribution", "pairs",
    "along-robot-hitch-coulomb-friction-n-m", "along-reference-angular-rate-rad-s",
    "map-robot-hitch-coulomb-friction-n-m-reference-angular-rate-rad-s",
}  # fmt: skip


class Told:
    """A drawn sweep of two variants on a grid with its report; columns are NumPy arrays."""

    def __init__(self, folder: Path) -> None:
        table = drawn_sweep(
            folder, {FRICTION: FRICTIONS, RATE: RATES}, variants=("flatness", "tvlqr"),
            seeds=4, lost_above=0.8,
        )  # fmt: skip
        self.folder = folder
        self.table = {name: np.array(values, dtype=object) for name, values in table.items()}
        self.terminal = write_report(folder).splitlines()
        self.page = (folder / "report.html").read_text()
        self.failed = self.table["verdict"] != "followed"

    def cells(self, label: str) -> list[list[str]]:
        """Rows of the table with that label, without their tags."""
        found = re.search(rf'aria-label="{re.escape(label)}">(.*?)</table>', self.page, re.DOTALL)
        assert found is not None, label
        rows = re.findall(r"<tr>(.*?)</tr>", found[1].partition("<tbody>")[2], re.DOTALL)
        cells = [re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL) for row in rows]
        return [[re.sub(r"<[^>]+>", "", cell).strip() for cell in row] for row in cells]


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> Told:
    return Told(tmp_path_factory.mktemp("grid") / "sweep")


@pytest.mark.parametrize(
    ("path", "label"),
    [
        ("robot.hitch.damping_n_m_s_rad", "hitch damping [N·m·s/rad]"),
        ("belief.robot.trailer.mass_kg", "believed trailer mass [kg]"),
        ("sensing.camera.noise.read_noise", "read noise"),
        ("sensing.latency_s", "sensing latency [s]"),
        ("duration_s", "duration [s]"),
    ],
)
def test_axes_are_labelled_in_words(path: str, label: str) -> None:
    assert parameter_label(path) == label


def exact(count: int, of: int, independent: int) -> str:
    yes, no = independent * count / of, independent * (of - count) / of
    low = scipy.stats.beta.ppf(0.025, yes, no + 1) if count else 0.0
    high = scipy.stats.beta.ppf(0.975, yes + 1, no) if count < of else 1.0
    return f"{100 * count / of:.3g} [{100 * low:.3g}, {100 * high:.3g}]"


def test_the_head_says_how_many_failed_and_how_sure_that_is(told: Told) -> None:
    count = int(told.failed.sum())
    assert 0 < count < 72
    assert f"{count} of 72 runs failed: {exact(count, 72, 36).replace(' [', ' % [')}." in told.page
    assert "72</b><span>runs: 9 draws × 2 variants × 4 seeds" in told.page
    broke = int((told.table["status"] != "ok").sum())
    assert f"<b>{broke}</b><span>broke off before the end" in told.page
    assert "several draws have the same noise." in told.page


def test_the_terminal_says_the_same(told: Told) -> None:
    count = int(told.failed.sum())
    runs, median, table, report = told.terminal
    assert runs.endswith(
        f": 72 runs, {count} failed: {exact(count, 72, 36).replace(' [', ' % [')}, 95 % interval"
    )
    ended = told.table["status"] == "ok"
    middle = 1e3 * np.median(np.where(ended, told.table[HEADLINE].astype(float), np.inf))
    assert median.startswith(f"{HEADLINE}: median {middle:.3g} mm [")
    assert table == f"table: {told.folder / 'results.parquet'}"
    assert report == f"report: {told.folder / 'report.html'}"


def test_each_variant_has_its_failure_rate_and_its_median(told: Told) -> None:
    for row, variant in zip(told.cells("Failure rates"), ("flatness", "tvlqr"), strict=True):
        here = told.table["variant"] == variant
        failed = int(told.failed[here].sum())
        assert row[:4] == [variant, "36", str(failed), exact(failed, 36, 36)]
        ended = told.table["status"][here] == "ok"
        numbers = np.where(ended, told.table[HEADLINE][here].astype(float), np.inf)
        assert row[4].split(" [")[0] == f"{1e3 * np.median(numbers):.3g}"
        assert row[4].endswith("]")


def test_every_verdict_is_counted(told: Told) -> None:
    rows = told.cells("Verdicts")
    for variant, verdict, count, share, when in rows:
        here = (told.table["variant"] == variant) & (told.table["verdict"] == verdict)
        assert int(count) == here.sum()
        assert share == exact(int(count), 36, 36)
        assert when
    assert sum(int(row[2]) for row in rows) == 72


@pytest.mark.slow
def test_along_a_parameter_runs_of_a_value_are_taken_together(
    told: Told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = told.cells("Along hitch coulomb friction [N·m]")
    assert len(rows) == 6
    for row, value in zip(rows[:3], FRICTIONS["values"], strict=True):
        here = (told.table["variant"] == "flatness") & (told.table[FRICTION] == value)
        assert row[1:4] == ["flatness", "12", str(int(told.failed[here].sum()))]
    curves = drawn(monkeypatch)
    for name in ("plan.json", "results.parquet"):
        (tmp_path / name).write_bytes((told.folder / name).read_bytes())
    write_report(tmp_path)
    x, y = curves["along-robot-hitch-coulomb-friction-n-m"]["failure rate [%] flatness"]
    assert x == FRICTIONS["values"]
    assert y == pytest.approx([100.0 * int(row[3]) / 12 for row in rows[:3]])
    # the same table, the same bytes, wherever
    assert (tmp_path / "report.html").read_text() == told.page


def test_variants_are_compared_run_by_run(told: Told) -> None:
    ((name, pairs, difference, smaller, unknown, _, ours, theirs, both),) = told.cells(
        "Paired comparison"
    )
    assert (name, pairs) == ("tvlqr − flatness", "36")
    one, other = (told.table["variant"] == variant for variant in ("flatness", "tvlqr"))
    assert int(ours) == (told.failed[other] & ~told.failed[one]).sum()
    assert int(theirs) == (told.failed[one] & ~told.failed[other]).sum()
    assert int(both) == (told.failed[one] & told.failed[other]).sum()
    numbers = [
        np.where(told.table["status"][v] == "ok", told.table[HEADLINE][v].astype(float), np.inf)
        for v in (other, one)
    ]
    known = np.isfinite(numbers[0]) | np.isfinite(numbers[1])
    assert int(unknown) == (~known).sum()
    differences = numbers[0][known] - numbers[1][known]
    assert difference.split(" [")[0] == f"{1e3 * np.median(differences):.3g}"
    assert smaller.split(" [")[0] == f"{100 * np.mean(differences < 0):.3g}"
    assert "flatness has a smaller steady trailer error than tvlqr" in told.page


def test_every_metric_has_its_quantiles(told: Told) -> None:
    rows = told.cells("All metrics")
    assert [row[0] for row in rows if row[0] == "settling_time_s"] == ["settling_time_s"] * 2
    assert not any(row[0] == "estimator_theta2_rmse_rad" for row in rows)  # null in every run
    (row,) = [r for r in rows if r[:2] == ["settling_time_s", "flatness"]]
    ended = told.table["status"] == "ok"
    here = told.table["variant"] == "flatness"
    times = told.table["settling_time_s"]
    kept = [t if fine and t is not None else np.inf for t, fine in zip(times, ended, strict=True)]
    assert row[2] == "s"
    assert row[4].split(" [")[0] == f"{np.median(np.array(kept)[here]):.3g}"


def test_a_metric_is_told_with_what_it_covers(told: Told) -> None:
    said = {row[0]: html.unescape(row[-1]) for row in told.cells("All metrics")}
    assert said == {name: meaning_of(name) for name in said}
    assert HEADLINE in said
    assert f"({HEADLINE}: {meaning_of(HEADLINE)})" in html.unescape(told.page)


def test_no_failed_run_is_left_out(told: Told) -> None:
    with (told.folder / "failed.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["row"]) for row in rows] == np.flatnonzero(told.failed).tolist()
    assert len(told.cells("Failed runs")) == len(rows)
    first = rows[0]
    assert first["reason"] == told.table["reason"][int(first["row"])]
    words = first["command"].split()
    assert words[:3] == ["ttwmr", "run", "lab_circle"]
    told_values = [words[i + 1] for i, word in enumerate(words) if word == "--set"]
    assert f"controller.kind={first['variant']}" in told_values
    scenario = load_scenario("lab_circle", [o for o in told_values if "controller" not in o])
    assert scenario.robot.hitch.coulomb_friction_n_m == float(first[FRICTION])
    assert scenario.duration_s == 20.0


def test_figures_are_files_and_in_the_page(told: Told) -> None:
    files = {path.name for path in (told.folder / "figures").iterdir()}
    assert files == {f"{name}.{ending}" for name in FIGURES for ending in ("png", "svg")}
    assert told.page.count('<svg class="drawing"') == len(FIGURES)
    assert not re.search(r'(src|href)="(?!#|failed\.csv|data:)', told.page)  # nothing from outside
    assert "--record worst:3" in told.page
    ids = re.findall(r'\bid="([^"]+)"', told.page)
    assert len(ids) == len(set(ids))
    used = set(re.findall(r"url\(#([^)]+)\)", told.page))
    assert used <= set(ids)


def test_one_run_alone_says_what_it_can(tmp_path: Path) -> None:
    drawn_sweep(tmp_path, {})
    (tmp_path / "recorded" / "row-000000000").mkdir(parents=True)
    (tmp_path / "recorded" / "row-000000000" / "run.rrd").touch()
    write_report(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "None of 1 runs failed: the failure rate is at most 97.5 %." in page
    assert "Along each parameter" not in page
    assert '<a href="recorded/row-000000000/run.rrd">row-000000000</a>.' in page
    assert "<p>None.</p>" in page
    assert "the same noise" not in page


def test_a_sweep_in_which_nothing_followed_is_no_error(tmp_path: Path) -> None:
    drawn_sweep(tmp_path, {FRICTION: FRICTIONS}, seeds=3, lost_above=-9.0, break_off=2.0)
    write_report(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "9 of 9 runs failed: 100 % [66.4, 100]." in page
    assert f"{HEADLINE} is undefined in every run" in page


def test_many_values_are_cut_into_bins_of_equally_many_runs(tmp_path: Path) -> None:
    table = drawn_sweep(
        tmp_path, {MASS: {"distribution": "uniform", "low": 0.25, "high": 0.45}, RATE: RATES},
        samples=2000,
    )  # fmt: skip
    sweep = Sweep.read(tmp_path)
    slicing = Slicing.of(sweep, sweep.axes[0])
    assert np.bincount(slicing.which(sweep)).tolist() == [200] * 10
    masses = np.sort(table[MASS])
    assert slicing.places[0] == pytest.approx(np.median(masses[:200]))
    along = find(sweep).along
    # the first parameter weighs twice as much as the second in the drawn errors
    assert 1.0 > along[0].explained > along[1].explained > 0.0
    assert sum(group.runs for group in along[0].groups[""]) == 2000


def test_ten_parameters_are_mapped_by_those_that_matter(tmp_path: Path) -> None:
    names = [f"robot.tractor.part{i}_kg" for i in range(10)]
    drawn_sweep(tmp_path, {n: {"low": 0.0, "high": 1.0} for n in names}, samples=400)
    found = find(Sweep.read(tmp_path))
    assert len(found.along) == 10
    assert len(found.maps) == 3
    assert {m.across.axis.path for m in found.maps} >= {names[0]}


def sensitivity(folder: Path, samples: int) -> dict[str, Any]:
    ranges: dict[str, dict[str, Any]] = {name: {"low": 0.0, "high": 1.0} for name in (MASS, RATE)}
    drawn_sweep(folder, ranges, samples=samples, sensitivity=True, lost_above=0.9)
    return {one.of: one for one in find(Sweep.read(folder)).sensitivity}


@pytest.mark.slow
def test_sobol_indices_find_what_the_drawn_errors_hang_on(tmp_path: Path) -> None:
    few = sensitivity(tmp_path / "few", 32)
    assert not any(index.converged for index in few["failed"].indices)
    many = sensitivity(tmp_path / "many", 2048)["rank"]
    first, second = many.indices
    assert many.samples == 2048
    # load = (2·mass + rate)/3 plus noise of its own in every run
    assert first.first.value > 2.0 * second.first.value > 0.0
    assert first.converged


@pytest.mark.slow
def test_what_is_not_converged_is_said_in_the_page(tmp_path: Path) -> None:
    sensitivity(tmp_path, 32)
    write_report(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert page.count("<td>not converged</td>") == 4
    assert "indices are of the error's rank, with those runs tied behind all others" in page
    assert "rank of steady trailer error" in page


@pytest.mark.slow
def test_the_report_of_a_sweep_that_ran(tmp_path: Path) -> None:
    plan, folder = plan_of(tmp_path, SMALL), tmp_path / "out"
    write_plan(folder, plan)
    fill(plan, folder, here)
    write_report(folder)
    page = (folder / "report.html").read_text()
    plan_said = json.loads((folder / "plan.json").read_text())
    assert plan_said["digest"] in page
    sweep = Sweep.read(folder)
    assert len(sweep) == 12
    assert f"{int(sweep.failed.sum())} of 12 runs failed" in page or "None of 12" in page
    assert "omitted" in page
    assert "published" in page
    assert "reference radius [m]" in page


def test_a_logarithmic_axis_has_plain_numbers_that_do_not_overlap() -> None:
    figure = Figure(figsize=(4.0, 3.0))
    axes = figure.add_subplot()
    axis = SimpleNamespace(path="controller.alpha4", logarithmic=True)
    along = SimpleNamespace(slicing=SimpleNamespace(axis=axis, numeric=True, places=(1.0, 30.0)))
    axes.plot(along.slicing.places, (0.0, 1.0))
    _place_axis(axes, along)
    FigureCanvasAgg(figure).draw()
    shown = [t for t in axes.get_xticklabels(which="both") if t.get_text()]
    assert {"2", "5", "10", "20"} <= {text.get_text() for text in shown}
    boxes = sorted((text.get_window_extent() for text in shown), key=lambda box: box.x0)
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))


def test_a_run_that_all_seeds_repeat_is_counted_once(tmp_path: Path) -> None:
    drawn_sweep(tmp_path, {FRICTION: FRICTIONS}, seeds=3)
    file = tmp_path / "results.parquet"
    columns = pq.read_table(file).to_pydict()
    assert len(Sweep.read(tmp_path).without_repeats()) == 9  # seeds differ
    fixed = ("row", "seed", "draw")
    first = {n: [v[i - i % 3] for i in range(9)] for n, v in columns.items() if n not in fixed}
    pq.write_table(pa.table(columns | first), file)
    assert len(Sweep.read(tmp_path).without_repeats()) == 3
    write_report(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "and 6 repeats are left out" in page
    assert "if its verdict is neither “followed” nor “no reference”" in page
    assert "× 1 variant × 1 seed" in page
    assert "somewhat too narrow" not in page
    first["tractor_rmse_m"][8] += 1e-9
    pq.write_table(pa.table(columns | first), file)
    assert len(Sweep.read(tmp_path).without_repeats()) == 9
