"""Replay of a recorded log through the filter: estimates, their uncertainty, and accepted poses."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.declaration import Positive, VectorLike, by_value, short, validated
from aerobat.engines import choose
from aerobat.engines.engine import Init, Step, first_row
from aerobat.engines.pytree import components, from_components, tree_map
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.estimation.sensor_log import SensorLog
from aerobat.estimation.settings import Ekf, ekf_parameters
from aerobat.kernels import ekf
from aerobat.kernels.ekf import EkfParameters, EkfState, ImuSample, Pose
from aerobat.kernels.ekf.covariance import SIZE
from aerobat.kernels.ops import Ops, Scalar, Vector, select_tree
from aerobat.states import TimeInterval

NO_SLOT = -1.0
_SAMPLE, _EXPOSURE, _ARRIVAL = range(3)  # in this order where they have the same time
_ROWS = 10_000  # rows that the loop runs at once: their covariances take 10 MB
# indices of the diagonal in the upper triangle, stored row by row
_DIAGONAL = [row * SIZE - row * (row - 1) // 2 for row in range(SIZE)]


class FilterParameters(NamedTuple):
    """Parameters of one filter."""

    ekf: EkfParameters
    first_pose: Pose
    first_velocity: Vector  # [m/s] world


class FilterInput(NamedTuple):
    """Inputs of one row of the loop, which ends at its instant."""

    elapsed: Scalar  # [s] since the previous row
    sample: ImuSample  # the IMU sample of that interval
    exposed: Scalar  # slot of the pose exposed now, NO_SLOT for none
    arrived: Scalar  # slot of the pose that arrives now, NO_SLOT for none
    measured: Pose  # the pose that arrives


class Exposure(NamedTuple):
    """A pose whose measurement has not yet arrived."""

    past: Pose  # the filter's own pose at that time, as known now
    age: Scalar  # [s]


@lru_cache(maxsize=8)
def filter_loop(slots: int) -> tuple[Init, Step]:
    """Return the loop for at most `slots` poses in transit; its rows are the filter's states."""

    def init(
        ops: Ops, parameters: FilterParameters, inputs: FilterInput
    ) -> tuple[EkfState, tuple[Exposure, ...]]:
        state = ekf.init(parameters.ekf, parameters.first_pose, parameters.first_velocity)
        return state, (Exposure(parameters.first_pose, 0.0),) * slots

    def step(
        ops: Ops,
        parameters: FilterParameters,
        carry: tuple[EkfState, tuple[Exposure, ...]],
        inputs: FilterInput,
    ) -> tuple[tuple[EkfState, tuple[Exposure, ...]], EkfState]:
        state = ekf.propagate(ops, parameters.ekf, carry[0], inputs.sample, inputs.elapsed)
        predicted = ekf.predict_covariance(ops, parameters.ekf, state)
        exposures = [e._replace(age=e.age + inputs.elapsed) for e in carry[1]]
        past, age = _selected_exposure(ops, exposures, inputs.arrived)
        state = ekf.fuse(ops, parameters.ekf, predicted, inputs.measured, past, age, inputs.arrived > NO_SLOT)
        fresh = Exposure(ekf.pose_of(state), 0.0)
        updated = []
        for slot, exposure in enumerate(exposures):
            back = ekf.carried_back(predicted, state, exposure.past, exposure.age)
            updated.append(
                select_tree(ops, _is_slot(inputs.exposed, slot), fresh, exposure._replace(past=back))
            )
        return (state, tuple(updated)), state

    return init, step


def _selected_exposure(ops: Ops, exposures: list[Exposure], wanted: Scalar) -> Exposure:
    selected = exposures[0]
    for slot, exposure in enumerate(exposures[1:], start=1):
        selected = select_tree(ops, _is_slot(wanted, slot), exposure, selected)
    return selected


def _is_slot(wanted: Scalar, slot: int) -> Scalar:
    """Return True where `slot` is the wanted one."""
    return (wanted > slot - 0.5) & (wanted < slot + 0.5)


@dataclass(frozen=True)
class Schedule:
    """The rows of a filter that begins at a log's first pose within the IMU samples."""

    first_pose: int
    inputs: FilterInput  # leaves (rows,)
    slots: int  # largest number of poses in transit at once, at least 1
    sample_rows: Indices  # the last row of each sample that ends after the first pose
    sample_times: Array  # [s] ends of these samples
    arrival_rows: Indices  # of each pose, -1 for poses that are not fused


