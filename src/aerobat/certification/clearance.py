"""Clearance of a body from all obstacles over continuous time: a proven enclosure of the smallest gap.

Two parallel planes with unit normal n leave a gap between an obstacle's piece and the body. With u = n·b3 and
s(u) = √(wide² − (wide² − high²) u²) the gap is

    φ(n) = n·p + up u − s(u) − aside − h(n).

For every n the gap is a lower bound of the distance. s is concave where wide ≥ high, so its tangent is an
upper bound of s. With the tangent in place of s, φ is linear in position p and thrust axis b3, whose
Chebyshev series are known. Branch and bound considers pairs of a part of the path and one piece. It chooses n
at the middle of the part and bounds φ along the part. Pairs that may still be nearer than the nearest gap
found are halved. DERIVATION.md, section 9, has the details.

A gate's frame is modelled as in the scores of flights: the plane around the opening, infinitely wide and
thin. It counts during the passage: while the body, or its centre within PASSAGE_DEPTH, is at that plane
without a break, near enough to touch the circle around the opening.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np

from aerobat.arrays import Array, Indices, Mask
from aerobat.certification.body_path import BodyPath
from aerobat.certification.certificate import Finding, Side, Verdict
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.extrema import parabola_maximum
from aerobat.certification.enclosure.queries import SUMMATION_ROUNDING
from aerobat.environment.obstacles import Pieces
from aerobat.problem import Gate
from aerobat.problem.planned_passage import PASSAGE_DEPTH, PlannedPassage
from aerobat.trajectory.subintervals import Subintervals

FIRST_PIECES = 64  # pieces considered first: any small gap found prunes many others
HALVINGS = 3  # halvings between searches for planes; these cost little more for 100 pairs than for one
ROUNDS = 14  # rounds of searching planes and halving
MAX_PAIRS = 20_000  # limit of the pairs besides the initial ones; no known path needs a tenth of it


@dataclass(frozen=True)
class ClearanceEnclosure:
    """The smallest gap between a body and obstacles, enclosed between `value` and `bound`."""

    value: float = inf  # [m] the gap reached at `time`
    bound: float = inf  # [m] proven: the gap is nowhere smaller
    time: float = 0.0  # [s]
    obstacle: str | None = None  # the nearest obstacle at that time

    @property
    def enough(self) -> float:
        """The bound [m] at which the enclosure is tight enough.

        It lies below the gap by 0.3 mm, or by half of a smaller gap, at least by 1 µm. Below an overlap, it
        lies by 2 % of the depth, where that is more than 0.3 mm.
        """
        if self.value < 0.0:
            return self.value - max(-0.02 * self.value, 3e-4)
        return self.value - min(max(0.5 * self.value, 1e-6), 3e-4)


def clearance_finding(attitude: BodyPath | None, ball: BodyPath, pieces: Pieces) -> Finding:
    """Return the finding about the smallest gap between a body and obstacles.

    Args:
        attitude: The body where its attitude is determined, or None if it never is.
        ball: The ball around the body, on the rest of the path.
        pieces: The pieces of the obstacles, at least one.
    """
    known = ClearanceEnclosure() if attitude is None else enclose_clearance(attitude, pieces)
    around = enclose_clearance(ball, pieces)
    bound = min(known.bound, around.bound)
    nearest, verdict = min(known, around, key=lambda gap: gap.value), Verdict.UNDECIDED
    if bound >= 0.0:
        verdict = Verdict.HOLDS
    elif known.value < 0.0:  # where only the ball overlaps, the body inside it may still be clear
        nearest, verdict = known, Verdict.VIOLATED
    value = max(nearest.value, bound)  # where bodies overlap, another plane may separate them better
    found = Finding("clearance", "m", Side.MIN, value, bound, nearest.time, 0.0, verdict)
    return replace(found, obstacle=nearest.obstacle, field="environment.obstacles")


def frame_finding(attitude: BodyPath | None, ball: BodyPath, passage: PlannedPassage) -> Finding:
    """Return the finding about the body's smallest gap from the frame of a gate during its passage.

    Args:
        attitude: The body where its attitude is determined, or None if it never is.
        ball: The ball around the body, on the rest of the path.
        passage: The passage of the gate.
    """
    gate, reach = passage.gate, ball.body.reach
    around = gate.opening.circumradius + reach
    paths = [path for path in (attitude, ball) if path is not None]
    off_gate = np.sort(np.concatenate([_times_off_gate(path, gate, around) for path in paths]))
    begin = off_gate[off_gate < passage.time].max(initial=0.0)
    end = off_gate[off_gate > passage.time].min(initial=ball.trajectory.duration)
    known = None if attitude is None else attitude.during(begin, end)
    found = clearance_finding(known, ball.during(begin, end), Pieces(gate.plane_around(around + reach)))
    return replace(found, gate=gate.name, obstacle=None, field="")


def _times_off_gate(path: BodyPath, gate: Gate, around: float) -> Array:
    """Return instants [s] at which the body is not at a gate's plane within `around` [m] of its centre."""
    times, centres, axes = path.sampled
    offset = centres - gate.places(times)
    height, along = offset @ gate.normal, axes @ gate.normal
    body = path.body
    touched = np.sqrt(body.wide**2 + (body.high**2 - body.wide**2) * along**2) + body.aside
    is_off = np.minimum(np.abs(height + body.up * along) - touched, np.abs(height) - PASSAGE_DEPTH) > 0.0
    return np.asarray(times[is_off | (np.linalg.norm(offset, axis=1) > around)])


