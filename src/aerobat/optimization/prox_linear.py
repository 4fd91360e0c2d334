"""A linear cost under smooth constraints, by the prox-linear method.

    minimize    costᵀ x   subject to   c(x) ≤ 0,   e(x) = 0,   lower ≤ B x ≤ upper

Each step minimizes costᵀ d + M s + (μ/2) Σ (d / scale)² over d and s ≥ 0 with the constraints linearized,
c + C d ≤ s and e + E d = 0: a convex QP that always has a solution where the equalities do, since s gives
way. A step is taken where costᵀ x + M max(c(x), 0) falls by a part of what the QP promised, and μ is raised
otherwise (Lewis and Wright, "A proximal method for composite minimization", 2016). Equalities are met
again after each step, by the program itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization.deadline import out_of_time

_PENALTY = 2.0  # M: of the cost for each unit of violation
_MAX_PENALTY = 200.0  # for violations that the first penalty leaves,
_PENALTY_GROWTH = 10.0  # which it grows to by this factor
_FIRST_PROXIMITY = 1e-3  # μ, in units of the cost
_FIRST_PROXIMITY_AT_NO_COST = 0.1  # where only a point without violation is sought, which is near
_MAX_PROXIMITY = 1e3  # steps are too short to lead anywhere beyond
_MIN_PROXIMITY = 1e-6
_ACCEPTED = 0.1  # the least fraction of the promised fall that a step is taken for
_TRUSTED = 0.7  # the fraction beyond which the linearization is good further on
_LITTLE_GAIN = 3e-4  # of the cost, by a step that was promised little more: the end
_LITTLE_PROMISED = 1e-3
_STALLED_STEPS = 5  # in which a search for a point without violation, where nothing else is sought, has to
_STALLED = 0.7  # lower the violation to this fraction: what is slower seldom arrives
_HOPELESS = 0.5  # of the violation: where even the linearization leaves more, a search seldom arrives either
_SLACK_WEIGHT = 1e-3  # of s², which makes the QP strictly convex
_FREE_WEIGHT = 1e-6  # of d², likewise, where μ is tiny
_SOLVED = 1  # DAQP's exit flag
_EQUALITY = 5  # DAQP's mark on a row
_INFINITE = 1e30  # an infinite bound, as DAQP writes it
_PRIMAL_TOLERANCE = 1e-10  # on rows of unit norm


@dataclass(frozen=True, eq=False)
class Linearization:
    """The constraints near a point x, as rows over the step d."""

    values: Array  # c (q,) of those that are near their bounds
    rows: Array  # C (q, n)
    residual: Array  # e (p,)
    equality: Array  # E (p, n)


class Point(Protocol):
    """A program's constraints at a point that meets the equalities."""

    @property
    def x(self) -> Array:
        """The point, (n,)."""

    @property
    def violation(self) -> float:
        """The largest of c(x); negative where all hold with room to spare."""

    def linearization(self) -> Linearization:
        """The constraints near it."""


P = TypeVar("P", bound=Point)


class SmoothProgram(Protocol[P]):  # type: ignore[misc]
    """What is minimized, and under which constraints."""

    @property
    def cost(self) -> Array:
        """Of each variable, (n,)."""

    @property
    def scale(self) -> Array:
        """How far each variable moves for a change that counts, (n,)."""

    @property
    def reach(self) -> Array:
        """The farthest that one step may take each variable, (n,); zero holds it."""

    @property
    def bounded(self) -> tuple[Array, Array, Array]:
        """B (b, n), lower (b,) and upper (b,): linear constraints, which each step keeps."""

    def at(self, x: Array) -> P | None:
        """The constraints at the point next to x that meets the equalities; None where it has none."""


@dataclass(frozen=True, eq=False)
class ProxLinearResult(Generic[P]):
    """Where the method ended."""

    point: P
    converged: bool  # no step gains more than little
    steps: int  # QPs solved
    feasible: P | None = None  # the last one on the way without violation


