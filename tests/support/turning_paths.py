"""Trajectories whose body turns about its thrust axis along the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from aerobat.trajectory import Trajectory

REST_TO_REST = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])  # from 0 to 1 with still ends


def turning(trajectory: Trajectory, angle: float, course: Polynomial = REST_TO_REST) -> Trajectory:
    """The trajectory with a yaw of angle [rad] times a polynomial in the fraction of the whole time."""
    begins, lengths = trajectory.knots[:-1] / trajectory.duration, trajectory.durations / trajectory.duration
    size = course.degree() + 1
    parts = (course(Polynomial([a, d])).coef for a, d in zip(begins, lengths, strict=True))
    return replace(trajectory, yaw=angle * np.array([np.pad(part, (0, size - len(part))) for part in parts]))
