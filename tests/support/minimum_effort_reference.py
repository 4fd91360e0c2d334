"""Minimum-effort polynomials in 400-bit arithmetic, for tests to judge float64 by: written for clearness."""

import math

import mpmath
import numpy as np

BITS = 400


def exact_coefficients(given, durations):
    """Coefficients in normalised segment time, (n, 2s, 3) of mpf, by the variational rule.

    `given` (n + 1, s, 3) with NaN where free, the same on all axes.
    """
    with mpmath.workprec(BITS):
        rows, sides = _conditions(given, [mpmath.mpf(float(duration)) for duration in durations])
        solution = _solved(rows, sides)
    return np.array(solution, dtype=object).reshape(len(durations), 2 * given.shape[1], 3)


def _conditions(given, durations):
    """Sparse rows {unknown: factor} and their right-hand sides, one for each axis."""
    order, count = given.shape[1], len(durations)
    zero, rows, sides = [mpmath.mpf(0)] * 3, [], []
    for knot in range(count + 1):
        before = [_derivative(knot - 1, d, 1, order, durations) for d in range(2 * order)] if knot else None
        after = (
            [_derivative(knot, d, 0, order, durations) for d in range(2 * order)] if knot < count else None
        )
        for d in range(order):
            if not np.isnan(given[knot, d, 0]):
                present = [side[d] for side in (before, after) if side is not None]
                rows += present
                sides += [[mpmath.mpf(float(value)) for value in given[knot, d]]] * len(present)
                continue
            dual = 2 * order - 1 - d
            if before is None or after is None:
                rows.append((before or after)[dual])
                sides.append(zero)
            else:
                rows += [before[k] | {j: -v for j, v in after[k].items()} for k in (d, dual)]
                sides += [zero, zero]
    return rows, sides


def _derivative(segment, d, end, order, durations):
    """The row of d^d p/dt^d at the start (0) or end (1) of a segment."""
    powers = range(d, 2 * order) if end else [d]
    return {2 * order * segment + j: math.perm(j, d) / durations[segment] ** d for j in powers}


def _solved(rows, sides):
    """Gaussian elimination with partial pivoting on sparse rows."""
    rows, sides = [dict(row) for row in rows], [list(side) for side in sides]
    waiting, pivots = sorted(range(len(rows)), key=lambda i: min(rows[i])), []
    candidates = []
    for column in range(len(rows)):
        while waiting and min(rows[waiting[0]]) <= column:
            candidates.append(waiting.pop(0))
        pivot = max(candidates, key=lambda i: abs(rows[i].get(column, 0)))
        candidates.remove(pivot)
        pivots.append(pivot)
        for i in candidates:
            factor = rows[i].pop(column, 0) / rows[pivot][column]
            if factor:
                for j, value in rows[pivot].items():
                    if j > column:
                        rows[i][j] = rows[i].get(j, 0) - factor * value
                sides[i] = [a - factor * b for a, b in zip(sides[i], sides[pivot], strict=True)]
    solution = [None] * len(rows)
    for column in reversed(range(len(rows))):
        row, side = rows[pivots[column]], sides[pivots[column]]
        known = [(value, solution[j]) for j, value in row.items() if j > column]
        solution[column] = [
            (side[axis] - mpmath.fsum(v * x[axis] for v, x in known)) / row[column] for axis in range(3)
        ]
    return solution
