"""The paper's maneuvers as assignment programs, written straight from Section II: no planner involved.

Variables are the jerks, axis by axis; rows are the states at the ends of intervals (node n ends interval n).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

import numpy as np

from aerobat.optimization import AssignmentProgram, SlottedStage

GRAVITY = 9.81
X, Y, Z = range(3)
POSITION, VELOCITY, ACCELERATION = range(3)


@dataclass(frozen=True)
class Maneuver:
    """The numbers of the authors' code."""

    gate: tuple[float, float, float] = (0.0, 0.0, 5.5)
    end: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lateral: int = Y
    lateral_thrust: float = 18.0  # ε_l
    inverted_thrust: float = 25.0  # ε_z
    max_velocity: float = 10.0
    max_acceleration: float = 90.0
    max_jerk: float = 200.0
    ordered: bool = False


FLIP_ROLL = Maneuver()
FLIP_PITCH = Maneuver(lateral=X)
FLIP_TRANSLATION = Maneuver(gate=(2.5, 0.0, 5.5), end=(5.0, 0.0, 0.0))
HALF_FLIP = Maneuver(gate=(2.5, 2.0, 3.5), end=(5.0, 0.0, 0.0))


@dataclass
class _Rows:
    """Range rows with their standing bounds."""

    intervals: int
    dt: float
    matrix: list[np.ndarray] = field(default_factory=list)
    bounds: list[tuple[float, float]] = field(default_factory=list)

    def state(self, axis: int, derivative: int, node: int) -> np.ndarray:
        """p, v or a at the end of interval `node`, from rest at the origin: Σ_i j_i ∂state/∂j_i."""
        row = np.zeros(3 * self.intervals)
        for i in range(node + 1):
            after = (node - i) * self.dt  # from the end of interval i
            a, v, p = self.dt, self.dt**2 / 2, self.dt**3 / 6
            row[axis * self.intervals + i] = (p + v * after + a * after**2 / 2, v + a * after, a)[derivative]
        return row

    def add(self, row: np.ndarray, low: float = -inf, high: float = inf) -> int:
        self.matrix.append(row)
        self.bounds.append((low, high))
        return len(self.matrix) - 1


def flip(maneuver: Maneuver, intervals: int = 20, dt: float = 0.1) -> AssignmentProgram:
    """Sections II-A to II-C."""
    rows = _Rows(intervals, dt)
    m, gate, nodes = maneuver, intervals // 2, range(intervals - 1)
    lateral, vertical = _limits(rows, m, m.lateral)
    minus = [rows.add(rows.matrix[lateral[n]] - rows.matrix[vertical[n]]) for n in nodes]
    plus = [rows.add(rows.matrix[lateral[n]] + rows.matrix[vertical[n]]) for n in nodes]
    g, thrust = GRAVITY, m.lateral_thrust

    def stage(name: str, columns: tuple[list[int], ...], low: list[float], high: list[float]) -> SlottedStage:
        return SlottedStage(name, tuple(nodes), np.array(columns).T, np.array(low), np.array(high))

    stages = (
        stage("0", (minus,), [g], [g]),
        stage("1", (vertical, lateral), [-g, thrust], [-g, inf]),
        _gate(rows, m, gate, [vertical[gate], lateral[gate]], [-inf, 0.0], [-g - m.inverted_thrust, 0.0]),
        stage("2", (vertical, lateral), [-g, -inf], [-g, -thrust]),
        stage("3", (plus,), [-g], [-g]),
    )
    order = tuple((i, i + 1) for i in range(4)) if m.ordered else ()
    return _program(rows, m, stages, order)


def half_flip(maneuver: Maneuver, intervals: int = 20, dt: float = 0.1) -> AssignmentProgram:
    """Section II-D at 90°: every stage is fixed."""
    rows = _Rows(intervals, dt)
    m, gate = maneuver, intervals // 2
    lateral, vertical = _limits(rows, m, m.lateral, min_vertical=-GRAVITY)
    ranges = [vertical[gate], lateral[gate]]
    stage = _gate(rows, m, gate, ranges, [-GRAVITY, -inf], [-GRAVITY, -m.lateral_thrust])
    return _program(rows, m, (stage,), ())


def _limits(
    rows: _Rows, m: Maneuver, lateral: int, min_vertical: float = -inf
) -> tuple[list[int], list[int]]:
    """Bounds on every axis; the rows of the lateral and of the vertical acceleration at each node."""
    found: dict[int, list[int]] = {}
    for axis in (X, Y, Z):
        low = max(-m.max_acceleration, min_vertical if axis == Z else -inf)
        for n in range(rows.intervals - 1):
            rows.add(rows.state(axis, VELOCITY, n), -m.max_velocity, m.max_velocity)
            row = rows.add(rows.state(axis, ACCELERATION, n), low, m.max_acceleration)
            found.setdefault(axis, []).append(row)
        for n in range(rows.intervals):
            rows.add(np.eye(3 * rows.intervals)[axis * rows.intervals + n], -m.max_jerk, m.max_jerk)
    return found[lateral], found[Z]


def _gate(
    rows: _Rows, m: Maneuver, node: int, ranges: list[int], low: list[float], high: list[float]
) -> SlottedStage:
    position = [rows.add(rows.state(axis, POSITION, node)) for axis in (X, Y, Z)]
    at = list(m.gate)
    return SlottedStage(
        "gate", (node,), np.array([ranges + position]), np.array(low + at), np.array(high + at)
    )


def _program(
    rows: _Rows, m: Maneuver, stages: tuple[SlottedStage, ...], order: tuple[tuple[int, int], ...]
) -> AssignmentProgram:
    """At rest at the end."""
    last = rows.intervals - 1
    final = [rows.state(axis, derivative, last) for axis in (X, Y, Z) for derivative in range(3)]
    target = [value for axis in (X, Y, Z) for value in (m.end[axis], 0.0, 0.0)]
    low, high = np.array(rows.bounds).T
    return AssignmentProgram(
        np.array(final), np.array(target), np.array(rows.matrix), low, high, stages, order
    )