def prox_linear(
    program: SmoothProgram[P],
    start: P,
    max_steps: int = 40,
    tolerance: float = 0.0,
    gives_up: bool = False,
) -> ProxLinearResult[P]:
    """Descend from a point; it ends at a local optimum, out of steps or time, or where no step leads on.

    Args:
        program: What is minimized; where its cost is zero, the first point without violation will do, and
            the method ends too where violations fall too slowly for that.
        start: Where to begin, feasible or not.
        max_steps: QPs, at most.
        tolerance: A violation that is not worth a greater penalty.
        gives_up: Whether it ends where no time is left, and where even the linearization leaves much of the
            violation, as a descent may and what mends a path may not.
    """
    point = start
    feasible = start if start.violation <= 0.0 else None
    linearization: Linearization | None = None
    proximity = _FIRST_PROXIMITY if program.cost.any() else _FIRST_PROXIMITY_AT_NO_COST
    penalty = _PENALTY
    violations = []  # after each step
    for steps in range(1, max_steps + 1):
        if gives_up and out_of_time():
            break
        violations.append(point.violation)
        if not program.cost.any() and (point.violation <= 0.0 or _is_stalled(violations)):
            return ProxLinearResult(point, point.violation <= 0.0, steps - 1, feasible)
        merit = _merit(program, point, penalty)
        linearization = linearization or point.linearization()
        step = _step(program, point.x, linearization, proximity, penalty)
        hopeless = step is not None and step[1] > _HOPELESS * point.violation
        if gives_up and hopeless and not program.cost.any():
            return ProxLinearResult(point, False, steps, feasible)
        trial = None if step is None else program.at(point.x + step[0])
        if step is None or trial is None:
            proximity *= 5.0
            if proximity > _MAX_PROXIMITY:
                return ProxLinearResult(point, False, steps, feasible)
            continue
        promised = merit - float(program.cost @ (point.x + step[0])) - penalty * step[1]
        gained = merit - _merit(program, trial, penalty)
        if gained > _ACCEPTED * promised and gained > 0.0:
            point = trial
            feasible = point if point.violation <= 0.0 else feasible
            linearization = None
            proximity = max(proximity / (4.0 if gained > _TRUSTED * promised else 1.5), _MIN_PROXIMITY)
        else:
            proximity *= 5.0
        flat = promised < _LITTLE_PROMISED
        if (flat and gained < _LITTLE_GAIN) or proximity > _MAX_PROXIMITY:
            if point.violation <= tolerance or penalty >= _MAX_PENALTY:
                return ProxLinearResult(point, flat, steps, feasible)
            penalty *= _PENALTY_GROWTH
            proximity = max(proximity, _FIRST_PROXIMITY) if flat else _FIRST_PROXIMITY
    return ProxLinearResult(point, False, max_steps, feasible)


def _is_stalled(violations: list[float]) -> bool:
    """True where the violation, which never rises, has hardly fallen in the latest steps."""
    return len(violations) > _STALLED_STEPS and violations[-1] > _STALLED * violations[-1 - _STALLED_STEPS]


def _merit(program: SmoothProgram[Any], point: Point, penalty: float) -> float:
    return float(program.cost @ point.x) + penalty * max(point.violation, 0.0)


def _step(
    program: SmoothProgram[Any], x: Array, near: Linearization, proximity: float, penalty: float
) -> tuple[Array, float] | None:
    """The QP's step d (n,) and the violation s that it leaves; None where the solver finds none."""
    import daqp

    bounded, lower, upper = program.bounded
    n = len(x)
    weights = np.append(proximity / program.scale**2 + _FREE_WEIGHT, _SLACK_WEIGHT)
    unit = 1.0 / np.sqrt(weights)
    rows = np.zeros((len(near.residual) + len(bounded) + len(near.values), n + 1))
    rows[:, :n] = np.concatenate([near.equality, bounded, near.rows])
    rows[len(near.residual) + len(bounded) :, n] = -1.0
    rows *= unit
    norms = np.linalg.norm(rows, axis=1)
    norms[norms == 0.0] = 1.0
    rows /= norms[:, None]
    current = bounded @ x
    low = np.concatenate([-near.residual, lower - current, np.full(len(near.values), -_INFINITE)]) / norms
    high = np.concatenate([-near.residual, upper - current, -near.values]) / norms
    reach = np.append(program.reach, _INFINITE) / unit
    low = np.clip(np.concatenate([-reach[:-1], [0.0], low]), -_INFINITE, _INFINITE)
    high = np.clip(np.concatenate([reach, high]), -_INFINITE, _INFINITE)
    sense = np.zeros(len(low), dtype=np.intc)
    sense[high - low <= 1e-12 * np.maximum(1.0, np.abs(high))] = _EQUALITY
    gradient = np.append(program.cost, penalty) * unit
    y, _, flag, _ = daqp.solve(np.eye(n + 1), gradient, rows, high, low, sense, primal_tol=_PRIMAL_TOLERANCE)
    if flag != _SOLVED:
        return None
    step = y * unit
    return step[:n], max(float(step[n]), 0.0)
