"""The arrays that machine code reads and writes."""

from __future__ import annotations

from dataclasses import dataclass

ARRAYS = (
    "shared parameters",
    "parameters",
    "shared inputs",
    "inputs",
    "held inputs",
    "carry",
    "next carry",
    "outputs",
)
COUNTS = ("lanes", "ticks", "held rows", "log_stride", "begin", "end")


@dataclass(frozen=True)
class Layout:
    """Vehicles side by side, and which parameters and inputs are one number for all.

    Both functions take arrays of float64: shared parameters (s,), parameters (blocks, p, width), shared
    inputs (ticks, r + h), inputs (blocks, ticks, i, width), held inputs (blocks, held rows, width), carry and
    next carry (blocks, c, width), outputs (logged ticks, o, lanes). The last h columns of the shared inputs
    say where in a block of the held inputs the values of each `Held` begin at a tick.

    `scan` logs the first tick, each `log_stride` ticks after it, and the last; `init` reads the inputs of one
    tick and writes the next carry. The lanes `begin` to `end` are run, multiples of the width.
    """

    width: int
    shared_parameters: tuple[bool, ...]
    shared_inputs: tuple[bool, ...]
    held: tuple[int | None, ...]  # of each input, the `Held` that it stands in
    piecewise_constant: tuple[bool, ...]  # inputs that are shared, and at most ticks the same as before

    @property
    def own_inputs(self) -> int:
        """Inputs of each vehicle that are told at every tick."""
        return sum(not one and held is None for one, held in zip(self.shared_inputs, self.held, strict=True))

    @property
    def helds(self) -> int:
        """The number of `Held`s."""
        return len({*self.held} - {None})

    @property
    def shared_columns(self) -> int:
        """Of the shared inputs."""
        return sum(self.shared_inputs) + self.helds
