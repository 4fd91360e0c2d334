"""Arrays as machine code reads them: vehicles in blocks of lanes, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.engine import Held
from aerobat.engines.pytree import Tree, tree_leaves, tree_map, tree_replace


class PackedInputs(NamedTuple):
    """Inputs of some ticks; see `layout.Layout`."""

    shared: Array
    own: Array
    held: Array
    held_rows: int  # of a block of lanes


@dataclass(frozen=True)
class Packing:
    """Where the leaves of a loop's inputs go."""

    vehicles: int
    width: int
    shared: tuple[bool, ...]  # of each input: one number for all vehicles
    held: tuple[int | None, ...]  # of each input: the `Held` that it stands in

    @classmethod
    def of(cls, inputs: Tree, vehicles: int, width: int) -> Packing:
        """The packing of inputs like those of one tick."""
        nodes: list[Held] = []

        def numbered(held: Held) -> Tree:
            nodes.append(held)
            return tree_map(lambda _: _Number(len(nodes) - 1), held.values)

        numbers = tree_leaves(tree_replace(inputs, Held, numbered))
        held = (leaf.value if isinstance(leaf, _Number) else None for leaf in numbers)
        return cls(vehicles, width, tuple(np.ndim(leaf) == 0 for leaf in tree_leaves(inputs)), tuple(held))

    @property
    def blocks(self) -> int:
        """Blocks of lanes, the last one of them filled up with copies of the last vehicle."""
        return -(-self.vehicles // self.width)

    @property
    def lanes(self) -> int:
        """Of all blocks."""
        return self.blocks * self.width

    def inputs(self, inputs: Tree, ticks: int) -> PackedInputs:
        """Inputs of so many ticks, or without an axis of ticks those of one."""
        nodes: list[Held] = []

        def noted(held: Held) -> Tree:
            nodes.append(held)
            return held.values

        leaves = tree_leaves(tree_replace(inputs, Held, noted))
        rows = [np.zeros(ticks, dtype=np.intp) if isinstance(node.row, tuple) else node.row for node in nodes]
        columns = [
            np.asarray(leaf)[rows[number]] if number is not None and np.ndim(leaf) else leaf
            for leaf, number in compress(zip(leaves, self.held, strict=True), self.shared)
        ]
        groups = [self._of_vehicles(leaves, number) for number in range(len(nodes))]
        begins = np.cumsum([0, *(len(group) * len(group[0]) if group else 0 for group in groups)]).tolist()
        held = np.empty((self.blocks, begins[-1], self.width))
        for group, row, begin, end in zip(groups, rows, begins, begins[1:], strict=False):
            columns.append(begin + len(group) * row)
            if group:
                self._fill(held[:, begin:end].reshape(self.blocks, -1, len(group), self.width), group)
        own = self._of_vehicles(leaves, None)
        packed = np.empty((self.blocks, ticks, len(own), self.width))
        self._fill(packed, own)
        shared = np.empty((ticks, len(columns)))
        for index, column in enumerate(columns):
            shared[:, index] = column
        return PackedInputs(shared, packed, held, begins[-1])

    def _of_vehicles(self, leaves: Sequence[Array], number: int | None) -> list[Array]:
        """The leaves (rows, vehicles) that stand in a certain Held, or in none."""
        places = zip(leaves, self.shared, self.held, strict=True)
        chosen = (leaf for leaf, shared, held in places if not shared and held == number)
        return [np.reshape(leaf, (-1, self.vehicles)) for leaf in chosen]

    def pad_lanes(self, leaves: Sequence[Array]) -> Array:
        """Leaves (vehicles,) as (blocks, leaf, width)."""
        packed = np.empty((self.blocks, 1, len(leaves), self.width))
        self._fill(packed, [leaf[None] for leaf in leaves])
        return packed[:, 0]

    def unpad_lanes(self, packed: Array) -> list[Array]:
        """The leaves (vehicles,) of (blocks, leaf, width)."""
        leaves = np.empty((packed.shape[1], self.lanes))
        leaves.reshape(-1, self.blocks, self.width)[:] = packed.swapaxes(0, 1)
        return list(leaves[:, : self.vehicles])

    def _fill(self, packed: Array, leaves: Sequence[Array]) -> None:
        """Leaves (rows, vehicles) into an array (blocks, rows, leaf, lane)."""
        whole = self.vehicles // self.width
        full = whole * self.width
        for index, leaf in enumerate(leaves):
            blocks = leaf[:, :full].reshape(len(leaf), whole, self.width)
            packed[:whole, :, index] = blocks.swapaxes(0, 1)
            if full < self.vehicles:
                packed[whole, :, index, : self.vehicles - full] = leaf[:, full:]
                packed[whole, :, index, self.vehicles - full :] = leaf[:, -1:]


@dataclass(frozen=True)
class _Number:
    value: int
