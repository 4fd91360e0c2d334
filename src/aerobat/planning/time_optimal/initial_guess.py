"""A trajectory of another planner as a motion on a mesh, for the solver to begin with."""

from __future__ import annotations

import numpy as np

from aerobat.environment import Environment
from aerobat.flatness import reference
from aerobat.planning.time_optimal.collocation import CollocatedMotion, Mesh
from aerobat.planning.warm_start import WarmStart
from aerobat.vehicle import Vehicle


def initial_guess(
    guess: WarmStart, mesh: Mesh, vehicle: Vehicle, environment: Environment
) -> CollocatedMotion:
    """What the vehicle does along a guess at the mesh's nodes, by flatness; inputs within their scale."""
    knots = np.concatenate([[0.0], np.cumsum(guess.phases @ mesh.shares)])
    times = np.minimum(knots, guess.trajectory.duration)
    asked = reference(guess.trajectory, vehicle, times, environment=environment).setpoint
    flat, rates = asked.flat, asked.omega_body[:, :2]
    states = np.concatenate([flat.position, flat.velocity, asked.q_world_body, rates], axis=1).T
    inputs = np.concatenate([asked.wrench.thrust[:, None], asked.omega_dot_body[:, :2]], axis=1).T
    most = 2.0 * mesh.input_scale[:, None]
    inputs = np.clip(inputs, -most, most)
    return CollocatedMotion(guess.phases, states, inputs[:, :-1], inputs[:, 1:])
