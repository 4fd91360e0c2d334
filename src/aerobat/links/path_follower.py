"""Attitude, rates and thrust that keep a vehicle on a plan, from delayed telemetry.

This is the outer loop of the tracking controller, run where the plan is. An observed state is compared with
the set-point of its own instant. The error is then predicted to the arrival time of the command, from the
feedback commanded meanwhile (Smith predictor: e'' = -a). Thus the link's delay does not reduce the damping.
"""

from __future__ import annotations

from collections import deque

from aerobat.control.parameters import controller_parameters
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.environment import Environment
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.control_loops import (
    PositionLoopState,
    ReferencePoint,
    attitude_command,
    init_position_loop,
    step_position_loop,
    thrust_demand,
)
from aerobat.kernels.ops import Vector
from aerobat.kernels.quaternions import axes, to_body
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import add_scaled, norm, subtract
from aerobat.links.goals import AttitudeGoal, Observed
from aerobat.links.stream import SetpointStream
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet


class PathFollower:
    """The outer loop of a vehicle's tracking controller along a stream of set-points."""

    def __init__(self, stream: SetpointStream, vehicle: Vehicle, environment: Environment) -> None:
        """Prepare to follow.

        Args:
            stream: the set-points.
            vehicle: the nominal vehicle, whose gains are used.
            environment: of the flight.
        """
        model = controller_parameters(vehicle.controller, Fleet.of([vehicle]), environment)
        self._model: ControllerModel = first_numbers(model)
        self._stream = stream
        self._outer: PositionLoopState | None = None
        self._commanded: deque[tuple[float, Vector]] = deque()  # [s] start time, [m/s²] feedback

    def command(self, time: float, observed: Observed) -> AttitudeGoal:
        """Return the goal at a time, from the last state of the vehicle; times are since the start [s]."""
        reference = self._stream.at(time)
        model, body = self._model, self._predicted(time, observed, reference)
        if self._outer is None:
            self._outer = init_position_loop(FloatOps, model.gains, body, reference)
        elif (elapsed := time - self._commanded[-1][0]) > 0.0:
            self._outer = step_position_loop(FloatOps, model.gains, self._outer, body, reference, elapsed)
        self._commanded.append((time, self._outer.acceleration))
        demand = thrust_demand(model.airframe.mass_properties, model.environment, reference)
        attitude = attitude_command(FloatOps, self._outer, demand, reference)
        return AttitudeGoal(
            attitude.q_world_body,
            to_body(axes(attitude.q_world_body), attitude.omega),
            model.airframe.mass_properties.mass * norm(FloatOps, attitude.specific_thrust),
        )

    def _predicted(self, time: float, observed: Observed, reference: ReferencePoint) -> Body:
        """Return the body at a time, predicted from the observed error and the feedback since then."""
        observed_at, body = observed
        then = self._stream.at(observed_at)
        position = subtract(then.position, body.position)
        velocity = subtract(then.velocity, body.velocity)
        while len(self._commanded) > 1 and self._commanded[1][0] <= observed_at:
            self._commanded.popleft()
        ends = [*(begin for begin, _ in self._commanded), time][1:]
        reached = observed_at
        for (_, acceleration), end in zip(self._commanded, ends, strict=False):
            step = max(min(end, time) - reached, 0.0)
            position = add_scaled(add_scaled(position, step, velocity), -0.5 * step**2, acceleration)
            velocity = add_scaled(velocity, -step, acceleration)
            reached += step
        position = add_scaled(position, time - reached, velocity)
        return body._replace(
            position=subtract(reference.position, position), velocity=subtract(reference.velocity, velocity)
        )
