"""A start of the program: a motion, and states and inputs along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.flatness import reference
from aerobat.limits.body_in_gate import BodyInGate
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart
from collocation.optimal_control.collocation import CollocatedMotion, CollocationMesh

MIN_INTERVALS = 4  # of a phase


@dataclass(frozen=True, eq=False)
class Start:
    """A motion to begin from, whether it is kept in its plane, and where it comes from."""

    guess: WarmStart
    plane: Array | None  # the normal of the plane that is kept, (3,)
    aside: Array  # [m] by which positions are moved halfway, less before and after, (3,)
    origin: str
    in_gates: tuple[BodyInGate, ...] = ()  # those that the stages of `guess` cross


def initial_motion(start: Start, mesh: CollocationMesh, task: Task) -> CollocatedMotion:
    """States and inputs of the vehicle along a start at the mesh's nodes, inputs within twice their scale.

    Args:
        start: The motion to begin from.
        mesh: Its phases and nodes.
        task: Its environment and its vehicle count.
    """
    environment, guess = task.environment, start.guess
    times = np.concatenate([[0.0], np.cumsum(mesh.durations(guess.phases))])
    times = np.minimum(times, guess.trajectory.duration)
    setpoint = reference(guess.trajectory, task.vehicle, times, environment=environment).setpoint
    flat = setpoint.flat
    thrust = task.balance.specific_thrust(flat.velocity, flat.acceleration)
    attitude, turning = setpoint.q_world_body, (setpoint.omega_body, setpoint.omega_dot_body)
    rates, accelerations = (vectors[:, :2] for vectors in turning)
    place = flat.position + np.sin(np.pi * times / times[-1])[:, None] * start.aside
    states = np.concatenate([place, flat.velocity, attitude, rates], axis=1).T
    norm = np.linalg.norm(thrust, axis=-1)[:, None]
    inputs = np.concatenate([norm, accelerations], axis=1).T
    bound = 2.0 * mesh.input_scale[:, None]
    inputs = np.clip(inputs, -bound, bound)
    return CollocatedMotion(guess.phases, states, inputs[:, :-1], inputs[:, 1:])


def allocate_intervals(guess: WarmStart, intervals: int, minimum: int) -> tuple[int, ...]:
    """About so many intervals, allocated to phases by their durations, to each at least the minimum."""
    counts = np.rint(intervals * guess.phases / guess.trajectory.duration).astype(int)
    return tuple(np.maximum(counts, minimum).tolist())
