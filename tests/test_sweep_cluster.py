"""A Dask cluster for real: a scheduler and two workers on loopback, one killed in the middle."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sweeps import SMALL, here, plan_of, written
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError, MachineError
from ttwmr_mj.studies.sweep.cluster import on_cluster, shard_by_process
from ttwmr_mj.studies.sweep.execute import fill
from ttwmr_mj.studies.sweep.folder.plan_file import write_plan
from ttwmr_mj.studies.sweep.plan.plan import Plan

pytest.importorskip("distributed")
LOOPBACK = "127.0.0.1"


def free_port() -> int:
    with socket.socket() as found:
        found.bind((LOOPBACK, 0))
        return int(found.getsockname()[1])


@contextmanager
def cluster(workers: int, folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler's address, and its workers, each with one thread and a folder of its own."""
    address = f"tcp://{LOOPBACK}:{free_port()}"
    dask = [sys.executable, "-m", "dask"]
    scheduler = [*dask, "scheduler", "--host", address, "--dashboard-address", f"{LOOPBACK}:0"]
    worker = [*dask, "worker", address, "--host", LOOPBACK, "--nthreads", "1", "--no-dashboard"]
    processes = []
    try:
        for i, command in enumerate([scheduler, *[[*worker, "--no-nanny"]] * workers]):
            place = folder / f"machine-{i}"
            place.mkdir()
            with (place / "log").open("wb") as log:
                processes.append(
                    subprocess.Popen(
                        command, cwd=place, stdout=log, stderr=log, start_new_session=True
                    )
                )
        yield address, processes[1:]
    finally:
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return plan_of(tmp_path, SMALL)


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes_although_a_worker_dies(tmp_path: Path) -> None:
    text = SMALL.replace("0.4, 0.5]", "0.4, 0.5, 0.6, 0.7]")
    path = written(tmp_path, text)
    assert main(["sweep", path, "--out", str(tmp_path / "alone"), "--quiet"]) == 0
    with cluster(2, tmp_path) as (address, workers):
        command = [sys.executable, "-m", "ttwmr_mj", "sweep", path, "--scheduler", address]
        command += ["--out", str(tmp_path / "together"), "--chunk", "1", "--quiet"]
        sweep = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        shards = tmp_path / "together" / "shards"
        deadline = time.monotonic() + 600
        while len(list(shards.glob("*/*.parquet"))) < 3:
            assert time.monotonic() < deadline
            assert sweep.poll() is None
            time.sleep(0.05)
        os.kill(workers[0].pid, signal.SIGKILL)
        _, said = sweep.communicate(timeout=600)
        assert sweep.returncode == 0, said
    for name in ("results.parquet", "plan.json"):
        one, other = (tmp_path / folder / name for folder in ("alone", "together"))
        assert one.read_bytes() == other.read_bytes()


def test_nobody_answers(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ttwmr_mj.studies.sweep.cluster.CONNECT_S", 0.5)
    write_plan(tmp_path / "out", plan)
    address = f"tcp://{LOOPBACK}:{free_port()}"
    with pytest.raises(MachineError, match=f"no Dask scheduler answers at {address}"):
        fill(plan, tmp_path / "out", on_cluster(address))


@pytest.mark.parametrize(
    "address", ["", "nope", "head:8786", "tcp://head", "tcp://:x", "http://head:8786"]
)
def test_what_is_no_address_is_told_before_anything_is_made(
    address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["sweep", written(tmp_path, SMALL), "--out", str(tmp_path / "out")]
    assert main([*words, f"--scheduler={address}"]) == 2
    said = f"--scheduler: got {address!r}; allowed: protocol (tcp, tls, ws, wss), host and port, su"
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_task_is_what_this_process_computes(plan: Plan) -> None:
    rows = np.array([2, 3, 7])
    (done,) = here(plan, [rows])
    assert shard_by_process(plan, rows) == done.content  # type: ignore[union-attr]


@pytest.mark.slow
def test_a_worker_with_other_code_is_refused(plan: Plan) -> None:
    code = plan.made_of["code"] | {"ttwmr_mj.controllers.lyapunov": "0" * 16}
    other = replace(plan, made_of=plan.made_of | {"code": code})
    with pytest.raises(InputError, match=r"other code or files: code\.ttwmr_mj\.controllers\.lyap"):
        shard_by_process(other, np.array([0]))