def schedule(log: SensorLog) -> Schedule:
    """Return the schedule of a log. Raise SpecError where no pose lies within the IMU samples."""
    first = _first_pose(log)
    begin, end = log.pose_times[first], log.imu_times[-1]
    poses = np.arange(first + 1, len(log.pose_times))
    poses = poses[log.arrivals[poses] <= end]
    samples = np.flatnonzero(log.imu_times > begin)
    slots = _slots(log, poses)
    # kind, time, and index of the sample or pose
    kinds = np.repeat([_SAMPLE, _EXPOSURE, _ARRIVAL], [len(samples), len(poses), len(poses)])
    times = np.concatenate([log.imu_times[samples], log.pose_times[poses], log.arrivals[poses]])
    which = np.concatenate([samples, poses, poses])
    order = np.lexsort((kinds, times))
    kinds, times, which = kinds[order], times[order], which[order]
    slot = slots[np.where(kinds == _SAMPLE, 0, which)]
    measured = np.where(kinds == _ARRIVAL, which, first)
    during = np.minimum(np.searchsorted(log.imu_times, times), len(log.imu_times) - 1)
    arrival_rows = np.full(len(log.pose_times), -1)
    arrival_rows[which[kinds == _ARRIVAL]] = np.flatnonzero(kinds == _ARRIVAL)
    return Schedule(
        first_pose=first,
        inputs=FilterInput(
            elapsed=np.diff(times, prepend=begin),
            sample=ImuSample(components(log.omega[during]), components(log.specific_force[during])),
            exposed=np.where(kinds == _EXPOSURE, slot, NO_SLOT),
            arrived=np.where(kinds == _ARRIVAL, slot, NO_SLOT),
            measured=Pose(components(log.position[measured]), components(log.q_world_body[measured])),
        ),
        slots=int(slots.max()) + 1,
        sample_rows=np.searchsorted(times, log.imu_times[samples], side="right") - 1,
        sample_times=log.imu_times[samples],
        arrival_rows=arrival_rows,
    )


def _first_pose(log: SensorLog) -> int:
    """Return the index of the first pose within the IMU samples."""
    begin = 2.0 * log.imu_times[0] - log.imu_times[1]
    within = np.flatnonzero((log.pose_times >= begin) & (log.pose_times < log.imu_times[-1]))
    if not within.size:
        raise SpecError(
            f"pose_times has none from {begin:.6g} to {log.imu_times[-1]:.6g} s, where the IMU's samples "
            "are; set both to one clock"
        )
    return int(within[0])


def _slots(log: SensorLog, poses: Indices) -> Indices:
    """Return a slot for each pose, reused once a measurement has arrived; 0 for poses not fused."""
    slots = np.zeros(len(log.pose_times), dtype=np.intp)
    taken_until: list[float] = []
    for pose, exposure, arrival in zip(
        poses.tolist(), log.pose_times[poses].tolist(), log.arrivals[poses].tolist(), strict=True
    ):
        free = [slot for slot, until in enumerate(taken_until) if until < exposure]
        slot = free[0] if free else len(taken_until)
        taken_until[slot : slot + 1] = [arrival]
        slots[pose] = slot
    return slots


@short
@by_value
class Estimates:
    """Estimates from a log: the state at the end of each sample, and the acceptance of each pose."""

    times: Array  # [s], (T,), from the first sample that ends after the first pose
    position: Array  # [m] world, (T, 3)
    velocity: Array  # [m/s] world, (T, 3)
    q_world_body: Array  # (T, 4)
    omega_body: Array  # [rad/s] mean over the sample, without its bias, (T, 3)
    gyro_bias: Array  # [rad/s], (T, 3)
    accelerometer_bias: Array  # [m/s²], (T, 3)
    sigma: Array  # 1σ of errors of position, velocity, attitude (body axes) and both biases, (T, 15)
    nis: Array  # normalized innovation squared of each pose, NaN for poses that were not fused, (P,)
    accepted: Mask  # accepted poses; the filter begins at the first one, (P,)
    jumps: Array  # [s] arrival times of poses accepted as jumps, (J,)
    # from the exposure of an accepted pose to the arrival of the next one, or to the end
    coasting: tuple[TimeInterval, ...]

    def __str__(self) -> str:
        """Return a one-line summary."""
        fused = np.isfinite(self.nis)
        parts = [f"{self.times[-1] - self.times[0]:.3f} s with {fused.sum()} poses"]
        if (fused & ~self.accepted).any():
            parts.append(f"{(fused & ~self.accepted).sum()} rejected")
        if self.jumps.size:
            parts.append("jumps at " + ", ".join(f"{time:.3f} s" for time in self.jumps))
        parts += [f"without poses from {gap.start:.3f} to {gap.end:.3f} s" for gap in self.coasting]
        return ", ".join(parts)