def enclose_clearance(path: BodyPath, pieces: Pieces) -> ClearanceEnclosure:
    """Enclose the smallest gap between a body on its path and the pieces; infinite for an empty path."""
    if not len(path.pieces):
        return ClearanceEnclosure()
    centres, radii = path.balls
    lower = pieces.box_distances(centres, centres, path.pieces.spans(path.trajectory)) - radii[:, None]
    first = np.argsort(lower.min(axis=0))[:FIRST_PIECES]
    pairs = _PathObstaclePairs.of(path, pieces, lower[:, first].argmin(axis=0), first).separated()
    found = pairs.nearest(ClearanceEnclosure())
    near = lower < found.enough
    found = replace(found, bound=float(lower[~near].min(initial=inf)))
    pairs = _PathObstaclePairs.of(path, pieces, *np.nonzero(near))
    most = MAX_PAIRS + len(pairs)
    for _ in range(ROUNDS):
        pairs = pairs.separated()
        found, pairs = pairs.pruned(pairs.nearest(found))
        for _ in range(HALVINGS):
            pairs = pairs.halves()
        found, pairs = pairs.pruned(found)
        if not 0 < len(pairs) <= most:
            break
    # bounds of pairs that are still open are valid, but may not be tight
    return replace(found, bound=float((pairs.lower - pairs.error).min(initial=found.bound)))


