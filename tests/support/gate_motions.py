"""Bodies that move through gates: turning and accelerating, or cruising straight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.problem.planned_passage import PlannedPassage
from aerobat.simulation.passages import log_rows, passages_in_log

RATE = 500.0  # [1/s] as flights are logged
CROSSING = 0.5  # [s]
SPEED = 4.0  # [m/s]
CRUISE = ab.Trajectory([2.0], [[[0.0, 0, 1], [2 * SPEED, 0, 0]]])  # along x, through the gate at 1 s


@dataclass(frozen=True)
class Motion:
    """A body that flies through a gate at CROSSING, accelerating and turning."""

    gate: ab.Gate
    body: ab.Ellipsoid
    offset: Array  # [m] from the opening's centre then
    velocity: Array  # [m/s] then
    acceleration: Array  # [m/s²]
    attitude: Array  # then
    omega_body: Array  # [rad/s]

    def states(self, times: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and attitudes."""
        t = (times - CROSSING)[:, None]
        position = self.gate.position + self.offset + t * self.velocity + t**2 / 2 * self.acceleration
        attitude = so3.multiply(self.attitude, so3.exp(t * self.omega_body))
        return position, self.velocity + t * self.acceleration, attitude

    def passage(self, rate: float = RATE) -> ab.Passage:
        """Its passage, logged at a rate [1/s]."""
        times = np.arange(0.0, 1.0, 1 / rate) + 0.3 / rate
        planned = PlannedPassage(self.gate, CROSSING, self.gate.up)
        rows = log_rows(times, *self.states(times))
        return passages_in_log(rows, (planned,), self.body, np.array([np.nan]))[0].of_flight(0)


def motion(seed: int, speed: tuple[float, float] = (2.0, 10.0)) -> Motion:
    """A random one, never far from the gate's direction."""
    rng = np.random.default_rng(seed)
    heading, elevation, tilt = rng.uniform(-1.2, 1.2, 3)
    gate = ab.tilted_gate(rng.normal(size=3), heading, elevation, tilt, *rng.uniform(0.5, 1.5, 2))
    semi_axes = rng.uniform(0.03, 0.3, 3)
    along = gate.normal + 0.5 * (rng.uniform(-1, 1) * gate.lateral + rng.uniform(-1, 1) * gate.up)
    in_plane = 0.3 * (rng.uniform(-1, 1) * gate.lateral + rng.uniform(-1, 1) * gate.up)
    return Motion(
        gate,
        ab.Ellipsoid(semi_axes, 0.4 * semi_axes * rng.uniform(-1, 1, 3)),
        in_plane,
        rng.uniform(*speed) * along,
        rng.uniform(-3, 3, 3),
        so3.exp(rng.normal(size=3)),
        rng.uniform(-8, 8, 3),
    )


def cruise(height: float = 1.0) -> tuple[ab.Trajectory, ab.Problem]:
    """4 m/s along x through a gate at 0.5 s, whose centre may lie elsewhere in height."""
    gate = ab.tilted_gate((2.0, 0.0, height), width=1.0, height=0.3)
    problem = ab.Problem("cruise", ab.at_rest((0, 0, 1)), ab.at_rest((4, 0, 1)), gates=(gate,))
    return ab.Trajectory([1.0], [[[0.0, 0, 1], [4.0, 0, 0]]]), problem
