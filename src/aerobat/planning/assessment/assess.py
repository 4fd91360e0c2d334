"""Assessment of a path, from its polynomials, its certificate and the lower bound on its duration."""

from __future__ import annotations

from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.certificate import Certificate, Side
from aerobat.planning.assessment.assessment import Assessment, Point, PositionRange
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.planning.task import Task
from aerobat.planning.turns import extra_turns
from aerobat.trajectory import Trajectory


def assessment(task: Task, trajectory: Trajectory, certificate: Certificate) -> Assessment:
    """Return the assessment of a path by its task and its certificate."""
    lowest, highest = trajectory.component_range(0)
    return Assessment(
        duration=trajectory.duration,
        least_duration=least_duration(task.problem, task.vehicle),
        room=PositionRange(_point(lowest), _point(highest)),
        asked=_asked(task),
        max_speed=_largest(certificate, "speed") or 0.0,
        max_tilt=_largest(certificate, "tilt"),
        max_body_rate=_largest(certificate, "body rate"),
        ground=task.environment.ground,
        rate_limit=task.vehicle.max_body_rate,
        obstructed=bool(task.environment.obstacles),
        extra_turns=extra_turns(trajectory, task),
    )


def _asked(task: Task) -> PositionRange:
    """Return the bounding box of start, goal, gates and stages' positions along the world's axes."""
    problem = task.problem
    places = [end.position for end in problem.ends.values()] + [gate.position for gate in problem.gates]
    points = np.reshape(places, (-1, 3))
    lower, upper = points.min(axis=0, initial=inf), points.max(axis=0, initial=-inf)
    for stage in task.stages.stages:
        for condition in stage.where:
            axes = np.flatnonzero(condition.direction)
            if len(axes) == 1:
                for bound in (condition.lower, condition.upper):
                    if abs(bound) < inf:
                        place = bound / condition.direction[axes[0]]
                        lower[axes[0]] = min(lower[axes[0]], place)
                        upper[axes[0]] = max(upper[axes[0]], place)
    return PositionRange(_point(lower), _point(upper))


def _largest(certificate: Certificate, quantity: str) -> float | None:
    """Return the largest value of a quantity along the path; None where the certificate has none."""
    asked = (
        f.value for f in certificate.findings if (f.quantity, f.side, f.place) == (quantity, Side.MAX, None)
    )
    return max(asked, default=None)


def _point(vector: Array) -> Point:
    x, y, z = vector.tolist()
    return x, y, z
