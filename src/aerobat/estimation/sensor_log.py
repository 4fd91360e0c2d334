"""Logs of an IMU and of motion capture for one vehicle, validated once."""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.declaration import by_value, short, validated
from aerobat.errors import SpecError

MAX_GAP = 0.05  # [s] between IMU samples; longer means do not resolve a turning vehicle
MAX_AGE = 0.2  # [s] of a pose on arrival; the filter relates the errors then and now to first order
_NORM_TOLERANCE = 1e-2  # [-] error of a quaternion's norm: the rounding of a few decimals


@validated
@short
@by_value
class SensorLog:
    """Record of an IMU and of poses, on one clock; SI units, ENU world, FLU body.

    An IMU sample is the mean since the previous sample; the first one covers as long an interval as the
    second. Poses have exposure times and arrival times. SpecError, which names the array, is raised for
    shapes that differ, NaN, times that do not rise, and gaps.
    """

    imu_times: Array  # [s] ends of the samples' intervals, (T,)
    omega: Array  # [rad/s] body, (T, 3)
    specific_force: Array  # [m/s²] body, (T, 3)
    pose_times: Array  # [s] exposure times, (P,)
    position: Array  # [m] world, (P, 3)
    q_world_body: Array  # (P, 4)
    arrival_times: Array | None = None  # [s], (P,), by default the exposure times

    def __post_init__(self) -> None:
        imu = self._series("imu_times", ("omega", 3), ("specific_force", 3))
        poses = self._series("pose_times", ("position", 3), ("q_world_body", 4))
        if imu < 2 or poses < 1:
            raise SpecError(f"a log needs two samples of the IMU and a pose, got {imu} and {poses}")
        steps = np.diff(self.imu_times)
        if steps.max() > MAX_GAP:
            where = self.imu_times[steps.argmax()]
            raise SpecError(
                f"imu_times has a gap of {steps.max():.3g} s at {where:.6g} s; above {MAX_GAP} s cut the log"
            )
        self._check_attitudes()
        self._check_arrivals()

    def _series(self, clock: str, *columns: tuple[str, int]) -> int:
        """Check and write-protect arrays with a common clock; return their number of rows."""
        times = frozen(getattr(self, clock), clock, (None,))
        if times.ndim != 1 or not (np.diff(times) > 0.0).all():
            raise SpecError(f"{clock} must be one series of rising times; sort it and drop repetitions")
        object.__setattr__(self, clock, times)
        for name, width in columns:
            values = frozen(getattr(self, name), name)
            if values.shape != (len(times), width):
                raise SpecError(
                    f"{name} must have the shape ({len(times)}, {width}), a row for each of {clock}, "
                    f"got {values.shape}"
                )
            object.__setattr__(self, name, values)
        return len(times)

    def _check_attitudes(self) -> None:
        norms = np.linalg.norm(self.q_world_body, axis=-1)
        wrong = np.flatnonzero(np.abs(norms - 1.0) > _NORM_TOLERANCE)
        if wrong.size:
            raise SpecError(
                f"q_world_body must be unit quaternions (w, x, y, z); that of pose {wrong[0]} is of the norm "
                f"{norms[wrong[0]]:.3g}"
            )
        object.__setattr__(self, "q_world_body", frozen(so3.normalize(self.q_world_body), "q_world_body"))

    def _check_arrivals(self) -> None:
        arrivals = frozen(self.arrivals, "arrival_times")
        if arrivals.shape != self.pose_times.shape:
            raise SpecError(
                f"arrival_times must have the shape {self.pose_times.shape}, got {arrivals.shape}"
            )
        ages = arrivals - self.pose_times
        wrong = np.flatnonzero((ages < 0.0) | (ages > MAX_AGE))
        if wrong.size:
            raise SpecError(
                f"arrival_times must be 0 to {MAX_AGE} s after pose_times, got {ages[wrong[0]]:.3g} s "
                f"for pose {wrong[0]}; set both to one clock"
            )
        object.__setattr__(self, "arrival_times", arrivals)

    @property
    def arrivals(self) -> Array:
        """The arrival times of poses [s], (P,)."""
        return self.pose_times if self.arrival_times is None else self.arrival_times

    def __str__(self) -> str:
        """Return a one-line summary."""
        duration = self.imu_times[-1] - self.imu_times[0]
        return f"{duration:.3f} s of {len(self.imu_times)} samples and {len(self.pose_times)} poses"
