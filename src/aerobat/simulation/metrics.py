"""Metrics of flights by one kernel: online, as the loop's last component, or afterwards over a log's rows."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from math import inf
from operator import add as plus
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.engines.floats import ArrayOps
from aerobat.engines.pytree import components, tree_leaves, tree_map
from aerobat.environment import Environment
from aerobat.kernels import running_metrics
from aerobat.kernels.gates import approach, pointing, progress
from aerobat.kernels.gates.section import BoundingEllipsoid
from aerobat.kernels.ops import Quaternion, Scalar, Vector
from aerobat.kernels.running_metrics import Ground, MetricsParameters, RunningMetrics, lowest_height
from aerobat.problem.planned_passage import PlannedPassage, PlannedWaypoint
from aerobat.simulation.components import rotor_commands
from aerobat.simulation.flight import Flight
from aerobat.simulation.loop import Component, LoopPart, Signals
from aerobat.simulation.outcome import DIVERGENCE_RADIUS, LANDING_DEPTH, LANDING_SPEED, TOUCHDOWN, Outcome
from aerobat.simulation.passages.log import log_rows, scan_log
from aerobat.simulation.passages.passage import bounding_ellipsoid, gate_places
from aerobat.simulation.passages.stages import PlannedAttitude, attitude_direction, waypoint_target
from aerobat.simulation.setup import FlightSetup
from aerobat.vehicle import Ellipsoid


class Criteria(NamedTuple):
    """Criteria by which a flight is judged; passages and places are in the order of the stages."""

    gates: tuple[PlannedPassage, ...] = ()
    waypoints: tuple[PlannedWaypoint, ...] = ()
    lap_begin: float = 0.0  # [s] when the first lap begins
    places: tuple[PlannedWaypoint, ...] = ()  # of other stages with a place, and the goal
    attitudes: tuple[PlannedAttitude, ...] = ()  # of other stages
    path_radius: float = inf  # [m] largest allowed distance from the path


@dataclass(frozen=True)
class MetricsMonitor(Component):
    """The loop's component that accumulates a flight's metrics."""

    def init(self, parameters: MetricsParameters, signals: Signals) -> RunningMetrics:
        """See `Component.init`."""
        return running_metrics.init(parameters)

    def step(
        self, parameters: MetricsParameters, metrics: RunningMetrics, signals: Signals
    ) -> RunningMetrics:
        """See `Component.step`."""
        ops, time = signals.ops, signals.inputs
        motion, commands = signals.plant, rotor_commands(signals)
        reference = (signals.reference.position, signals.reference.q_world_body)
        actuation = (motion.thrusts, commands.thrusts, commands.saturated)
        return running_metrics.step(ops, parameters, metrics, motion.body, reference, actuation, time)


def metrics_row(signals: Signals) -> RunningMetrics:
    """Return the metrics so far."""
    return signals.of(RunningMetrics)


class PoseRow(NamedTuple):
    """A row with the pose; for the other metrics, the last carry suffices."""

    ticks: Scalar  # as in RunningMetrics
    sum_square: Scalar
    sum_square_angle: Scalar
    position: Vector
    q_world_body: Quaternion
    all_metrics: Scalar  # their sum, without meaning: engines drop from a carry whatever no row depends on


def pose_row(signals: Signals) -> PoseRow:
    """Return the pose and the accumulated errors so far."""
    metrics, body = signals.of(RunningMetrics), signals.plant.body
    errors = metrics.ticks, metrics.sum_square, metrics.sum_square_angle
    return PoseRow(*errors, body.position, body.q_world_body, reduce(plus, tree_leaves(metrics)))


def with_metrics(setup: FlightSetup, criteria: Criteria = Criteria()) -> FlightSetup:  # noqa: B008 - frozen
    """Return the same flight with a monitor of its metrics, judged by criteria."""
    ellipsoid = BoundingEllipsoid(*map(components, (setup.fleet.body_centres, setup.fleet.semi_axes)))
    parameters = MetricsParameters(
        divergence_radius_sq=DIVERGENCE_RADIUS**2,
        path_radius_sq=criteria.path_radius**2,
        ground=_ground(setup.environment),
        ellipsoid=ellipsoid,
        gates=tuple(plane for plane, _ in gate_places(criteria.gates, ellipsoid)),
        waypoints=tuple(map(waypoint_target, (*criteria.waypoints, *criteria.places))),
        attitudes=tuple(map(attitude_direction, criteria.attitudes)),
    )
    metrics = LoopPart(MetricsMonitor(), parameters, lambda begin, end: setup.times[begin:end])
    return replace(setup, parts=(*setup.parts, metrics))


def metrics_of_log(flight: Flight, criteria: Criteria, body: Ellipsoid | None) -> RunningMetrics:
    """Return the metrics of one logged flight, linearly interpolated between rows, leaves (1,).

    Args:
        flight: with its rows; it ends where it diverged.
        criteria: by which the flight is judged.
        body: the ellipsoid that encloses the vehicle; without it the clearance is unknown.
    """
    times, states = flight.times, flight.states
    rows = log_rows(times, states.position, states.velocity, states.q_world_body)
    square, angle = flight.position_error**2, flight.attitude_error
    lowest = lowest_height(ArrayOps, _ground(flight.environment), components(states.velocity))
    targets = [waypoint_target(each) for each in (*criteria.waypoints, *criteria.places)]
    numbers = RunningMetrics(
        flying=float(flight.outcome is Outcome.COMPLETE),
        is_finite=float(flight.outcome is not Outcome.STATE_NOT_FINITE),
        stop=flight.series["ends"],
        ground_time=_first_time(times, states.position[:, 2] < lowest),
        off_path_time=_first_time(times, flight.position_error > criteria.path_radius),
        ticks=float(len(times)),
        max_square=square.max(),
        sum_square=square.sum(),
        max_angle=angle.max(),
        sum_square_angle=np.sum(angle**2),
        saturated=flight.saturated.sum(),
        last=tree_map(lambda leaf: leaf[-1], rows),
        gates=(),
        waypoints=(),
        attitudes=(),
    )
    metrics: RunningMetrics = tree_map(np.atleast_1d, numbers)
    return metrics._replace(
        gates=tuple(scan_log(progress, gate_places(criteria.gates, bounding_ellipsoid(body)), rows)),
        waypoints=tuple(scan_log(approach, targets, rows)),
        attitudes=tuple(scan_log(pointing, [attitude_direction(each) for each in criteria.attitudes], rows)),
    )


def _ground(environment: Environment) -> Ground:
    """Return the ground of an environment as kernels test it: heights of contact and landing speed."""
    height = -inf if environment.ground is None else environment.ground
    return Ground(height - TOUCHDOWN, height - LANDING_DEPTH, LANDING_SPEED**2)


def _first_time(times: Array, happens: NDArray[np.bool_]) -> float:
    """Return the first of the times at which something happens, infinite if it never does."""
    return float(times[int(np.argmax(happens))]) if happens.any() else inf
