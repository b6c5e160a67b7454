"""What a sweep says while it runs."""

from __future__ import annotations

import numpy as np
import pytest

from ttwmr_mj.studies.sweep import progress


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


def test_of_what_was_done_before_no_rate_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.sweep_progress("gains", 10) as told:
        assert told is not None
        told(10, 3)
    assert capsys.readouterr().err == "gains: 10 of 10 runs, 3 failed\n"
