"""sweep(): many flights of one plan under conditions that vary, on all cores, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from aerobat.control import ControlLaw, Controller, named_controller
from aerobat.declaration import PathName, Seed, validated
from aerobat.engines.cores import available_cores
from aerobat.environment import Dispersion, as_dispersion
from aerobat.flatness import vehicle_of
from aerobat.planning import Plan
from aerobat.simulation import Outcome
from aerobat.studies.sweep.flights import CHUNK, Chunk, SweepTask, fly_chunk
from aerobat.studies.sweep.kept import KeptChunks
from aerobat.studies.sweep.result import Sweep
from aerobat.studies.workers import InProcess, Workers
from aerobat.studies.workers import workers as processes
from aerobat.vehicle import Vehicle

Runs = Annotated[int, Field(ge=1, le=10**7, description="whole number from 1 to ten million")]
Batch = Annotated[int, Field(ge=1, le=CHUNK, description=f"whole number from 1 to {CHUNK}")]

_AHEAD = 2  # chunks for each worker that wait to be flown
_WELL = tuple(outcome.name.lower() for outcome in Outcome if outcome.is_success)

Span = tuple[int, int]
Progress = Callable[[int, int], None]


@validated
def sweep(
    plan: Plan,
    conditions: Dispersion | str,
    runs: Runs = 1000,
    seed: Seed = 0,
    *,
    vehicle: Vehicle | str | None = None,
    controller: Controller | ControlLaw | str | None = None,
    engine: str = "auto",
    batch: Batch = CHUNK,
    workers: Workers | None = None,
    executor: Executor | None = None,
    keep: PathName | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Fly a plan many times, each flight with its own draw of the conditions, and say what it comes to.

    Flight k draws from `SeedSequence(seed, spawn_key=(k,))`: batches, workers and interruptions change no
    bit, and a sweep of more flights begins with those of fewer. Flights are scored as they are flown; those
    over whose time errors are shown are the first ones.

    Args:
        plan: what is flown.
        conditions: what varies, or the name of a preset or a file.
        runs: how many flights.
        seed: of their draws.
        vehicle: the nominal one, or its name, by default the plan's.
        controller: settings, a law or the name of one; by default the vehicle's own.
        engine: as for FlightConfig.
        batch: flights that are flown side by side in one process: fewer take less memory.
        workers: processes, by default one a core; 1 flies in this process.
        executor: what flies instead, as `dask.distributed.Client(...).get_executor()`.
        keep: a folder for finished flights, from which a sweep that was ended goes on; it stays.
        progress: called with the flights done, and of them those that went well, as they are finished.

    Raises SpecError for arguments that make no sense, and for a folder that keeps another sweep's flights.
    """
    conditions = as_dispersion(conditions)
    vehicle = vehicle_of(plan, vehicle)
    if isinstance(controller, str):
        controller = named_controller(controller, vehicle.controller)
    task = SweepTask(plan, vehicle, conditions, seed, controller or vehicle.controller, engine, batch)
    kept = None if keep is None else KeptChunks.of(Path(keep), task)
    spans = [(begin, min(begin + CHUNK, runs)) for begin in range(0, runs, CHUNK)]
    tally = _Tally(progress)
    chunks = {}
    for span in spans:
        found = None if kept is None else kept.read(*span)
        if found is not None:
            chunks[span] = tally.counted(found)
    missing = [span for span in spans if span not in chunks]
    cores = workers or available_cores()

    def finish(executor: Executor, spans: Sequence[Span], cancels: bool = False) -> None:
        for span, chunk in _in_parallel(executor, task, spans, _AHEAD * cores, cancels):
            if kept is not None:
                kept.write(*span, chunk)
            chunks[span] = tally.counted(chunk)

    if executor is not None:
        finish(executor, missing, cancels=True)
    else:
        finish(InProcess(), missing[:1])  # compiles what all processes share
        with processes(min(cores, max(len(missing) - 1, 1)), not engine.startswith("jax")) as pool:
            finish(pool, missing[1:])
    return _joined(task, [chunks[span] for span in spans])


class _Tally:
    """Flights done, and how many of them went well."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._done = self._well = 0

    def counted(self, chunk: Chunk) -> Chunk:
        """The chunk, once it is counted."""
        outcomes = chunk.columns["outcome"]
        self._done += len(outcomes)
        self._well += int(np.isin(outcomes, _WELL).sum())
        if self._progress is not None:
            self._progress(self._done, self._well)
        return chunk


def _in_parallel(
    executor: Executor, task: SweepTask, spans: Sequence[Span], ahead: int, cancels: bool
) -> Iterator[tuple[Span, Chunk]]:
    """Chunks as they are finished, in any order.

    Args:
        executor: what flies.
        task: what is flown.
        spans: numbers of the flights, first and behind the last.
        ahead: chunks that are submitted before they are needed.
        cancels: True for an executor that goes on when the sweep does not.
    """
    waiting = iter(spans)
    pending: dict[Future[Chunk], Span] = {}
    try:
        while True:
            for span in islice(waiting, ahead - len(pending)):
                pending[executor.submit(fly_chunk, task, *span)] = span
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                yield pending.pop(future), future.result()
    finally:
        for future in pending if cancels else ():
            future.cancel()


def _joined(task: SweepTask, chunks: Sequence[Chunk]) -> Sweep:
    """All flights as one."""
    sampled = [chunk for chunk in chunks if len(chunk.times)]
    return Sweep(
        plan=task.plan,
        vehicle=task.vehicle,
        conditions=task.conditions,
        seed=task.seed,
        table={n: np.concatenate([chunk.columns[n] for chunk in chunks]) for n in chunks[0].columns},
        times=sampled[0].times,
        position_error=np.concatenate([chunk.position_error for chunk in sampled]),
        attitude_error=np.concatenate([chunk.attitude_error for chunk in sampled]),
    )