@validated
def estimate(
    log: SensorLog,
    ekf: Ekf = Ekf(),  # noqa: B008 - frozen
    environment: Environment | None = None,
    start_velocity: VectorLike = (0.0, 0.0, 0.0),
    max_gap: Positive = 0.1,
) -> Estimates:
    """Replay a log through the error-state Kalman filter, as it would have run on board.

    Each pose is fused when it arrives, at the time of its exposure; poses that arrive after the last sample
    are ignored. Between poses and in outages the filter propagates the state with the IMU alone. SpecError is
    raised where the log has no pose within the IMU samples.

    Args:
        log: The recorded log.
        ekf: The settings of the filter.
        environment: The environment with its gravity, by default that of a calm day on Earth.
        start_velocity: Velocity at the first pose [m/s], world, (3,).
        max_gap: Time without poses [s] from which on the filter is reported as coasting.
    """
    plan = schedule(log)
    gravity = (environment or Environment()).gravity
    rows = _run(log, ekf, gravity, np.asarray(start_velocity), plan)
    at_samples = {name: values[plan.sample_rows] for name, values in rows.items()}
    arrived = plan.arrival_rows >= 0
    nis, accepted = np.full(len(arrived), np.nan), np.zeros(len(arrived), dtype=bool)
    nis[arrived] = rows["nis"][plan.arrival_rows[arrived]]
    accepted[arrived] = rows["accepted"][plan.arrival_rows[arrived]] == 1.0
    accepted[plan.first_pose] = True
    during = np.searchsorted(log.imu_times, plan.sample_times)
    return Estimates(
        times=plan.sample_times,
        omega_body=log.omega[during] - at_samples["gyro_bias"],
        nis=nis,
        accepted=accepted,
        jumps=np.cumsum(plan.inputs.elapsed)[np.diff(rows["jumps"], prepend=0.0) > 0.0]
        + log.pose_times[plan.first_pose],
        coasting=tuple(_coasting(log, accepted, max_gap)),
        **{name: at_samples[name] for name in (*_NOMINAL, "sigma")},
    )


_NOMINAL = ("position", "velocity", "q_world_body", "gyro_bias", "accelerometer_bias")


def _run(log: SensorLog, ekf: Ekf, gravity: float, velocity: Array, plan: Schedule) -> dict[str, Array]:
    """Return the stored part of the state after every row."""
    init, step = filter_loop(plan.slots)
    first = Pose(
        components(log.position[plan.first_pose, None]), components(log.q_world_body[plan.first_pose, None])
    )
    parameters = FilterParameters(ekf_parameters(ekf, gravity, 1), first, components(velocity[None]))
    count = len(plan.inputs.elapsed)
    loop = choose("auto", 1, count).compile(init, step, parameters, first_row(plan.inputs))
    carry, parts = loop.init(first_row(plan.inputs)), []
    for begin, end in pairwise([*range(0, count, _ROWS), count]):
        cut = operator.itemgetter(slice(begin, end))
        carry, states = loop.scan(carry, tree_map(cut, plan.inputs))
        parts.append(_stored(states))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _stored(states: EkfState) -> dict[str, Array]:
    """Return states with leaves (1, rows) as arrays (rows, ...)."""
    stored = {name: from_components(getattr(states.nominal, name))[0] for name in _NOMINAL}
    stored["sigma"] = np.sqrt(from_components([states.covariance[i] for i in _DIAGONAL])[0])
    return stored | {name: getattr(states, name)[0] for name in ("jumps", "nis", "accepted")}


def _coasting(log: SensorLog, accepted: Mask, max_gap: float) -> Iterator[TimeInterval]:
    """Yield the intervals from an accepted pose to the next one's arrival, if that takes over `max_gap`."""
    taken = np.flatnonzero(accepted)
    taken = taken[np.argsort(log.arrivals[taken])]
    arrivals = log.arrivals[taken]
    ends = np.append(arrivals[1:], log.imu_times[-1])
    for gap in np.flatnonzero(ends - arrivals > max_gap).tolist():
        yield TimeInterval(float(log.pose_times[taken[gap]]), float(ends[gap]))
