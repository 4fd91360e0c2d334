"""What an engine is: arithmetic, and a loop over time written in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from aerobat.engines.trees import Tree
from aerobat.kernels.ops import Ops

Init: TypeAlias = Callable[[Ops, Tree, Tree], Tree]
Step: TypeAlias = Callable[[Ops, Tree, Tree, Tree], tuple[Tree, Tree]]


class Scan(Protocol):
    """The loop over time."""

    def __call__(self, init: Init, step: Step, parameters: Tree, inputs: Tree) -> Tree:
        """Every output of `carry, output = step(ops, parameters, carry, input)`, one for each input row.

        The loop starts with carry = init(ops, parameters, first input row). Leaves of `parameters` are arrays
        (vehicles,); of `inputs` (ticks,), the same for all vehicles, or (ticks, vehicles); of the answer
        (vehicles, ticks).
        """


@dataclass(frozen=True)
class Engine:
    """One way to run kernels. All give the same numbers to rounding."""

    name: str
    scan: Scan
