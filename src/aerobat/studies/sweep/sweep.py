"""sweep(): many flights of one plan under random conditions, on all cores, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict
from itertools import chain
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from aerobat.control import ControlLaw, Controller, named_controller
from aerobat.declaration import PathName, Seed, to_table, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.flatness import vehicle_of
from aerobat.planning import Plan
from aerobat.simulation import Outcome
from aerobat.studies.flights import CHUNK, CHUNKS_PER_GROUP, FlightTask, cut
from aerobat.studies.kept import KeptParts, fingerprint
from aerobat.studies.sweep.flights import SAMPLED, STRIDE, Chunk, fly_chunk
from aerobat.studies.sweep.result import Sweep
from aerobat.studies.workers import Workers, pool
from aerobat.trajectory.files import arrays_of
from aerobat.vehicle import Vehicle

Runs = Annotated[int, Field(ge=1, le=10**7, description="whole number from 1 to ten million")]
Batch = Annotated[int, Field(ge=1, le=CHUNK, description=f"whole number from 1 to {CHUNK}")]

_SUCCESSES = tuple(outcome.name.lower() for outcome in Outcome if outcome.is_success)


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
    progress: Callable[[int, int], None] | None = None,
) -> Sweep:
    """Fly a plan many times, each flight with its own draw of the conditions.

    Flight k draws from `SeedSequence(seed, spawn_key=(k,))`: batches, workers and interruptions change no
    bit, and a sweep of more flights begins with those of a shorter one. Flights are scored while they are
    flown; errors over time are kept for the first flights.

    Args:
        plan: the plan to fly.
        conditions: the distributions, or the name of a preset or a file.
        runs: the number of flights.
        seed: of their draws.
        vehicle: the nominal vehicle or its name, by default the plan's.
        controller: settings, a control law or the name of either; by default the vehicle's own.
        engine: as for FlightConfig.
        batch: flights that are flown side by side in one process: fewer take less memory.
        workers: processes, by default one a core; 1 flies in this process; dask://HOST:PORT on a cluster.
        executor: any of `concurrent.futures` that flies instead, as a `dask.distributed` client's.
        keep: a folder for finished flights, from which an interrupted sweep is resumed; it stays.
        progress: called, as flights finish, with the number of finished flights and of successful ones.

    Raises SpecError for invalid arguments, and for a folder that keeps another sweep's flights.
    """
    conditions = as_dispersion(conditions)
    vehicle = vehicle_of(plan, vehicle)
    if isinstance(controller, str):
        controller = named_controller(controller, vehicle.controller)
    task = FlightTask(plan, vehicle, conditions, seed, controller or vehicle.controller, engine, batch)
    kept = KeptParts.of(keep, "flights", "sweep", lambda: _inputs_summary(task))
    spans = cut(range(runs))
    known = kept.known(spans, Chunk.of)
    missing = [flights for flights in spans if flights not in known]
    chunks: dict[range, Chunk] = {}
    done = well = 0
    with pool(workers, executor, len(missing)) as flying:
        flown = flying.results(fly_chunk, task, missing, together=CHUNKS_PER_GROUP, compiles=True)
        for flights, chunk in chain(known.items(), kept.keeping(flown)):
            chunks[flights] = chunk
            done += len(flights)
            well += int(np.isin(chunk.table["outcome"], _SUCCESSES).sum())
            if progress is not None:
                progress(done, well)
    whole = Chunk.joined([chunks[flights] for flights in spans])
    return Sweep(plan, vehicle, conditions, seed, **vars(whole))


def _inputs_summary(task: FlightTask) -> dict[str, Any]:
    """Return a summary of everything that the numbers of flights depend on, without the batch size."""
    plan = {
        "problem": to_table(task.plan.problem),
        "stages": [asdict(stage) for stage in task.plan.stages],
        **{name: array.tolist() for name, array in arrays_of(task.plan.trajectory).items()},
    }
    return {
        "plan": fingerprint(plan),
        "vehicle": fingerprint(to_table(task.vehicle)),
        "conditions": fingerprint(to_table(task.conditions)),
        "seed": task.seed,
        "controller": fingerprint(to_table(task.controller)),
        "engine": task.engine,
        "chunks": [CHUNK, SAMPLED, STRIDE],
    }
