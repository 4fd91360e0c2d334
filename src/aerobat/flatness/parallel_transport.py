"""Parallel transport of a frame along a thrust direction, without spin, singularity or drift.

Between samples the specific thrust f is the quintic through its values and two derivatives at both ends,
which is exact for trajectories of degree 7 or less. Its Bézier control points bound the curve, so halving
intervals until each piece stays inside a cone is a proof. On such a piece the frame first turns by the
smallest rotation from one thrust direction to the next. It then turns about that direction by the area
between the curve and the great arc (Hanson and Ma, "Parallel transport approach to curve framing", 1995).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array
from aerobat.so3 import UP
from aerobat.states import TimeInterval
from aerobat.trajectory.subintervals import Subintervals

MAX_TURN = 0.5  # largest change of f on a piece, as a fraction of |f| at its start: 30 degrees
MAX_HALVINGS = 60  # far more than any realistic curve needs
CROSSING_ROUNDS = 10  # each divides the interval by 16, so the result has full precision


@dataclass(frozen=True)
class TransportedFrames:
    """Attitudes along a thrust curve at M nodes: its samples, and nodes added between them."""

    q_world_body: Array  # (M, 4), sign continuous
    determined: NDArray[np.bool_]  # (M,) True where |f| reaches the floor, so that the thrust has a direction
    samples: NDArray[np.intp]  # indices of the samples among the nodes, (T,)
    undetermined: tuple[TimeInterval, ...]


def frames(times: Array, thrust: Array, floor: float, heading: float) -> TransportedFrames:
    """Carry a frame along the specific thrust f without spin.

    The initial frame is the smallest rotation from the vertical to f, turned about f by `heading`. Where |f|
    is below `floor` [m/s²] the frame is held; behind such an interval it continues by the smallest rotation.
    Times (T,) may repeat; `thrust` holds f, f', f'', (T, 3, 3).
    """
    pieces, control = _subdivided(times, thrust, floor)
    samples = np.append(np.flatnonzero(pieces.start == 0.0), len(pieces))
    starts = times[pieces.interval] + pieces.start * np.diff(times)[pieces.interval]
    nodes = np.append(starts, times[-1])
    f = np.concatenate([control[:, 0], thrust[-1:, 0]])
    magnitude = _norm(f)
    determined = magnitude >= floor
    directions = _held_directions(f, magnitude, determined)
    smooth = determined[1:] & determined[:-1]
    q = _carry(directions, np.where(smooth[:, None, None], control, directions[:-1, None]), heading)
    return TransportedFrames(q, determined, samples, _undetermined(nodes, control, determined, floor))


def _carry(directions: Array, control: Array, heading: float) -> Array:
    """Return attitudes (M, 4) at unit thrust directions (M, 3), from the pieces between, (M - 1, 6, 3)."""
    chart = _chart(directions)
    first = so3.multiply(so3.smallest_rotation(UP, directions[0]), so3.about_axis(UP, np.array(heading)))
    # all frames of one thrust direction differ by an angle about it, and angles add up
    arcs = so3.multiply(so3.smallest_rotation(directions[:-1], directions[1:]), chart[:-1])
    carried = np.concatenate([first[None], arcs])
    angles = so3.twist(chart, carried)
    angles[1:] += _area(directions[:-1], control)
    q = so3.multiply(chart, so3.about_axis(UP, np.cumsum(angles)))
    turned = np.append(np.dot(q[0], first), np.sum(q[1:] * q[:-1], axis=-1)) < 0
    return np.asarray(q * np.cumprod(np.where(turned, -1.0, 1.0))[:, None])


def _area(start: Array, control: Array) -> Array:
    """Return the area on the unit sphere between each curve (n, 6, 3) and the great arc from `start`.

    `start` (n, 3) is b3 at the curve's start. The area is ∫ start·(f × f') / (r (r + start·f)) with r = |f|,
    from dA = (1 − cos θ) dφ in polar angles about start.
    """
    ux, uy, uz = start.T[:, :, None]
    x, y, z = (GAUSS_VALUES @ control).transpose(2, 0, 1)
    dx, dy, dz = (GAUSS_SLOPES @ control).transpose(2, 0, 1)
    r = np.sqrt(x * x + y * y + z * z)
    swept = ux * (y * dz - z * dy) + uy * (z * dx - x * dz) + uz * (x * dy - y * dx)
    return np.asarray((swept / (r * (r + ux * x + uy * y + uz * z))) @ GAUSS_WEIGHTS)


def _chart(directions: Array) -> Array:
    """Return one attitude for each thrust direction, well conditioned everywhere, (M, 3) -> (M, 4).

    Above the horizon it is the smallest rotation from upright; below, from inverted by a half turn about x.
    """
    x, y, z = directions.T
    u, zero = 1 + np.abs(z), np.zeros_like(z)
    chart = np.where(z < 0, [-y, u, zero, x], [u, -y, x, zero]) / np.sqrt(2 * u)
    return np.asarray(chart.T)


def _subdivided(times: Array, thrust: Array, floor: float) -> tuple[Subintervals, Array]:
    """Return parts of sample intervals in order, and their control points (n, 6, 3).

    Intervals are halved until each part stays in a cone about its start, or below the floor.
    """
    pending, control = Subintervals.whole(len(times) - 1), _hermite(thrust[:-1], thrust[1:], np.diff(times))
    done: list[tuple[Subintervals, Array]] = []
    for _ in range(MAX_HALVINGS):
        wide = _leaves_cone(control, floor)
        if not (done or wide.any()):
            return pending, control
        done.append((pending[~wide], control[~wide]))
        pending = pending[wide].halves()
        control = np.concatenate([LOWER_HALF @ control[wide], UPPER_HALF @ control[wide]])
        if not wide.any():
            break
    parts, controls = zip(*done, (pending, control), strict=True)
    pieces = Subintervals.joined(parts)
    order = pieces.order()
    return pieces[order], np.concatenate(controls)[order]


def _leaves_cone(control: Array, floor: float) -> NDArray[np.bool_]:
    """Tell which pieces may leave the cone about their start while they are above the floor."""
    spread = _norm(control - control[:, :1]).max(axis=1)
    norms = _norm(control)
    return np.asarray((spread > MAX_TURN * norms[:, 0]) & (norms.max(axis=1) > floor))


def _hermite(thrust: Array, ahead: Array, step: Array) -> Array:
    """Return control points (n, 6, 3) of the quintics between f, f', f'' (n, 3, 3) and those `step` later."""
    h = step[:, None]
    (f0, d0, c0), (f1, d1, c1) = (side.swapaxes(0, 1) for side in (thrust, ahead))
    left, right = f0 + h / 5 * d0, f1 - h / 5 * d1
    inner = (left + h / 5 * d0 + h**2 / 20 * c0, right - h / 5 * d1 + h**2 / 20 * c1)
    return np.stack([f0, left, *inner, right, f1], axis=1)


