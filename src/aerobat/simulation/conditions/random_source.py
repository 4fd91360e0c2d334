"""Random numbers along flights, drawn on demand, each vehicle's from a generator of its own.

A standard normal is the quantile of 16 random bits, as many as a sensor's converter has: half the cost of
NumPy's own, of which a flight with an IMU takes ten thousand, and the same with every version of NumPy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray

from aerobat.arrays import Array, frozen
from aerobat.engines.engine import Held
from aerobat.engines.pytree import Tree

Words: TypeAlias = NDArray[np.uint16]

_LEVELS = 2**16
_WORDS_AT_ONCE = 4  # 16-bit words in a number of the generator
_TOGETHER = 64  # vehicles whose words are turned at once, so that they stay in a cache


class RandomSource:
    """Standard normals and uniform numbers of a component that steps at every so many ticks.

    They are drawn in blocks of samples that begin at multiples of their size, so that any cuts of the ticks
    into chunks, in any order, give the same bits, and only for ticks at which the component steps.
    """

    def __init__(
        self,
        seeds: Sequence[ISeedSequence],
        *,
        normals: int,
        uniforms: int = 0,
        period: int = 1,
        block: int = 256,
    ) -> None:
        """Prepare to draw.

        Args:
            seeds: of each vehicle.
            normals: standard normals a sample.
            uniforms: numbers in (0, 1) a sample.
            period: ticks from one sample to the next.
            block: samples drawn at once, a multiple of 4.
        """
        self._seeds = seeds
        self._normals = normals
        self._words = normals + 2 * uniforms
        self._period = period
        self._size = block
        self._restart()

    def inputs(self, begin: int, end: int, arrange: Callable[[Array], Tree]) -> Tree:
        """Inputs of the ticks from `begin` to before `end`, held from one sample to the next.

        `arrange` makes a tree of numbers (numbers, samples, vehicles), normals first.
        """
        first = begin // self._period
        numbers = arrange(self._samples(first, (end - 1) // self._period + 1))
        return numbers if self._period == 1 else Held(np.arange(begin, end) // self._period - first, numbers)

    def _samples(self, begin: int, end: int) -> Array:
        blocks = [self._block(k) for k in range(begin // self._size, (end - 1) // self._size + 1)]
        words = blocks[0] if len(blocks) == 1 else np.concatenate(blocks, axis=1)
        offset = begin // self._size * self._size
        words = words[:, begin - offset : end - offset]
        high, low = words[self._normals :: 2], words[self._normals + 1 :: 2]
        numbers = np.empty((self._normals + len(high), *words.shape[1:]))
        _quantiles().take(
            words[: self._normals], out=numbers[: self._normals], mode="clip"
        )  # quicker, checks less
        numbers[self._normals :] = (high + (low + 0.5) / _LEVELS) / _LEVELS
        return numbers

    def _block(self, number: int) -> Words:
        """Random words (words, samples, vehicles) of a block."""
        if number < self._latest:
            self._restart()
        while self._latest < number:
            self._draw()
        return self._drawn

    def _draw(self) -> None:
        count = self._words * self._size
        drawn = np.empty((len(self._generators), count // _WORDS_AT_ONCE), dtype="<u8")
        for own, generator in zip(drawn, self._generators, strict=True):
            own[:] = generator.random_raw(len(own))
        turned = np.empty((count, len(drawn)), dtype=np.uint16)
        for first in range(0, len(drawn), _TOGETHER):
            turned[:, first : first + _TOGETHER] = drawn[first : first + _TOGETHER].view("<u2").T
        self._drawn: Words = turned.reshape(self._words, self._size, -1)
        self._latest += 1

    def _restart(self) -> None:
        self._generators = [np.random.SFC64(seed) for seed in self._seeds]  # type: ignore[arg-type]  # NumPy's fastest
        self._latest = -1


@cache
def _quantiles() -> Array:
    """Of the standard normal, in the middles of equally likely intervals, scaled to a variance of 1."""
    from scipy.special import ndtri

    middles = ndtri((np.arange(_LEVELS) + 0.5) / _LEVELS)
    return frozen(middles / np.sqrt(np.mean(middles**2)), "quantiles")
