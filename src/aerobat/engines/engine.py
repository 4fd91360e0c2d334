"""What an engine is: arithmetic, and a loop over time written in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from aerobat.engines.trees import Tree
from aerobat.kernels.ops import Ops

Init: TypeAlias = Callable[[Ops, Tree, Tree], Tree]
Step: TypeAlias = Callable[[Ops, Tree, Tree, Tree], tuple[Tree, Tree]]


class Scan(Protocol):
    """The loop over time."""

    def __call__(self, init: Init, step: Step, parameters: Tree, inputs: Tree, every: int = 1) -> Tree:
        """The outputs of `carry, output = step(ops, parameters, carry, input)`, a step for each input row.

        The loop starts with carry = init(ops, parameters, first input row). Leaves of `parameters` are arrays
        (vehicles,); of `inputs` (ticks,), the same for all vehicles, or (ticks, vehicles); of the answer
        (vehicles, rows told): those of the first tick, of each `every` ticks after it, and of the last.
        """


def told(ticks: int, every: int) -> NDArray[np.intp]:
    """The ticks whose outputs a scan tells."""
    return np.unique(np.append(np.arange(0, ticks, every), ticks - 1))


@dataclass(frozen=True)
class Engine:
    """One way to run kernels. All give the same numbers to rounding."""

    name: str
    scan: Scan
