"""Metrics of a logged flight: the kernels of the online metrics, scanned over the log's rows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache, partial
from operator import itemgetter
from typing import NamedTuple, Protocol

import numpy as np

from aerobat.arrays import Array
from aerobat.engines import choose, run_whole
from aerobat.engines.engine import Init, Step
from aerobat.engines.pytree import Tree, components, tree_leaves, tree_map, tree_stack
from aerobat.kernels.gates import progress
from aerobat.kernels.gates.snapshot import Snapshot, Transition
from aerobat.kernels.ops import Ops, Scalar
from aerobat.problem.planned_passage import PlannedPassage
from aerobat.simulation.passages.passage import Passage, bounding_ellipsoid, gate_places, passages
from aerobat.vehicle import Ellipsoid


class PlaceKernel(Protocol):
    """A kernel that follows a flight near one place, tick by tick: a module of `kernels.gates`."""

    def __hash__(self) -> int:
        """Return the hash by identity, so that a kernel's loop is compiled once."""

    def init(self, place: Tree, /) -> Tree:
        """Return the state before the first tick."""

    def step(self, ops: Ops, state: Tree, place: Tree, transition: Transition, /) -> Tree:
        """Return the state a tick later."""


class ScannedRow(NamedTuple):
    """A row of a log."""

    snapshot: Snapshot
    follows: Scalar  # 1 for a row after another, 0 for the first


def log_rows(times: Array, position: Array, velocity: Array, q_world_body: Array) -> Snapshot:
    """Return rows of a log as kernels read them, leaves (T,), from times (T,) and states (T, ·)."""
    return Snapshot(times, *map(components, (position, velocity, q_world_body)))


def scan_log(kernel: PlaceKernel, places: Sequence[Tree], rows: Snapshot) -> list[Tree]:
    """Return the final state of a kernel over a log, for each of some places, leaves (1,).

    Places with equally many numbers are processed together, as vehicles of a batch are.
    """
    row = ScannedRow(rows, np.minimum(np.arange(len(rows.time), dtype=np.float64), 1.0))
    found: dict[int, Tree] = {}
    alike = defaultdict(list)
    for k, place in enumerate(places):
        alike[len(tree_leaves(place))].append(k)
    for numbers in alike.values():
        parameters = tree_stack([places[k] for k in numbers], partial(np.array, dtype=np.float64))
        engine = choose("auto", len(numbers), len(rows.time))
        states = run_whole(engine, *_functions(kernel), parameters, row, log_stride=len(rows.time))
        for i, k in enumerate(numbers):
            found[k] = tree_map(itemgetter((slice(i, i + 1), -1)), states)
    return [found[k] for k in range(len(places))]


@lru_cache
def _functions(kernel: PlaceKernel) -> tuple[Init, Step]:
    """Return the loop over rows; its carry is the kernel's state and the previous row, its row the state."""

    def init(ops: Ops, place: Tree, row: ScannedRow) -> Tree:
        return kernel.init(place), row.snapshot

    def step(ops: Ops, place: Tree, carry: Tree, row: ScannedRow) -> tuple[Tree, Tree]:
        state, last = carry
        state = kernel.step(ops, state, place, Transition(last, row.snapshot, row.follows > 0.5, True))
        return (state, row.snapshot), state

    return init, step


def passages_in_log(
    rows: Snapshot, planned: Sequence[PlannedPassage], body: Ellipsoid | None, stop: Array
) -> tuple[Passage, ...]:
    """Return the passages of one logged flight, fields (1,).

    Args:
        rows: of its log.
        planned: the planned passages.
        body: the ellipsoid that encloses the vehicle; without it the clearance is unknown.
        stop: when the flight diverged [s], NaN where it did not, (1,).
    """
    found = scan_log(progress, gate_places(planned, bounding_ellipsoid(body)), rows)
    return tuple(passages(each, states, stop) for each, states in zip(planned, found, strict=True))
