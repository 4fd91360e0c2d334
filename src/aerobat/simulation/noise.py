"""Errors of the state that the controller sees: a stand-in for an observer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from aerobat import so3
from aerobat.declaration import NonNegative, declared, validated
from aerobat.engines.components import components, from_components
from aerobat.kernels.rigid_body import Body
from aerobat.states import BodyState

_SKIPPED = 16  # ticks drawn at once to get past them


def bodies(state: BodyState) -> Body:
    """A state with leaves of components."""
    return Body(*(components(part) for part in vars(state).values()))


def body_states(body: Body) -> BodyState:
    """The inverse of `bodies`."""
    return BodyState(*(from_components(part) for part in body))


@declared
class StateNoise:
    """Standard deviations of white errors, each axis and each control period anew."""

    position: NonNegative = 0.0  # [m]
    velocity: NonNegative = 0.0  # [m/s]
    attitude: NonNegative = 0.0  # [rad] about each body axis
    omega: NonNegative = 0.0  # [rad/s]

    @classmethod
    def fused(cls) -> StateNoise:
        """Errors that a filter leaves of motion capture (1 mm, 100 Hz) and a gyro (1e-3 rad/s/√Hz)."""
        return cls(position=0.001, velocity=0.011, attitude=0.002, omega=0.016)

    @validated
    def scaled(self, factor: NonNegative) -> StateNoise:
        """All errors `factor` times as large. Raises SpecError for a negative factor."""
        return StateNoise(*(factor * getattr(self, field.name) for field in fields(self)))

    def drawn(self, generators: Sequence[np.random.Generator], ticks: int) -> BodyState:
        """Errors of every tick and vehicle, one generator a vehicle, (ticks, vehicles, ·).

        The attitude's are rotations in body axes.
        """
        normal = np.stack([rng.standard_normal((ticks, 12)) for rng in generators], axis=1)
        position, velocity, attitude, omega = np.split(normal, 4, axis=-1)
        return BodyState(
            self.position * position,
            self.velocity * velocity,
            so3.exp(self.attitude * attitude),
            self.omega * omega,
        )


class NoiseSource:
    """Errors of a flight's states, drawn on demand: any cuts into chunks give the same.

    Vehicle k of a batch draws from `SeedSequence(seed, spawn_key=(k,))`, one alone from the seed itself.
    """

    per_vehicle = True

    def __init__(self, noise: StateNoise, seed: int | np.random.SeedSequence, vehicles: int | None) -> None:
        """Seed the generators; `vehicles` is None for one alone."""
        root = seed if isinstance(seed, np.random.SeedSequence) else np.random.SeedSequence(seed)
        self._noise = noise
        self._seeds = [root]
        if vehicles is not None:
            keys = [(*root.spawn_key, k) for k in range(vehicles)]
            self._seeds = [np.random.SeedSequence(root.entropy, spawn_key=key) for key in keys]
        self._restart()

    def chunk(self, begin: int, end: int) -> Body:
        """Errors of the ticks from `begin` to before `end`, leaves (ticks, vehicles)."""
        if begin < self._position - 1:
            self._restart()
        while self._position < begin:  # passed over, in bounded memory
            self._draw(min(begin - self._position, _SKIPPED))
        if self._position == begin:
            return bodies(self._draw(end - begin))
        return bodies(self._prepended(end - begin - 1))

    def _prepended(self, ticks: int) -> BodyState:
        """The last tick drawn and so many more."""
        last = vars(self._last)
        more = vars(self._draw(ticks))
        return BodyState(**{name: np.concatenate([last[name], more[name]]) for name in last})

    def _draw(self, ticks: int) -> BodyState:
        self._position += ticks
        errors = self._noise.drawn(self._generators, ticks)
        if ticks:
            self._last = BodyState(**{name: part[-1:].copy() for name, part in vars(errors).items()})
        return errors

    def _restart(self) -> None:
        self._generators = [np.random.default_rng(seed) for seed in self._seeds]
        self._position = 0
