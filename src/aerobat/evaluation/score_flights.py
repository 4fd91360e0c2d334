"""score_flights(): many flights scored as they are flown, none of them kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.engines import logged_ticks
from aerobat.engines.pytree import tree_map, tree_stack
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.evaluation.criteria import SampledPath, criteria_of
from aerobat.evaluation.score import Score, score_of
from aerobat.kernels.running_metrics import RunningMetrics
from aerobat.planning import Plan
from aerobat.problem import Problem, as_problem
from aerobat.simulation.config import FlightChanges, FlightConfig
from aerobat.simulation.metrics import metrics_row, with_metrics
from aerobat.simulation.prepare import prepare
from aerobat.simulation.reference_source import BLOCK
from aerobat.simulation.setup import FlightSetup
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


@validated
def score_flights(
    plan: Plan | Trajectory,
    vehicles: Vehicle | str | Sequence[Vehicle | str] | None = None,
    *,
    problem: Problem | str | None = None,
    environment: Environment | None = None,
    config: FlightConfig = FlightConfig(),  # noqa: B008 - frozen
    **changes: Unpack[FlightChanges],
) -> Score:
    """Fly as `fly` does with the same arguments, and score each flight as it is flown; nothing is logged.

    Args:
        plan: what is flown; a bare trajectory needs vehicles and a problem.
        vehicles: what flies it, or their names, by default the plan's.
        problem: what is judged by, or its name, by default the plan's.
        environment: where, by default the problem's.
        config: how.
        changes: fields of FlightConfig that replace those of `config`, as `seed=3`.

    Raises SpecError for arguments that do not fit together, BackendMissing for an engine that is not
    installed.
    """
    return score_over_time(plan, vehicles, problem, environment, config.changed(changes))[0]


@dataclass(frozen=True, eq=False)
class ErrorsOverTime:
    """Errors of flights, RMS over the intervals that end at some times, held after a divergence."""

    times: Array  # [s], (T,)
    position: Array  # [m], (flights, T)
    attitude: Array  # [rad], (flights, T)

    @classmethod
    def of(cls, times: Array, metrics: RunningMetrics) -> ErrorsOverTime:
        """The errors behind metrics as they stood at those times [s], leaves (flights, T)."""
        ticks = np.diff(metrics.ticks, axis=1, prepend=0.0)
        latest = np.maximum.accumulate(np.where(ticks > 0.0, np.arange(len(times)), 0), axis=1)

        def errors(sums: Array) -> Array:
            mean_square = np.diff(sums, axis=1, prepend=0.0) / np.maximum(ticks, 1.0)
            return np.asarray(np.sqrt(np.take_along_axis(np.maximum(mean_square, 0.0), latest, axis=1)))

        return cls(times, errors(metrics.sum_square), errors(metrics.sum_square_angle))


def score_over_time(
    plan: Plan | Trajectory,
    vehicles: Vehicle | str | Sequence[Vehicle | str] | None,
    problem: Problem | str | None,
    environment: Environment | None,
    config: FlightConfig,
    stride: int | None = None,
) -> tuple[Score, ErrorsOverTime]:
    """Score flights as `score_flights` does, and return their errors over time too.

    Args:
        plan: what is flown.
        vehicles: what flies it.
        problem: what is judged by.
        environment: where.
        config: how.
        stride: ticks from one of the times to the next; None for the last one alone.
    """
    goal = plan if problem is None else as_problem(problem)
    if isinstance(goal, Trajectory):
        raise SpecError("problem is missing: a trajectory says not what it is judged by")
    if config.log_rate is not None:
        raise SpecError("log_rate: a scored flight keeps no rows; leave it out")
    if environment is None:
        environment = (goal.problem if isinstance(goal, Plan) else goal).surroundings
    if config.plant is not None:
        raise SpecError("plant: other simulators fly one vehicle at a time; take fly and score")
    setup = prepare(plan, vehicles, environment=environment, config=config)
    ticks = len(setup.times)
    blocks = range(0, ticks, BLOCK)
    parts = [setup.reference.setpoint(k, min(k + BLOCK, ticks)) for k in blocks]
    path = SampledPath(
        setup.times,
        np.concatenate([part.flat.position for part in parts]),
        np.concatenate([part.q_world_body for part in parts]),
    )
    criteria = criteria_of(goal, path)
    rows, logged = _metrics_over_time(with_metrics(setup, criteria), stride or ticks)
    scores = score_of(tree_map(lambda leaf: leaf[:, -1], rows), criteria)
    return scores, ErrorsOverTime.of(setup.times[logged], rows)


def _metrics_over_time(setup: FlightSetup, stride: int) -> tuple[RunningMetrics, NDArray[np.intp]]:
    """Metrics as they stand at ticks, multiples of a stride and the last, leaves (vehicles, T), and those."""
    logged = logged_ticks(len(setup.times), stride)
    loop = setup.compile(log=metrics_row)
    carry = loop.init(setup.first_tick)
    parts = []
    for begin, end in setup.chunks(stride):
        chunk_stride = end if begin % stride else stride
        carry, rows = loop.scan(carry, setup.inputs(begin, end), chunk_stride)
        kept = np.isin(begin + logged_ticks(end - begin, chunk_stride), logged)
        parts.append(tree_map(partial(np.compress, kept, axis=1), rows))
    metrics: RunningMetrics = tree_stack(parts, lambda leaves: np.concatenate(leaves, axis=-1))
    return metrics, logged
