"""Random numbers along flights, drawn on demand, each vehicle's from a generator of its own.

A standard normal is the quantile of 16 random bits, as many as a sensor's converter has: half the cost of
NumPy's own, of which a flight with an IMU takes ten thousand, and the same with every version of NumPy.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from aerobat.arrays import Array, frozen

_LEVELS = 2**16
_WORDS_AT_ONCE = 4  # 16-bit words in a number of the generator


class RandomSource:
    """Standard normals and uniform numbers of a component that steps at every so many ticks.

    They are drawn in blocks of samples that begin at multiples of their size, so that any cuts of the ticks
    into chunks, in any order, give the same bits, and only for ticks at which the component steps: between
    them stand those of its last step.
    """

    def __init__(
        self,
        seeds: Sequence[np.random.SeedSequence],
        *,
        normals: int,
        uniforms: int = 0,
        period: int = 1,
        block: int = 64,
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

    def rows(self, begin: int, end: int) -> Array:
        """Numbers of the ticks from `begin` to before `end`, normals first, (numbers, ticks, vehicles)."""
        first, last = begin // self._period, (end - 1) // self._period
        blocks = [self._block(k) for k in range(first // self._size, last // self._size + 1)]
        samples = blocks[0] if len(blocks) == 1 else np.concatenate(blocks, axis=1)
        offset = first // self._size * self._size
        samples = samples[:, first - offset : last + 1 - offset]
        if self._period == 1:
            return samples
        ticks = np.repeat(samples, self._period, axis=1)
        return ticks[:, begin - first * self._period : end - first * self._period]

    def _block(self, number: int) -> Array:
        if number < self._latest:
            self._restart()
        while self._latest < number:
            self._draw()
        return self._drawn

    def _draw(self) -> None:
        count = self._words * self._size // _WORDS_AT_ONCE
        drawn = np.empty((len(self._generators), count), dtype="<u8")
        for own, generator in zip(drawn, self._generators, strict=True):
            own[:] = generator.random_raw(count)
        words = np.ascontiguousarray(drawn.view("<u2").T).reshape(self._words, self._size, -1)
        normals = _quantiles()[words[: self._normals]]
        if self._words > self._normals:
            high, low = words[self._normals :: 2], words[self._normals + 1 :: 2]
            normals = np.concatenate([normals, (high + (low + 0.5) / _LEVELS) / _LEVELS])
        self._drawn: Array = normals
        self._latest += 1

    def _restart(self) -> None:
        self._generators = [np.random.SFC64(seed) for seed in self._seeds]  # NumPy's fastest
        self._latest = -1


@cache
def _quantiles() -> Array:
    """Of the standard normal, in the middles of equally likely intervals, scaled to a variance of 1."""
    from scipy.special import ndtri

    middles = ndtri((np.arange(_LEVELS) + 0.5) / _LEVELS)
    return frozen(middles / np.sqrt(np.mean(middles**2)), "quantiles")
