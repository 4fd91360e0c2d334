"""Arrays for machine code: vehicles in blocks of lanes, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.engines.engine import Coded, Held
from aerobat.engines.pytree import Tree, tree_leaves, tree_map, tree_replace

ARRAYS = (
    "shared parameters",
    "parameters",
    "shared inputs",
    "inputs",
    "held inputs",
    "codes",
    "held codes",
    "table",
    "carry",
    "next carry",
    "outputs",
)
COUNTS = ("lanes", "ticks", "held inputs rows", "held codes rows", "log_stride", "begin", "end")
_DTYPES = {False: np.float64, True: np.uint16}  # dtypes of inputs, by whether they are coded


@dataclass(frozen=True)
class Layout:
    """Arrangement of the vehicles in lanes, and the parameters and inputs that all vehicles share.

    Both functions take arrays of float64: shared parameters (s,) and parameters (blocks, p, width); shared
    inputs (ticks, r + h), inputs (blocks, ticks, i, width) and held inputs (blocks, held rows, width); a
    table; carry and next carry (blocks, c, width), and outputs (logged ticks, o, lanes). Arrays of uint16
    hold the codes of `Coded` inputs, with the shapes of inputs and held inputs. The last h columns of the
    shared inputs are offsets: where, in a block of held inputs or codes, the values of each kind of `Held`
    begin at a tick.

    `scan` logs the first tick, every `log_stride`-th tick after it, and the last. `init` reads the inputs of
    one tick and writes the next carry. The lanes `begin` to `end`, multiples of the width, are run.
    """

    width: int
    shared_parameters: tuple[bool, ...]
    inputs: tuple[InputKind, ...]
    piecewise_constant: tuple[bool, ...]  # shared inputs that rarely change from tick to tick

    @cached_property
    def shared_inputs(self) -> tuple[bool, ...]:
        """True for inputs that are one number for all vehicles."""
        return tuple(kind.shared for kind in self.inputs)

    @cached_property
    def held_kinds(self) -> tuple[InputKind, ...]:
        """The kinds of held inputs that differ between vehicles."""
        return tuple(dict.fromkeys(k for k in self.inputs if k.held is not None and not k.shared))

    @property
    def shared_columns(self) -> int:
        """The number of columns of the shared inputs."""
        return sum(self.shared_inputs) + len(self.held_kinds)


class PackedInputs(NamedTuple):
    """Inputs of some ticks, in the order of the first arrays and counts of `Layout`."""

    arrays: tuple[NDArray[Any], ...]
    rows: tuple[int, int]  # rows of a block of lanes: of the held inputs, and of the held codes


@dataclass(frozen=True)
class InputKind:
    """The storage of an input."""

    shared: bool  # one number for all vehicles
    held: int | None = None  # the index of its `Held`, if any
    coded: bool = False  # whether it is an entry of the table


def input_kinds(inputs: Tree) -> tuple[InputKind, ...]:
    """Return the storage of each of a loop's inputs, given those of one tick."""
    helds = count()

    def coded(node: Coded) -> Tree:
        return tree_map(lambda _: InputKind(shared=False, coded=True), node.codes)

    def held(node: Held) -> Tree:
        number = next(helds)
        return tree_map(
            lambda leaf: replace(_kind(leaf), held=number), tree_replace(node.values, Coded, coded)
        )

    leaves = tree_leaves(tree_replace(tree_replace(inputs, Held, held), Coded, coded))
    return tuple(map(_kind, leaves))


def _kind(leaf: Any) -> InputKind:
    """Return the kind of a leaf of one tick, or the kind that replaces it."""
    return leaf if isinstance(leaf, InputKind) else InputKind(shared=np.ndim(leaf) == 0)


