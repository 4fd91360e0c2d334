"""Random numbers along flights, drawn on demand, for each vehicle from a generator of its own.

A standard normal is the quantile of 16 random bits, the resolution of a sensor's converter. This takes half
the time of NumPy's normals, of which a flight with an IMU draws ten thousand, and is the same with every
version of NumPy.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from functools import cache
from itertools import repeat
from typing import TypeAlias

import numpy as np
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray

from aerobat.arrays import Array, frozen
from aerobat.engines.engine import Coded, Held
from aerobat.engines.pytree import Tree, tree_leaves, tree_map

Words: TypeAlias = NDArray[np.uint16]

_LEVELS = 2**16
_WORDS_PER_NUMBER = 4  # 16-bit words in one 64-bit number of the generator
_VEHICLES_PER_BLOCK = 128  # vehicles whose words are transposed at once, so that they stay in a cache
_ROW_PADDING = 8  # [64-bit numbers] between vehicles' rows: rows a power of two apart conflict in a cache
_SAMPLES_PER_DRAW = 256  # samples of a vehicle: one call of its generator costs as much as some hundred words


class InputNumber(Enum):
    """The numbers that a leaf of a component's inputs stands for."""

    NORMAL = "standard normals"
    UNIFORM = "uniform numbers in (0, 1)"
    TIME = "times of the samples [s]"


class RandomSource:
    """Random inputs of a component that steps every `period` ticks.

    The numbers are drawn in blocks of samples that begin at multiples of the block size, so that any cuts of
    ticks, in any order, give the same bits. Only ticks at which the component steps draw numbers.
    """

    def __init__(
        self,
        seeds: Sequence[ISeedSequence],
        inputs: Tree,
        *,
        period: int = 1,
        block: int = 256,
        rate: float = 1.0,
    ) -> None:
        """Prepare the generators.

        Args:
            seeds: one for each vehicle.
            inputs: the component's inputs, with members of InputNumber as leaves.
            period: ticks from one sample to the next.
            block: samples whose numbers are consecutive in the generator's sequence, a multiple of 4.
            rate: of the ticks [1/s].
        """
        self._seeds = seeds
        self._inputs = inputs
        leaves = tree_leaves(inputs)
        self._normals = leaves.count(InputNumber.NORMAL)
        self._words = self._normals + 2 * leaves.count(InputNumber.UNIFORM)
        self._period, self._rate = period, rate
        self._size = block
        self._blocks = max(1, _SAMPLES_PER_DRAW // block)
        self._restart()

    def chunk(self, begin: int, end: int) -> Tree:
        """Return the inputs of the ticks from `begin` to before `end`, held from one sample to the next."""
        first = begin // self._period
        words = self._samples(first, (end - 1) // self._period + 1)
        high, low = words[self._normals :: 2], words[self._normals + 1 :: 2]
        numbers = {
            InputNumber.NORMAL: iter([Coded(word, _quantiles()) for word in words[: self._normals]]),
            InputNumber.UNIFORM: iter((high + (low + 0.5) / _LEVELS) / _LEVELS),
            InputNumber.TIME: repeat((first + np.arange(words.shape[1])) * self._period / self._rate),
        }
        samples = tree_map(lambda kind: next(numbers[kind]), self._inputs)
        return samples if self._period == 1 else Held(np.arange(begin, end) // self._period - first, samples)

    def _samples(self, begin: int, end: int) -> Words:
        """Return the random words (words, samples, vehicles) of some samples."""
        blocks = [self._block(k) for k in range(begin // self._size, (end - 1) // self._size + 1)]
        words = blocks[0] if len(blocks) == 1 else np.concatenate(blocks, axis=1)
        offset = begin // self._size * self._size
        return words[:, begin - offset : end - offset]

    def _block(self, number: int) -> Words:
        """Return the random words (words, samples, vehicles) of a block."""
        turn = number // self._blocks
        if turn < self._turn:
            self._restart()
        while self._turn < turn:
            self._draw()
        block: Words = self._drawn[number % self._blocks]
        return block

    def _draw(self) -> None:
        """Draw the next blocks of all vehicles; transpose the words of some vehicles while in the cache."""
        count, vehicles = self._blocks * self._words * self._size, len(self._generators)
        numbers = count // _WORDS_PER_NUMBER
        drawn = np.empty((min(_VEHICLES_PER_BLOCK, vehicles), numbers + _ROW_PADDING), dtype="<u8")
        turned = np.empty((count, vehicles), dtype=np.uint16)
        for first in range(0, vehicles, _VEHICLES_PER_BLOCK):
            together = self._generators[first : first + _VEHICLES_PER_BLOCK]
            for own, generator in zip(drawn, together, strict=False):
                own[:numbers] = generator.random_raw(numbers)
            turned[:, first : first + _VEHICLES_PER_BLOCK] = drawn[: len(together)].view("<u2")[:, :count].T
        self._drawn: Words = turned.reshape(self._blocks, self._words, self._size, vehicles)
        self._turn += 1

    def _restart(self) -> None:
        self._generators = [np.random.SFC64(seed) for seed in self._seeds]  # type: ignore[arg-type]  # NumPy's fastest
        self._turn = -1


@cache
def _quantiles() -> Array:
    """Return standard normal quantiles at the midpoints of equally likely intervals, scaled to variance 1."""
    from scipy.special import ndtri

    middles = ndtri((np.arange(_LEVELS) + 0.5) / _LEVELS)
    return frozen(middles / np.sqrt(np.mean(middles**2)), "quantiles")
