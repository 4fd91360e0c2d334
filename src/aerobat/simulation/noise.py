"""Errors of the state that the controller sees: a stand-in for an observer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from aerobat import so3
from aerobat.arrays import frozen
from aerobat.errors import SpecError
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import add, multiply
from aerobat.states import BodyState


@dataclass(frozen=True)
class StateNoise:
    """Standard deviations of white errors, each axis and each control period anew.

    Raises SpecError for a negative one.
    """

    position: float = 0.0  # [m]
    velocity: float = 0.0  # [m/s]
    attitude: float = 0.0  # [rad] about each body axis
    omega: float = 0.0  # [rad/s]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = float(frozen(getattr(self, field.name), f"noise.{field.name}", ()))
            if value < 0.0:
                raise SpecError(f"noise.{field.name} must be zero or more, got {value:g}")

    @classmethod
    def fused(cls) -> StateNoise:
        """What an error-state filter leaves of motion capture (1 mm, 100 Hz) and a gyro (1e-3 rad/s/√Hz)."""
        return cls(position=0.001, velocity=0.011, attitude=0.002, omega=0.016)

    def scaled(self, factor: float) -> StateNoise:
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


def observed(body: Body, error: Body) -> Body:
    """The body as the controller sees it at one tick."""
    return Body(
        add(body.position, error.position),
        add(body.velocity, error.velocity),
        multiply(body.q_world_body, error.q_world_body),
        add(body.omega_body, error.omega_body),
    )