@dataclass(frozen=True)
class Packing:
    """Vehicles in the blocks of a layout."""

    layout: Layout
    vehicles: int

    @property
    def blocks(self) -> int:
        """The number of blocks of lanes; the last block is filled up with copies of the last vehicle."""
        return -(-self.vehicles // self.layout.width)

    @property
    def lanes(self) -> int:
        """The number of lanes of all blocks."""
        return self.blocks * self.layout.width

    def inputs(self, inputs: Tree, ticks: int) -> PackedInputs:
        """Return the packed inputs of `ticks` ticks, or of one tick without an axis of ticks."""
        nodes: list[Held] = []
        tables = [np.zeros(0)]

        def codes_of(node: Coded) -> Tree:
            tables.append(node.table)
            return node.codes

        def values_of(node: Held) -> Tree:
            nodes.append(node)
            return node.values

        leaves = tree_leaves(tree_replace(tree_replace(inputs, Held, values_of), Coded, codes_of))
        rows = [np.zeros(ticks, dtype=np.intp) if isinstance(node.row, tuple) else node.row for node in nodes]
        columns = [
            np.asarray(leaf)[rows[kind.held]] if kind.held is not None and np.ndim(leaf) else leaf
            for leaf, kind in zip(leaves, self.layout.inputs, strict=True)
            if kind.shared
        ]
        held, begins = self._held(leaves)
        for kind, begin in begins.items():
            columns.append(begin + self.layout.inputs.count(kind) * rows[kind.held or 0])
        shared = np.empty((ticks, len(columns)))
        for index, column in enumerate(columns):
            shared[:, index] = column
        plain, coded = (self._per_tick(leaves, ticks, are_codes) for are_codes in (False, True))
        arrays = (shared, plain, held[False], coded, held[True])
        return PackedInputs((*arrays, tables[-1]), (held[False].shape[1], held[True].shape[1]))

    def _per_tick(self, leaves: Sequence[Array], ticks: int, coded: bool) -> NDArray[Any]:
        """Return the inputs given at every tick, (blocks, ticks, leaf, width)."""
        chosen = self._of(leaves, InputKind(False, coded=coded))
        packed = np.empty((self.blocks, ticks, len(chosen), self.layout.width), _DTYPES[coded])
        self._fill(packed, chosen)
        return packed

    def _held(self, leaves: Sequence[Array]) -> tuple[dict[bool, NDArray[Any]], dict[InputKind, int]]:
        """Return held numbers and codes, (blocks, rows, width), and the first row of each kind."""
        sizes = {False: 0, True: 0}
        begins, chosen = {}, {}
        for kind in self.layout.held_kinds:
            chosen[kind] = self._of(leaves, kind)
            begins[kind] = sizes[kind.coded]
            sizes[kind.coded] += len(chosen[kind]) * len(chosen[kind][0])
        packed = {
            coded: np.empty((self.blocks, size, self.layout.width), _DTYPES[coded])
            for coded, size in sizes.items()
        }
        for kind, own in chosen.items():
            part = packed[kind.coded][:, begins[kind] : begins[kind] + len(own) * len(own[0])]
            self._fill(part.reshape(self.blocks, -1, len(own), self.layout.width), own)
        return packed, begins

    def _of(self, leaves: Sequence[Array], kind: InputKind) -> list[Array]:
        """Return the leaves (rows, vehicles) of one kind."""
        chosen = (leaf for leaf, own in zip(leaves, self.layout.inputs, strict=True) if own == kind)
        return [np.reshape(leaf, (-1, self.vehicles)) for leaf in chosen]

    def pad_lanes(self, leaves: Sequence[Array]) -> Array:
        """Return leaves (vehicles,) as (blocks, leaf, width)."""
        packed = np.empty((self.blocks, 1, len(leaves), self.layout.width))
        self._fill(packed, [leaf[None] for leaf in leaves])
        return packed[:, 0]

    def unpad_lanes(self, packed: Array) -> list[Array]:
        """Return the leaves (vehicles,) of an array (blocks, leaf, width)."""
        leaves = np.empty((packed.shape[1], self.lanes))
        leaves.reshape(-1, self.blocks, self.layout.width)[:] = packed.swapaxes(0, 1)
        return list(leaves[:, : self.vehicles])

    def _fill(self, packed: Array, leaves: Sequence[Array]) -> None:
        """Copy leaves (rows, vehicles) into an array (blocks, rows, leaf, lane)."""
        width = self.layout.width
        whole = self.vehicles // width
        full = whole * width
        # all lanes of a block are copied as one item
        lanes = np.dtype((np.void, width * packed.itemsize))
        for index, leaf in enumerate(leaves):
            blocks = np.ascontiguousarray(leaf[:, :full], packed.dtype).view(lanes)
            packed.view(lanes)[:whole, :, index, 0] = blocks.T
            if full < self.vehicles:
                packed[whole, :, index, : self.vehicles - full] = leaf[:, full:]
                packed[whole, :, index, self.vehicles - full :] = leaf[:, -1:]