def _held_directions(f: Array, magnitude: Array, determined: NDArray[np.bool_]) -> Array:
    """Return f/|f|, held where it is undetermined; upwards before the first determined one, (M, 3)."""
    last = np.maximum.accumulate(np.where(determined, np.arange(len(f)), -1))
    directions = f / np.where(determined, magnitude, 1.0)[:, None]
    return np.where(last[:, None] >= 0, directions[last], UP)


def _undetermined(
    times: Array, control: Array, determined: NDArray[np.bool_], floor: float
) -> tuple[TimeInterval, ...]:
    """Return the intervals with nodes below the floor, extended to where the curve crosses it."""
    edges = np.diff(np.concatenate([[0], ~determined, [0]]).astype(int))
    crossings = [
        float(times[i] + _crossing(control[i], floor) * (times[i + 1] - times[i]))
        for i in np.flatnonzero(edges[1:-1])
    ]
    start = [] if determined[0] else [float(times[0])]
    end = [] if determined[-1] else [float(times[-1])]
    bounds = iter([*start, *crossings, *end])
    return tuple(TimeInterval(first, last) for first, last in zip(bounds, bounds, strict=True))


def _crossing(control: Array, floor: float) -> float:
    """Return the parameter in [0, 1] at which a piece crosses the floor, given ends on both sides of it."""
    low, high = 0.0, 1.0
    for _ in range(CROSSING_ROUNDS):
        s = np.linspace(low, high, 17)
        above = _norm(_bernstein(5, s) @ control) >= floor
        past = max(int(np.argmax(above != above[0])), 1)
        low, high = float(s[past - 1]), float(s[past])
    return (low + high) / 2


def _norm(vectors: Array) -> Array:
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors)))


def _bernstein(degree: int, s: Array) -> Array:
    """Return the Bernstein polynomials at the parameters s (k,), (k, degree + 1)."""
    return np.stack([comb(degree, i) * s**i * (1 - s) ** (degree - i) for i in range(degree + 1)], axis=1)


# de Casteljau's algorithm: control points of [0, 1/2] are binomially weighted means of the first ones
LOWER_HALF = np.array([[comb(i, j) / 2**i for j in range(6)] for i in range(6)])
UPPER_HALF = LOWER_HALF[::-1, ::-1].copy()

_ABSCISSAE, _WEIGHTS = np.polynomial.legendre.leggauss(8)
GAUSS_WEIGHTS = _WEIGHTS / 2
GAUSS_VALUES = _bernstein(5, (_ABSCISSAE + 1) / 2)
GAUSS_SLOPES = 5 * _bernstein(4, (_ABSCISSAE + 1) / 2) @ np.diff(np.eye(6), axis=0)
