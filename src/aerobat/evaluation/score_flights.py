"""score_flights(): many flights scored during the simulation, without logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.engines import logged_ticks
from aerobat.engines.pytree import from_components, tree_map
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.evaluation.criteria import SampledPath, criteria_of
from aerobat.evaluation.score import Score, score_of
from aerobat.kernels.running_metrics import RunningMetrics
from aerobat.planning import Plan
from aerobat.problem import Problem, as_problem
from aerobat.simulation.config import FlightChanges, FlightConfig
from aerobat.simulation.fly import prepare
from aerobat.simulation.metrics import PoseRow, metrics_row, pose_row, with_metrics
from aerobat.simulation.passages import FlownBodies, NearestObstacle, nearest_obstacles
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
    """Fly as `fly` does with the same arguments, and score each flight during the simulation, without a log.

    Args:
        plan: the plan to fly; a bare trajectory needs vehicles and a problem.
        vehicles: vehicles or their names, by default the plan's.
        problem: the problem that gives the criteria, or its name, by default the plan's.
        environment: the environment, by default the problem's.
        config: settings of the flights.
        changes: fields of FlightConfig that replace those of `config`, for instance `seed=3`.

    SpecError is raised for inconsistent arguments, BackendMissing for an engine that is not installed.
    """
    config = config.changed(changes)
    return score_over_time(plan, vehicles, config, problem=problem, environment=environment)[0]


@dataclass(frozen=True, eq=False)
class ErrorsOverTime:
    """RMS errors of flights over the intervals that end at some times, held after a divergence."""

    times: Array  # [s], (T,)
    position: Array  # [m], (flights, T)
    attitude: Array  # [rad], (flights, T)

    @classmethod
    def of(cls, times: Array, sums: RunningMetrics | PoseRow) -> ErrorsOverTime:
        """Compute the errors from their running sums at these times [s], leaves (flights, T)."""
        ticks = np.diff(sums.ticks, axis=1, prepend=0.0)
        latest = np.maximum.accumulate(np.where(ticks > 0.0, np.arange(len(times)), 0), axis=1)

        def errors(total: Array) -> Array:
            mean_square = np.diff(total, axis=1, prepend=0.0) / np.maximum(ticks, 1.0)
            return np.asarray(np.sqrt(np.take_along_axis(np.maximum(mean_square, 0.0), latest, axis=1)))

        return cls(times, errors(sums.sum_square), errors(sums.sum_square_angle))


def score_over_time(
    plan: Plan | Trajectory,
    vehicles: Vehicle | str | Sequence[Vehicle | str] | None,
    config: FlightConfig,
    stride: int | None = None,
    *,
    problem: Problem | str | None = None,
    environment: Environment | None = None,
) -> tuple[Score, ErrorsOverTime]:
    """Score flights as `score_flights` does, and also return their errors over time.

    Args:
        plan: the plan to fly.
        vehicles: the vehicles.
        config: settings of the flights.
        stride: ticks between the returned times; None for the last time only.
        problem: the problem that gives the criteria.
        environment: the environment.
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
    setpoint = setup.reference.setpoint(np.arange(ticks))
    path = SampledPath(setup.times, setpoint.flat.position, setpoint.q_world_body)
    criteria = criteria_of(goal, path)
    flown = with_metrics(setup, criteria)
    if len(environment.pieces):
        metrics, sums, nearest = _past_obstacles(flown)
    else:
        sums, _ = flown.scan(metrics_row, stride or ticks)
        metrics, nearest = tree_map(lambda leaf: leaf[:, -1], sums), None
    logged = logged_ticks(ticks, stride or ticks)
    if nearest is not None:
        sums = tree_map(lambda leaf: leaf[:, logged], sums)
    return score_of(metrics, criteria, nearest), ErrorsOverTime.of(setup.times[logged], sums)


def _past_obstacles(setup: FlightSetup) -> tuple[RunningMetrics, PoseRow, NearestObstacle]:
    """Return the last metrics of flights, leaves (vehicles,), all rows, and the nearest obstacles.

    Rows take 88 bytes for each tick and vehicle.
    """
    rows, states = setup.scan(pose_row, 1)
    metrics = next(state for state in states if isinstance(state, RunningMetrics))
    position, q_world_body = map(from_components, (rows.position, rows.q_world_body))
    bodies = setup.fleet.body_centres, setup.fleet.semi_axes
    flown = FlownBodies(setup.times, position, q_world_body, *bodies, metrics.ticks)
    return metrics, rows, nearest_obstacles(setup.environment.pieces, flown)
