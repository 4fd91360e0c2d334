"""Covariance of the 15-dimensional error; only the upper triangle is stored, so it stays symmetric.

Linear maps of the error are given as functions of the error, so blocks of zeros need no operations. The same
function maps an error vector, and both sides of its covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeAlias

from aerobat.kernels.ops import Scalar, Vector

SIZE = 15
Covariance: TypeAlias = tuple[Scalar, ...]  # 120: the upper triangle, row by row
Rows: TypeAlias = Sequence[Sequence[Scalar]]  # 15 x 15


class ErrorState(NamedTuple):
    """True state minus nominal state, with the attitude as a rotation vector: q_true = q ⊗ exp(rotation)."""

    position: Vector  # [m] world
    velocity: Vector  # [m/s] world
    rotation: Vector  # [rad] body
    gyro_bias: Vector  # [rad/s] body
    accelerometer_bias: Vector  # [m/s²] body


class Correction(NamedTuple):
    """The estimated error after the measurements so far."""

    error: ErrorState  # mean of the error
    rows: Rows  # covariance of the error
    nis: Scalar  # normalized innovation squared, summed


def error_state(components: Sequence[Scalar]) -> ErrorState:
    """Return the parts of an error of 15 components."""
    x = components
    return ErrorState(
        (x[0], x[1], x[2]),
        (x[3], x[4], x[5]),
        (x[6], x[7], x[8]),
        (x[9], x[10], x[11]),
        (x[12], x[13], x[14]),
    )


def unpack(covariance: Covariance) -> Rows:
    """Return all 15 x 15 components."""
    start = [row * SIZE - row * (row + 1) // 2 for row in range(SIZE)]
    return [[covariance[start[min(i, j)] + max(i, j)] for j in range(SIZE)] for i in range(SIZE)]


def pack(rows: Rows) -> Covariance:
    """Return the upper triangle of all components."""
    return tuple(rows[i][j] for i in range(SIZE) for j in range(i, SIZE))


def diagonal(variances: ErrorState) -> Rows:
    """Return the covariance of independent errors."""
    components = [variance for part in variances for variance in part]
    return [[components[i] if i == j else 0.0 for j in range(SIZE)] for i in range(SIZE)]


def add_diagonal(rows: Rows, variances: dict[str, Scalar]) -> Rows:
    """Return the covariance plus independent noise, with one variance for each named part of the error."""
    new = [list(row) for row in rows]
    for part, variance in variances.items():
        for i in _indices(part):
            new[i][i] = new[i][i] + variance
    return new


def uncorrelated(rows: Rows, part: str, variance: Scalar) -> Rows:
    """Return the covariance with one part of the error replaced by independent noise."""
    replaced = _indices(part)
    new = [[0.0 if i in replaced or j in replaced else rows[i][j] for j in range(SIZE)] for i in range(SIZE)]
    return add_diagonal(new, {part: variance})


def transform_part(rows: Rows, part: str, change: Callable[[ErrorState], Vector]) -> Rows:
    """Return the covariance after one part of the error has become `change(error)`, a linear function."""
    changed = [change(error_state(row)) for row in rows]  # covariance of the new part with each component
    new = [list(row) for row in rows]
    replaced = _indices(part)
    for axis, i in enumerate(replaced):
        row = [column[axis] for column in changed]
        itself = change(error_state(row))
        for j, value in enumerate(row):
            if j not in replaced:
                new[i][j] = new[j][i] = value
        for other in range(axis, 3):
            j = replaced[other]
            new[i][j] = new[j][i] = itself[other]
    return new


def correct(
    correction: Correction, measured: Callable[[ErrorState], Scalar], innovation: Scalar, variance: Scalar
) -> Correction:
    """Return the correction after one more scalar measurement: P − c cᵀ/s, c = P h, s = h·c + r.

    Args:
        correction: the correction so far.
        measured: the measured quantity as a linear function h·x of the error.
        innovation: measured minus predicted value, before any correction.
        variance: variance r of the measurement noise.
    """
    error, rows, nis = correction
    c = [measured(error_state(row)) for row in rows]
    inverse = 1.0 / (measured(error_state(c)) + variance)
    residual = innovation - measured(error)
    gain = [component * inverse for component in c]
    means = [component for part in error for component in part]
    new = [list(row) for row in rows]
    for i in range(SIZE):
        for j in range(i, SIZE):
            new[i][j] = new[j][i] = rows[i][j] - gain[i] * c[j]
    shifted = [mean + k * residual for mean, k in zip(means, gain, strict=True)]
    return Correction(error_state(shifted), new, nis + residual * residual * inverse)


def _indices(part: str) -> range:
    first = 3 * ErrorState._fields.index(part)
    return range(first, first + 3)