@dataclass(frozen=True, eq=False)
class _PathObstaclePairs:
    """Pairs of a part of a path and a piece of an obstacle, with a plane that touches the piece."""

    path: BodyPath
    pieces: Pieces
    parts: Subintervals  # of the path's pieces, (m,)
    series: Array  # series of centre of mass [m] and thrust axis, (m, K + 1, 6)
    obstacles: Indices  # (m,)
    normals: Array  # unit vectors from the piece to the body, (m, 3)
    offsets: Array  # h [m], (m,)

    @classmethod
    def of(cls, path: BodyPath, pieces: Pieces, rows: Indices, obstacles: Indices) -> _PathObstaclePairs:
        """Return pairs of whole pieces of a path and obstacles, before planes are known."""
        parts, count = Subintervals.whole(len(path.pieces))[rows], len(rows)
        return cls(path, pieces, parts, path.series[rows], obstacles, np.zeros((count, 3)), np.zeros(count))

    def __len__(self) -> int:
        return len(self.parts)

    def __getitem__(self, rows: Mask | Indices) -> _PathObstaclePairs:
        return _PathObstaclePairs(
            self.path,
            self.pieces,
            self.parts[rows],
            self.series[rows],
            self.obstacles[rows],
            self.normals[rows],
            self.offsets[rows],
        )

    def halves(self) -> _PathObstaclePairs:
        """Return both halves of every part, with the same planes."""
        halves = chebyshev.basis(self.series.shape[1] - 1).halves
        series = np.concatenate([half @ self.series for half in halves])
        twice = np.tile(np.arange(len(self)), 2)
        return replace(self[twice], parts=self.parts.halves(), series=series)

    def separated(self) -> _PathObstaclePairs:
        """Return the same pairs with the planes that separate best at the middle of the parts."""
        centres, axes = np.split(_at_middle(self._relative), 2, axis=-1)
        arms, shapes = self.path.body.turned(axes / np.linalg.norm(axes, axis=-1, keepdims=True))
        planes = self.pieces.separated(self.obstacles, centres + arms, shapes)
        found = replace(self, normals=planes.normals, offsets=planes.offsets)
        # the new plane may be worse where bodies overlap
        worse = self.normals.any(axis=-1) & (found.middle < self.middle)
        normals = np.where(worse[:, None], self.normals, planes.normals)
        return replace(self, normals=normals, offsets=np.where(worse, self.offsets, planes.offsets))

    def nearest(self, known: ClearanceEnclosure) -> ClearanceEnclosure:
        """Return the smallest gap at the middle of a part, or `known` where that is not larger."""
        gaps = self.middle + self.error
        row = int(np.argmin(gaps)) if len(gaps) else 0
        if not len(gaps) or gaps[row] >= known.value:
            return known
        time = float(self[np.array([row])]._times(0.0)[0])
        name = self.pieces.pieces[self.obstacles[row]].name
        return replace(known, value=float(gaps[row]), time=time, obstacle=name)

    def pruned(self, found: ClearanceEnclosure) -> tuple[ClearanceEnclosure, _PathObstaclePairs]:
        """Return `found` with the bound of all pairs that are far enough, and the remaining pairs."""
        near = self.lower < found.enough
        bound = (self.lower - self.error)[~near].min(initial=found.bound)
        return replace(found, bound=float(bound)), self[near]

    @cached_property
    def middle(self) -> Array:
        """The gaps [m] at the middle of the parts, without errors, (m,)."""
        return _at_middle(self._linear)

    @cached_property
    def lower(self) -> Array:
        """Lower bounds of the gaps [m] along the parts, without errors, (m,)."""
        peak, tail, _ = parabola_maximum(-self._linear)
        return np.asarray(-peak - tail - self._tangent_excess)

    @cached_property
    def error(self) -> Array:
        """The largest error [m] of `middle` and `lower`, (m,)."""
        position, axis = self.path.error[self.parts.interval].T
        deviation = self._piece_motion[2]
        summed = np.abs(self._linear).sum(axis=1) + np.abs(self.offsets) + self.pieces.largest
        summed += np.abs(self.series[:, 0, :3]).sum(axis=1)
        return np.asarray(
            position + deviation + np.abs(self._axis_slope) * axis + SUMMATION_ROUNDING * summed
        )

    @cached_property
    def _relative(self) -> Array:
        """The series relative to the pieces, whose motion along each part is approximated by a line."""
        if not self.pieces.moving:
            return self.series
        middle, slope, _ = self._piece_motion
        series = self.series.copy()
        series[:, 0, :3] -= middle
        series[:, 1, :3] -= slope
        return series

    @cached_property
    def _piece_motion(self) -> tuple[Array, Array, Array]:
        """Motion of the pieces [m], as m + s τ along the parts with τ in [−1, 1].

        Return m and s, (m, 3) each, and the largest distance of the true motion from that line, (m,).
        """
        begin, end = self._times(-1.0), self._times(1.0)
        first, last = self.pieces.moved(self.obstacles, begin), self.pieces.moved(self.obstacles, end)
        deviation = np.zeros(len(self))
        for number, motion in self.pieces.moving:
            own = np.flatnonzero(self.obstacles == number)
            for jump in motion.times.tolist():
                inside = own[(begin[own] < jump) & (jump < end[own])]
                part = ((jump - begin[inside]) / (end - begin)[inside])[:, None]
                line = first[inside] + part * (last - first)[inside]
                away = np.linalg.norm(motion.moved(np.full(len(inside), jump)) - line, axis=-1)
                deviation[inside] = np.maximum(deviation[inside], away)
        return (first + last) / 2.0, (last - first) / 2.0, deviation

    def _times(self, position: float) -> Array:
        """Return the times [s] of a position in [-1, 1] on each part, (m,)."""
        along = 2 * self.parts.start + self.parts.length * (1 + position) - 1
        return self.path.pieces[self.parts.interval].times(self.path.trajectory, along)

    @cached_property
    def _projections(self) -> tuple[Array, Array]:
        """The series of n·p [m] and of u = n·b3, (m, K + 1) each."""
        places = self._relative.reshape(*self.series.shape[:2], 2, 3)
        along = (places @ self.normals[:, None, :, None])[..., 0]
        return along[..., 0], along[..., 1]

    @cached_property
    def _tangents(self) -> tuple[Array, Array, Array]:
        """The values of u, of s [m] and of its slope [m] at the middle of the parts, (m,) each."""
        body = self.path.body
        cosine = np.clip(_at_middle(self._projections[1]), -1.0, 1.0)
        difference = body.wide**2 - body.high**2
        reached = np.sqrt(body.wide**2 - difference * cosine**2)
        return cosine, reached, -difference * cosine / reached

    @cached_property
    def _linear(self) -> Array:
        """The series of φ [m] with s replaced by its tangent, (m, K + 1)."""
        (position, alignment), (cosine, reached, slope) = self._projections, self._tangents
        series = position + self._axis_slope[:, None] * alignment
        series[:, 0] += slope * cosine - reached - self.path.body.aside - self.offsets
        return np.asarray(series)

    @property
    def _axis_slope(self) -> Array:
        """The derivative of φ with respect to u [m], (m,)."""
        return np.asarray(self.path.body.up - self._tangents[2])

    @property
    def _tangent_excess(self) -> Array:
        """The largest excess of s over its tangent [m] along the parts, (m,); 0 where wide ≥ high."""
        body, alignment = self.path.body, self._projections[1]
        beyond = np.abs(alignment[:, 0] - self._tangents[0]) + np.abs(alignment[:, 1:]).sum(axis=1)
        beyond += self.path.error[self.parts.interval, 1]
        return np.asarray(max(body.high**2 - body.wide**2, 0.0) / (2.0 * body.wide) * beyond**2)


def _at_middle(series: Array) -> Array:
    """Return the values of series (m, K + 1, ...) at the middle of their intervals, (m, ...)."""
    signs = np.cos(np.pi / 2 * np.arange(series.shape[1])).round()
    return np.asarray(np.tensordot(signs, series, (0, 1)))
