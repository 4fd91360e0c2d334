"""The reference for a trajectory by differential flatness: attitude, rates, moments, rotor thrusts.

The rates and the wrench are those of `inverse_dynamics`; `parallel_transport` carries the attitude along. A
vehicle with linear drag, of coefficients d across and d_z along body z, is differentially flat (Faessler,
Franchi, Scaramuzza, RA-L 2018).
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerobat import so3
from aerobat.arrays import Array, frozen, xyz
from aerobat.declaration import Angle, Positive, by_value, short, validated
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness.flyable import Planned, environment_of, vehicle_of
from aerobat.flatness.inverse_dynamics import (
    UNDETERMINED,
    body_rates,
    has_unequal_drag,
    lateral_drag,
    specific_thrust,
    wrench_for,
)
from aerobat.flatness.parallel_transport import TransportedFrames, frames
from aerobat.flatness.unequal_drag import (
    FrameAngle,
    UnequalDrag,
    body_attitudes,
    body_motion,
    nodes,
    resolved_pieces,
    trajectory_through,
)
from aerobat.kernels import flatness as kernel
from aerobat.states import FlatState, Setpoint, TimeInterval, Wrench
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.vehicle import Vehicle
from aerobat.vehicle.allocation import rotor_thrusts

QUINTIC = 5  # degree of the interpolant of the thrust between nodes
# parts of a segment whose thrust has a higher degree; the error of quintics falls with the length to the
# sixth
QUINTICS_PER_SEGMENT = 16


@short
@by_value
class Reference:
    """The state and the rotor thrusts that a trajectory requires, at every time of a series."""

    times: Array  # [s], (T,)
    setpoint: Setpoint  # leading axis T; an undetermined attitude is held, with zero rates
    rotor_thrusts: Array  # [N] required by flatness, not clipped to limits, (T, n)
    undetermined: tuple[TimeInterval, ...]  # intervals with almost zero |f|, also between samples

    def __str__(self) -> str:
        """Return a one-line summary."""
        thrusts = f"{self.rotor_thrusts.min():.2f} to {self.rotor_thrusts.max():.2f} N"
        return f"{len(self.times)} times to {self.times[-1]:.3f} s, rotors asked for {thrusts}"


@validated
def reference(
    trajectory: Trajectory | Planned,
    vehicle: Vehicle | str | None = None,
    times: ArrayLike | None = None,
    rate: Positive | None = None,
    environment: Environment | None = None,
) -> Reference:
    """Compute the reference of `vehicle` on `trajectory`, at `times`, or at `rate` and at the end.

    The initial attitude is the smallest rotation from upright to the thrust, turned about the thrust by the
    trajectory's heading. From there the attitude is carried along without spin, plus the trajectory's yaw, so
    it does not depend on the chosen times. SpecError is raised unless exactly one of times and rate is given,
    and the times rise within the trajectory.

    Args:
        trajectory: The path and its heading, or a plan.
        vehicle: The vehicle, or its name, by default the plan's; its limits do not matter here.
        times: Times [s], (T,), not falling.
        rate: Samples per second [1/s], instead of times.
        environment: Gravity and wind, by default the plan's; for a trajectory those of a calm day on Earth.
    """
    if (times is None) == (rate is None):
        raise SpecError("reference needs either times or a rate, not both")
    vehicle = vehicle_of(trajectory, vehicle)
    environment = environment_of(trajectory, environment)
    trajectory = as_trajectory(trajectory)
    times = _rising(trajectory.sample(rate) if rate is not None else times)
    flat = trajectory.flat(times)
    yaw = None if trajectory.yaw is None else trajectory.yaw_rates(times)
    if not has_unequal_drag(vehicle):
        path, at = _mean_frames(trajectory, vehicle, environment, times)
        return _assembled(times, flat, path, at, vehicle, environment, None, yaw)
    path, at, frame_angle = _unequal_frames(trajectory, vehicle, environment, times)
    return _assembled(times, flat, path, at, vehicle, environment, frame_angle.at(times), yaw)


@validated
def reference_of(
    times: ArrayLike,
    flat: FlatState,
    vehicle: Vehicle,
    environment: Environment | None = None,
    heading: Angle = 0.0,
) -> Reference:
    """Compute the reference of `vehicle` for a series of flat states, as `reference` does.

    Between samples the thrust is the quintic that fits both ends. Where a derivative jumps, give the time
    twice, with the states of both sides. SpecError is raised for falling times and shapes that differ.

    Args:
        times: Times [s], (T,), not falling.
        flat: Position to snap at these times, (T, 3) each.
        vehicle: The vehicle; its limits do not matter here.
        environment: Gravity and wind, by default those of a calm day on Earth.
        heading: Initial heading [rad], about the thrust axis.
    """
    environment = environment or Environment()
    times = _rising(times)
    parts = {field.name: getattr(flat, field.name) for field in fields(flat)}
    flat = FlatState(**{name: frozen(x, name, (len(times), 3)) for name, x in parts.items()})
    if any(series.ndim != 2 for series in vars(flat).values()):
        raise SpecError("the flat states must be one series, with a row for each time and no further axes")
    path = _frames(times, specific_thrust(flat, vehicle, environment), environment, heading)
    angle = None
    if has_unequal_drag(vehicle):
        angle = np.zeros(len(times))
        if times[-1] > times[0]:
            trajectory = trajectory_through(times, flat, heading)
            *_, frame_angle = _unequal_frames(trajectory, vehicle, environment, times[:0])
            angle = frame_angle.at(times - times[0])
    return _assembled(times, flat, path, path.samples, vehicle, environment, angle)


def _nodes_for_quintics(trajectory: Trajectory, vehicle: Vehicle) -> list[float]:
    """Return normalised times inside segments between which a quintic approximates the thrust.

    The list is empty where the thrust has degree 5 or less.
    """
    degree = trajectory.degree - (1 if lateral_drag(vehicle) > 0.0 else 2)
    return [] if degree <= QUINTIC else np.linspace(0.0, 1.0, QUINTICS_PER_SEGMENT + 1)[1:-1].tolist()


def _mean_frames(
    trajectory: Trajectory, vehicle: Vehicle, environment: Environment, times: Array
) -> tuple[TransportedFrames, NDArray[np.intp]]:
    """Return the frames along the mean-drag thrust, and the indices of `times` (T,) among their nodes."""
    flat = trajectory.flat(times)
    # both sides of every knot and the nodes that quintics need are added; the times use the later side of a
    # knot
    inner = _nodes_for_quintics(trajectory, vehicle)
    parts = [1.0, 0.0, *inner]
    curve = [FlatState(*(trajectory.on_segments([s], k)[:, 0] for k in range(5))) for s in parts]
    thrust = np.concatenate([specific_thrust(each, vehicle, environment) for each in (*curve, flat)])
    joining = np.concatenate([trajectory.knots[:-1] + s * trajectory.durations for s in parts])
    joining[: trajectory.segments] = trajectory.knots[1:]
    nodes = np.concatenate([joining, times])
    order = np.argsort(nodes, kind="stable")
    path = _frames(nodes[order], thrust[order], environment, trajectory.heading)
    return path, path.samples[np.argsort(order)[len(joining) :]]


def _unequal_frames(
    trajectory: Trajectory, vehicle: Vehicle, environment: Environment, times: Array
) -> tuple[TransportedFrames, NDArray[np.intp], FrameAngle]:
    """Return the same, and the angle from the frames of mean drag to those of unequal drag."""
    drag = UnequalDrag.of(vehicle, environment)
    pieces = resolved_pieces(trajectory, drag)
    inner = pieces.times_at(trajectory, nodes())
    path, at = _mean_frames(trajectory, vehicle, environment, np.append(times, inner))
    at, between = np.split(at, [len(times)])
    q = path.q_world_body[between].reshape(*inner.shape, 4)
    return path, at, FrameAngle.along(trajectory, drag, pieces, q)


def _frames(times: Array, thrust: Array, environment: Environment, heading: float) -> TransportedFrames:
    return frames(times, thrust, UNDETERMINED * environment.gravity, float(frozen(heading, "heading", ())))


def _assembled(
    times: Array,
    flat: FlatState,
    path: TransportedFrames,
    nodes: NDArray[np.intp],
    vehicle: Vehicle,
    environment: Environment,
    angle: Array | None,
    yaw: Array | None = None,
) -> Reference:
    """Return the reference at `nodes` of a path of frames.

    Args:
        times: Times [s], (T,).
        flat: Flat states at these times.
        path: TransportedFrames along the mean-drag thrust.
        nodes: Indices of the times among the path's nodes, (T,).
        vehicle: The vehicle.
        environment: The environment.
        angle: Angle from these frames to the frames of unequal drag [rad], yaw included, (T,); None for equal
            drag.
        yaw: Yaw relative to these frames [rad], with two derivatives, (T, 3); None without yaw.
    """
    thrust = specific_thrust(flat, vehicle, environment)
    q, determined = path.q_world_body[nodes], path.determined[nodes]
    airspeed = flat.velocity - environment.wind
    spin = None if yaw is None else yaw.T[1:]
    yawed = q if yaw is None else so3.multiply(q, so3.about_axis(so3.UP, yaw[:, 0]))
    if angle is None:
        q = yawed
        omega, omega_dot = body_rates(thrust, q, determined)
        if spin is not None:
            rates = kernel.spun(xyz(omega), xyz(omega_dot), tuple(spin))
            omega, omega_dot = (np.stack(rate, axis=-1) for rate in rates)
        wrench = wrench_for(thrust, airspeed, omega, omega_dot, vehicle)
    else:
        drag, balance = UnequalDrag.of(vehicle, environment), thrust[:, 0]
        q = np.where(determined[:, None], body_attitudes(q, angle, flat, drag, balance), yawed)
        omega, omega_dot, specific = body_motion(q, flat, drag, balance, spin)
        omega, omega_dot = (np.where(determined[:, None], rate, 0.0) for rate in (omega, omega_dot))
        moment = kernel.moment(vehicle.inertia.tolist(), xyz(omega), xyz(omega_dot))
        wrench = Wrench(vehicle.mass * specific, np.stack(moment, axis=-1))
    setpoint = Setpoint(flat, q, omega, omega_dot, wrench)
    rotors = rotor_thrusts(vehicle, wrench)
    for array in (*vars(flat).values(), q, omega, omega_dot, wrench.thrust, wrench.moment_body, rotors):
        array.flags.writeable = False
    return Reference(times, setpoint, rotors, path.undetermined)


def _rising(times: ArrayLike | None) -> Array:
    series = frozen(times, "times", (None,)) if times is not None else np.empty(0)
    if series.ndim != 1 or series.size == 0 or (np.diff(series) < 0).any():
        raise SpecError("times must be a list of at least one number of seconds, none before the last")
    return series
