"""score_flights(): many flights scored as they are flown, none of them kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Unpack

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.certification import PlannedPassage, PlannedWaypoint
from aerobat.declaration import validated
from aerobat.engines import logged_ticks
from aerobat.engines.components import components
from aerobat.engines.pytree import tree_map, tree_stack
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.evaluation.passages import NOTHING_ASKED, Asked, SampledPath, passages_asked
from aerobat.evaluation.score import Scores, ground_of, scores_of
from aerobat.kernels import running_metrics
from aerobat.kernels.gates.approach import Target
from aerobat.kernels.gates.progress import GatePlane
from aerobat.kernels.gates.section import BoundingEllipsoid
from aerobat.kernels.ops import Ops
from aerobat.kernels.running_metrics import Ground, MetricsInput, MetricsParameters, RunningMetrics
from aerobat.planning import Plan
from aerobat.problem import Problem, as_problem
from aerobat.simulation.config import FlightChanges, FlightConfig
from aerobat.simulation.loop import Signals
from aerobat.simulation.outcome import DIVERGENCE_RADIUS
from aerobat.simulation.passages import PASSAGE_DEPTH, PASSAGE_WINDOW, plane_directions
from aerobat.simulation.passages.stage_attitude import as_direction
from aerobat.simulation.prepare import prepare
from aerobat.simulation.reference_source import BLOCK
from aerobat.simulation.setup import FlightSetup, Part
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle


@dataclass(frozen=True)
class MetricsMonitor:
    """The loop's component that adds up a flight's metrics."""

    gates: tuple[int, ...]  # along how many directions each measures bodies
    waypoints: int
    attitudes: int  # of stages
    period: int = 1
    name: str = "metrics"
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: MetricsParameters, inputs: MetricsInput, signals: Signals
    ) -> RunningMetrics:
        """See `Component.init`."""
        return running_metrics.init(self.gates, self.waypoints, self.attitudes)

    def step(
        self,
        ops: Ops,
        parameters: MetricsParameters,
        metrics: RunningMetrics,
        inputs: MetricsInput,
        signals: Signals,
    ) -> RunningMetrics:
        """See `Component.step`."""
        motion, commands = signals["plant"], signals["controller"].commands
        reference = (signals["reference"].position, signals["reference"].q_world_body)
        actuation = (motion.thrusts, commands.thrusts, commands.saturated)
        return running_metrics.step(ops, parameters, metrics, motion.body, reference, actuation, inputs)


@dataclass(frozen=True, eq=False)
class MetricsSource:
    """The instants of ticks."""

    times: Array
    per_vehicle: bool = False

    def chunk(self, begin: int, end: int) -> MetricsInput:
        """See `Source.chunk`."""
        return MetricsInput(self.times[begin:end])


@validated
def score_flights(
    plan: Plan | Trajectory,
    vehicles: Vehicle | str | Sequence[Vehicle | str] | None = None,
    *,
    problem: Problem | str | None = None,
    environment: Environment | None = None,
    config: FlightConfig = FlightConfig(),  # noqa: B008 - frozen
    **changes: Unpack[FlightChanges],
) -> Scores:
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
) -> tuple[Scores, ErrorsOverTime]:
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
        environment = (goal.problem if isinstance(goal, Plan) else goal).environment
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
    planned = passages_asked(goal, path)
    rows, logged = _metrics_over_time(with_metrics(setup, planned), stride or ticks)
    scores = scores_of(tree_map(lambda leaf: leaf[:, -1], rows), planned)
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


def metrics_row(signals: Signals) -> RunningMetrics:
    """The metrics so far."""
    metrics: RunningMetrics = signals["metrics"]
    return metrics


def with_metrics(setup: FlightSetup, planned: Asked = NOTHING_ASKED) -> FlightSetup:
    """The same flight with its metrics added up, those of planned passages among them."""
    vehicles = len(setup.fleet)
    planes = tuple(_plane(passage, vehicles) for passage in planned.gates)
    targets = tuple(_target(waypoint, vehicles) for waypoint in (*planned.waypoints, *planned.places))
    directions = tuple(as_direction(attitude, vehicles) for attitude in planned.attitudes)
    body = BoundingEllipsoid(*map(components, (setup.fleet.body_centres, setup.fleet.semi_axes)))
    diverged, off, *ground = (
        np.full(vehicles, x)
        for x in (DIVERGENCE_RADIUS**2, planned.path_radius**2, *ground_of(setup.environment))
    )
    parameters = MetricsParameters(diverged, off, Ground(*ground), body, planes, targets, directions)
    measured = tuple(len(plane.directions) for plane in planes)
    monitor = MetricsMonitor(measured, len(targets), len(directions))
    metrics = Part(monitor, parameters, MetricsSource(setup.times))
    return replace(setup, parts=(*setup.parts, metrics))


def _plane(passage: PlannedPassage, vehicles: int) -> GatePlane:
    """A planned passage as kernels read it, leaves (vehicles,)."""
    gate = passage.gate
    directions = plane_directions(gate)
    place = components(gate.position), components(gate.normal)
    radius = gate.opening.circumradius
    plane = GatePlane(*place, directions, radius, passage.time, PASSAGE_WINDOW, PASSAGE_DEPTH)
    spread: GatePlane = tree_map(lambda leaf: np.full(vehicles, leaf), plane)
    return spread


def _target(waypoint: PlannedWaypoint, vehicles: int) -> Target:
    """A planned waypoint as kernels read it, leaves (vehicles,)."""
    centre = components(np.broadcast_to(waypoint.ball.centre, (vehicles, 3)))
    return Target(centre, np.full(vehicles, waypoint.time), np.full(vehicles, PASSAGE_WINDOW))
