"""The rows of a filter's loop that a log asks for: one for each sample's end, exposure and arrival."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array, Indices
from aerobat.engines.components import components
from aerobat.errors import SpecError
from aerobat.estimation.filter_loop import NO_SLOT, FilterInput
from aerobat.estimation.sensor_log import SensorLog
from aerobat.kernels.ekf import ImuSample, Pose

_SAMPLE, _EXPOSURE, _ARRIVAL = range(3)  # in this order where they are at the same time


@dataclass(frozen=True)
class Schedule:
    """Rows of a filter that begins at a log's first pose within its samples, and what they belong to."""

    first_pose: int
    inputs: FilterInput  # leaves (rows,)
    slots: int  # poses on their way at once, at most, 1 or more
    sample_rows: Indices  # the last row at the end of each sample that ends after the first pose
    sample_times: Array  # [s] of those ends
    arrival_rows: Indices  # of each pose, -1 for those that are not fused


def schedule(log: SensorLog) -> Schedule:
    """The rows of a log. Raises SpecError where it has no pose within its samples."""
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
    """The first pose in the interval of a sample."""
    begin = 2.0 * log.imu_times[0] - log.imu_times[1]
    within = np.flatnonzero((log.pose_times >= begin) & (log.pose_times < log.imu_times[-1]))
    if not within.size:
        raise SpecError(
            f"pose_times has none from {begin:.6g} to {log.imu_times[-1]:.6g} s, where the IMU's samples "
            "are; set both to one clock"
        )
    return int(within[0])


def _slots(log: SensorLog, poses: Indices) -> Indices:
    """A slot for each pose, free again once its measurement has arrived, 0 for those that are not fused."""
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
