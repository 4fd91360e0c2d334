"""Random numbers along flights, drawn on demand, each vehicle's from a generator of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aerobat.arrays import Array

_TOGETHER = 64  # vehicles whose numbers are turned at once, so that they stay in a cache


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
            uniforms: numbers in [0, 1) a sample.
            period: ticks from one sample to the next.
            block: samples drawn at once.
        """
        self._seeds = seeds
        self._normals = normals
        self._numbers = normals + uniforms
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
        drawn = np.empty((self._numbers, self._size, len(self._seeds)))
        for first in range(0, len(self._seeds), _TOGETHER):
            generators = self._generators[first : first + _TOGETHER]
            own = np.empty((len(generators), self._numbers, self._size))
            for numbers, generator in zip(own, generators, strict=True):
                generator.standard_normal(out=numbers[: self._normals])
                if self._normals < self._numbers:
                    generator.random(out=numbers[self._normals :])
            drawn[..., first : first + _TOGETHER] = own.transpose(1, 2, 0)
        self._drawn = drawn
        self._latest += 1

    def _restart(self) -> None:
        self._generators = [np.random.Generator(np.random.SFC64(seed)) for seed in self._seeds]  # the fastest
        self._latest = -1
