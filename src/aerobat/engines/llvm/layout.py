"""The arrays that machine code reads and writes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from aerobat.engines.llvm.packing import InputKind

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


@dataclass(frozen=True)
class Layout:
    """Vehicles side by side, and which parameters and inputs are one number for all.

    Both functions take arrays of float64: shared parameters (s,) and parameters (blocks, p, width); shared
    inputs (ticks, r + h), inputs (blocks, ticks, i, width) and held inputs (blocks, held rows, width); a
    table; carry and next carry (blocks, c, width), and outputs (logged ticks, o, lanes). Arrays of uint16
    hold the codes of what is `Coded`, shaped as inputs and held inputs are. The last h columns of the shared
    inputs say where in a block of the held inputs or codes the values of each kind of `Held` begin at a tick.

    `scan` logs the first tick, each `log_stride` ticks after it, and the last; `init` reads the inputs of one
    tick and writes the next carry. The lanes `begin` to `end` are run, multiples of the width.
    """

    width: int
    shared_parameters: tuple[bool, ...]
    inputs: tuple[InputKind, ...]
    held_kinds: tuple[InputKind, ...]
    piecewise_constant: tuple[bool, ...]  # inputs that are shared, and at most ticks the same as before

    @cached_property
    def shared_inputs(self) -> tuple[bool, ...]:
        """True for inputs that are one number for all vehicles."""
        return tuple(kind.shared for kind in self.inputs)

    @property
    def shared_columns(self) -> int:
        """Of the shared inputs."""
        return sum(self.shared_inputs) + len(self.held_kinds)
