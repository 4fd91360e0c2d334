"""A gate judged from the whole polyline of a flight at once: what the kernel finds tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.engines.floats import ArrayOps
from aerobat.engines.pytree import components, tree_map
from aerobat.kernels.gates import progress
from aerobat.kernels.gates.progress import GateProgress
from aerobat.kernels.gates.section import extent, gap, section
from aerobat.kernels.gates.snapshot import Snapshot, interpolated
from aerobat.kernels.gates.swath import Swath, swept_between
from aerobat.problem.planned_passage import PASSAGE_DEPTH, PlannedPassage
from aerobat.simulation.passages.passage import PASSAGE_WINDOW, bounding_ellipsoid, gate_places
from aerobat.vehicle import Ellipsoid

T = TypeVar("T")


def gate_progress(
    planned: PlannedPassage, times: Array, states: Sequence[Array], body: Ellipsoid
) -> GateProgress:
    """Progress at the end of a flight along a polyline of states; leaves (1,).

    Args:
        planned: what was to be passed.
        times: of the states [s], (T,).
        states: positions, velocities and attitudes, (T, ·).
        body: what encloses the vehicle.
    """
    track = _Track(planned, times, states[0] - planned.gate.position, *states[1:])
    forward, backward = track.nearest(track.passages), track.nearest(track.crossings(-1))
    in_window = np.abs(times - planned.time) <= PASSAGE_WINDOW
    about = track.distance[in_window] if in_window.any() else track.distance[-1:]
    [place] = gate_places((planned,), bounding_ellipsoid(body))
    before: GateProgress = tree_map(lambda leaf: np.full(1, leaf), progress.init(place))
    found = before._replace(max_distance=np.array([about.max()]), min_distance=np.array([about.min()]))
    if backward is not None:
        found = found._replace(backward=track.crossing(backward).time)
    if forward is None:
        return found
    found = found._replace(crossing=track.crossing(forward))
    return found._replace(swath=found.swath._replace(crossing=track.swept(forward, body)))


@dataclass(frozen=True)
class _Track:
    """A polyline of states about a gate; interval k leads from row k to the next."""

    planned: PlannedPassage
    times: Array  # [s], (T,)
    offset: Array  # [m] from the centre of the opening, (T, 3)
    velocity: Array  # [m/s], (T, 3)
    q_world_body: Array  # (T, 4)

    @cached_property
    def distance(self) -> Array:
        """The distance of each row beyond the gate's plane [m], (T,)."""
        return np.asarray(self.offset @ self.planned.gate.normal)

    @cached_property
    def rows(self) -> Snapshot:
        """The rows as kernels take them, leaves (T,)."""
        return Snapshot(self.times, *map(components, (self.offset, self.velocity, self.q_world_body)))

    def crossings(self, direction: int) -> NDArray[np.intp]:
        """The intervals in which the plane is crossed, in its direction (1) or against it (−1)."""
        return np.flatnonzero(np.diff((self.distance > 0.0).astype(int)) == direction)

    @property
    def passages(self) -> list[np.intp]:
        """The crossings after which the vehicle gets far enough beyond the plane before it comes back."""
        back = np.append(self.crossings(-1), len(self.times))
        return [
            k
            for k in self.crossings(1)
            if self.distance[k + 1 : back[np.searchsorted(back, k)] + 1].max() >= PASSAGE_DEPTH
        ]

    def crossing(self, k: np.intp) -> Snapshot:
        """The state where the plane is crossed in an interval, leaves (1,)."""
        fraction = -self.distance[k] / (self.distance[k + 1] - self.distance[k])
        last, now = (_part(self.rows, slice(j, j + 1)) for j in (k, k + 1))
        return interpolated(last, now, fraction)

    def nearest(self, intervals: Sequence[np.intp] | NDArray[np.intp]) -> np.intp | None:
        """Of the intervals the one that crosses next to the planned instant, None of none in the window."""
        off_times = [abs(self.crossing(k).time[0] - self.planned.time) for k in intervals]
        k = int(np.argmin(off_times)) if off_times else 0
        return intervals[k] if off_times and off_times[k] <= PASSAGE_WINDOW else None

    def swept(self, crossing: np.intp, body: Ellipsoid) -> Swath:
        """Return the swath that the body sweeps in the plane during the stay of a crossing, leaves (1,)."""
        gate = self.planned.gate
        [(plane, ellipsoid)] = gate_places((self.planned,), bounding_ellipsoid(body))
        rows = self.rows
        across = plane.normal, *plane.directions[0][:2]
        gaps = gap(ArrayOps, section(ArrayOps, ellipsoid, across, rows.position, rows.q_world_body))
        off_plane = (gaps > 0.0) & (np.abs(self.distance) > PASSAGE_DEPTH)
        reach = gate.opening.circumradius + extent(ArrayOps, ellipsoid)
        beside = np.linalg.norm(self.offset, axis=-1) > reach
        index = np.arange(len(gaps))
        passed = index[(index > crossing) & (self.distance >= PASSAGE_DEPTH)][0]
        is_passing = (self.distance > 0.0) & (self.distance < PASSAGE_DEPTH) & (index > self.crossings(1)[0])
        before = index[(off_plane | (beside & ~is_passing)) & (index <= crossing)]
        after = index[(off_plane & (index > crossing)) | (beside & (index >= passed))]
        stay = slice(before[-1] if before.size else 0, after[0] + 1 if after.size else len(gaps))
        rows, gaps = _part(rows, stay), gaps[stay]
        snapshots = _part(rows, slice(-1)), _part(rows, slice(1, None))
        crosses = np.arange(len(gaps) - 1) == crossing - stay.start
        met, swept = swept_between(
            ArrayOps, (plane, ellipsoid), snapshots, (gaps[:-1], gaps[1:]), crosses.astype(float)
        )
        farthest = [int(np.argmax(np.where(met, extreme.reach, -np.inf))) for extreme in swept]
        return tuple(_part(each, slice(k, k + 1)) for each, k in zip(swept, farthest, strict=True))


def _part(tree: T, part: slice) -> T:
    """A part of the leaves."""
    cut: T = tree_map(lambda leaf: leaf[part], tree)
    return cut
