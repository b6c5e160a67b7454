"""Chunks computed on a Dask cluster: pure tasks that return their shards, so no disk is shared.

A task starts a process of its own on its worker, as chunks on this machine have one: a law's time
limit needs the main thread, OpenGL likes no threads, and what crashes takes no worker with it. A
worker that dies costs the chunks it was at; Dask gives them to others.
"""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from ttwmr_mj.errors import Fault, InputError, MachineError, RunError, TtwmrError
from ttwmr_mj.studies.pool.limits import reason_after
from ttwmr_mj.studies.sweep.compute import Broke, Compute, Outcome, computed
from ttwmr_mj.studies.sweep.plan.plan import Plan
from ttwmr_mj.studies.sweep.plan.sampling import IntArray

AHEAD = 2  # chunks that each processor of the cluster has waiting or under way
CONNECT_S = 30.0
# Dask waits a minute to give up a protocol that it does not know
ADDRESS = re.compile(r"(tcp|tls|ws|wss)://[^/\s]+:\d+/?")
DEATHS = 3  # workers that may die at a chunk before the chunk is to blame
HINT = "pip install 'ttwmr-mj[cluster]', on this machine and on every worker"


def on_cluster(address: str) -> Compute:
    """Computes chunks on the Dask cluster whose scheduler is there.

    Raises:
        InputError: this is no address.
        MachineError: dask.distributed is not installed, or nothing answers.
    """
    if not ADDRESS.fullmatch(address):
        allowed = "protocol (tcp, tls, ws, wss), host and port, such as tcp://head:8786"
        raise InputError.at("--scheduler", got=repr(address), allowed=allowed)

    def compute(plan: Plan, chunks: Iterable[IntArray]) -> Generator[Outcome, None, None]:
        with _client(address) as client, client.as_current(), _scheduler_lost(address):
            yield from _computed(client, plan, chunks)

    return compute


@contextmanager
def _scheduler_lost(address: str) -> Iterator[None]:
    """Say so in words."""
    from distributed.client import FuturesCancelledError

    try:
        yield
    except (FuturesCancelledError, OSError) as error:
        kept = "what is done is kept; the same command goes on"
        raise RunError(f"the Dask scheduler at {address} is gone; {kept}") from error


def _client(address: str) -> Any:
    try:
        from distributed import Client
    except ImportError as error:
        raise MachineError(f"--scheduler needs dask.distributed: {HINT}") from error
    try:
        return Client(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise MachineError(f"no Dask scheduler answers at {address}: {error}") from error


def _computed(
    client: Any, plan: Plan, chunks: Iterable[IntArray]
) -> Generator[Outcome, None, None]:
    """As many chunks at once as the cluster has room for; new workers make more room."""
    from distributed import wait

    waiting, running = iter(chunks), dict[Any, IntArray]()
    more = True
    while more or running:
        while more and len(running) < AHEAD * max(sum(client.nthreads().values()), 1):
            rows = next(waiting, None)
            more = rows is not None
            if rows is not None:
                future = client.submit(shard_by_process, plan, rows, pure=False)
                running[future] = rows
        if not running:
            return
        for future in wait(list(running), return_when="FIRST_COMPLETED").done:
            rows = running.pop(future)
            yield _outcome(future, rows)
            more = True  # what broke comes back in halves


def _outcome(future: Any, rows: IntArray) -> Outcome:
    from distributed.scheduler import KilledWorker

    error = future.exception()
    if isinstance(error, KilledWorker):
        return Broke(rows, f"the workers died that ran it: {error}")
    if error is not None:
        raise error
    result = future.result()
    return Broke(rows, result) if isinstance(result, str) else computed(rows, result)


def shard_by_process(plan: Plan, rows: IntArray) -> Any:
    """The task: a shard, an `Unexpected`, or, as text, how the process ended that should make it.

    Raises:
        TtwmrError: this worker cannot run the rows, or has other code than the plan is made of.
    """
    command = [sys.executable, "-P", "-m", __name__]  # nothing of the working directory
    asked = pickle.dumps((plan, rows))
    limit_s = plan.timeout_s * len(rows)
    try:
        done = subprocess.run(
            command, input=asked, capture_output=True, check=False, timeout=limit_s
        )
    except subprocess.TimeoutExpired:
        return reason_after(limit_s)
    if done.returncode or not done.stdout:
        words = done.stderr.decode(errors="replace").strip().splitlines()
        return f"the process ended with exit code {done.returncode}: {' '.join(words[-1:])}"
    answer = pickle.loads(done.stdout)
    if isinstance(answer, TtwmrError):
        raise answer
    return answer


def refuse_other_code(plan: Plan) -> None:
    """Raises InputError if rows computed here would not be those of the plan's own machine."""
    from ttwmr_mj.studies.pool.ingredients import differences
    from ttwmr_mj.studies.sweep.plan.build import completed

    here = completed(plan).made_of
    if differing := differences(plan.made_of, here):
        hint = "install the same versions everywhere, and put the files of the scenario there"
        shown = ", ".join(differing[:5])
        raise InputError(Fault(problem=f"a worker has other code or files: {shown}", hint=hint))


def main() -> None:
    """In the process of a task: read what to compute, answer with the shard."""
    from ttwmr_mj.studies.sweep.compute import shard_of

    plan, rows = pickle.load(sys.stdin.buffer)
    out = sys.stdout.buffer
    sys.stdout = sys.stderr  # what a law prints is no answer
    answer: Any
    try:
        refuse_other_code(plan)
        answer = shard_of(plan, rows)
    except TtwmrError as error:
        answer = error
    out.write(pickle.dumps(answer))


if __name__ == "__main__":
    main()
