"""What a sweep says while it runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sweeps import SMALL, plan_of
from ttwmr_mj.studies.sweep import progress, words


def test_a_log_is_told_soon_and_then_less_and_less_often(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    clock = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: clock[0])
    with progress.sweep_progress("gains", 1000) as told:
        assert told is not None
        for done in range(0, 1001):  # one a second
            clock[0] = float(done)
            told(done, done // 10)
    lines = capsys.readouterr().err.splitlines()
    at = [int(line.split(": ")[1].split(" ")[0]) for line in lines]
    assert at[:6] == [0, 2, 4, 8, 16, 32]
    assert set(np.diff(at[6:-1])) == {60}  # at most a minute apart
    assert lines[3] == "gains: 8 of 1000 runs, 0 failed, 1 runs/s, 992 s left"
    assert at[-1] == 1000


def test_set_up_is_no_part_of_what_grows_with_the_runs(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    plan, duration_s = plan_of(tmp_path, SMALL.replace("0.4", "30.0", 1)), 30.0
    # 3 s of set-up, and half a second for every simulated one, of the few rows together
    monkeypatch.setattr(words, "_probed", lambda *given: 3.0 + 0.5 * given[-1])
    probed = min(plan.rows, words.PROBED)
    expected = (3.0 + 0.5 * duration_s) * plan.rows / probed / 2
    assert words.estimated_time_s(plan, 2) == pytest.approx(expected)


def test_of_what_was_done_before_no_rate_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.sweep_progress("gains", 10) as told:
        assert told is not None
        told(10, 3)
    assert capsys.readouterr().err == "gains: 10 of 10 runs, 3 failed\n"
