"""From a trajectory to everything a vehicle must do to fly it: attitude, rates, moments, rotor thrusts.

With the velocity v in the air, relative to the wind, the specific thrust f = a + g e3 + (d/m) v, drag made
up for, and its direction b3 = f/|f|,

    b3'  = (f' − b3 n') / n                  n = |f|,  n' = b3·f'
    b3'' = (f'' − 2 n' b3' − n'' b3) / n     n'' = b3·f'' + b3'·f'
    ω = b3 × b3',   ω' = b3 × b3''           world axes, no spin about b3
    M = J ω' + ω × J ω                       body axes, ω_body = Rᵀ ω, ω'_body = Rᵀ ω'

No step divides by 1 + b3_z: upside down is as good as any other attitude. Linear drag with coefficients
d across and d_z along the body's z keeps the vehicle flat (Faessler, Franchi, Scaramuzza, RA-L 2018; of
unequal ones across the mean is taken): the thrust is T = m|f| + (d_z − d) b3·v.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness.parallel_transport import Frames, TimeInterval, frames
from aerobat.states import FlatState, Setpoint, Wrench
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle
from aerobat.vehicle.allocation import rotor_thrusts

UNDETERMINED = 1e-3  # the attitude is undetermined where |f| is below this fraction of gravity
TURN = np.array([-1.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Reference:
    """What a trajectory asks of a vehicle, at every time of a series."""

    times: Array  # [s], (T,)
    setpoint: Setpoint  # leading axis T; where the attitude is undetermined it is held and its rates are zero
    rotor_thrusts: Array  # [N], as flatness asks, limits or not, (T, n)
    undetermined: tuple[TimeInterval, ...]  # where |f| is next to nothing, between samples too


def reference(
    trajectory: Trajectory,
    vehicle: Vehicle,
    times: ArrayLike | None = None,
    rate: float | None = None,
    environment: Environment | None = None,
) -> Reference:
    """What `trajectory` asks of `vehicle` at the times given [s], or at `rate` [1/s] and the very end.

    The attitude starts, at the trajectory's start, as the smallest rotation from upright to the thrust,
    turned about it by the trajectory's heading, and is carried along without spin, so that it does not depend
    on the times asked for. The environment is by default one without wind. Raises SpecError unless one of
    times and rate is given, rising and in the trajectory.
    """
    if (times is None) == (rate is None):
        raise SpecError("reference needs either times or a rate, not both")
    environment = environment or Environment()
    asked = _rising(trajectory.sample(rate) if rate is not None else times)
    flat = trajectory.flat(asked)
    # both sides of every knot join the times asked for, which show the later side
    seams = np.concatenate([trajectory.knots[1:], trajectory.knots[:-1]])
    thrust = np.concatenate(
        [_thrust_at_seams(trajectory, vehicle, environment), _thrust(flat, vehicle, environment)]
    )
    side = np.repeat([0, 1, 2], [trajectory.segments, trajectory.segments, len(asked)])
    order = np.lexsort((side, np.concatenate([seams, asked])))
    path = _frames(np.concatenate([seams, asked])[order], thrust[order], environment, trajectory.heading)
    nodes = path.samples[np.argsort(order)[len(seams) :]]
    return _assembled(asked, flat, path, nodes, vehicle, environment)


def reference_of(
    times: ArrayLike,
    flat: FlatState,
    vehicle: Vehicle,
    environment: Environment | None = None,
    heading: float = 0.0,
) -> Reference:
    """What a series of flat states (T, 3) at `times` (T,) [s] asks of `vehicle`; as `reference` otherwise.

    Between samples the thrust is taken as the quintic that fits both; where a derivative jumps, give the
    time twice, with the states of both sides. Raises SpecError for falling times and shapes that differ.
    """
    environment = environment or Environment()
    asked = _rising(times)
    names = ("position", "velocity", "acceleration", "jerk", "snap")
    flat = FlatState(*(frozen(getattr(flat, name), name, (len(asked), 3)) for name in names))
    if any(series.ndim != 2 for series in vars(flat).values()):
        raise SpecError("the flat states must be one series, with a row for each time and no further axes")
    path = _frames(asked, _thrust(flat, vehicle, environment), environment, heading)
    return _assembled(asked, flat, path, path.samples, vehicle, environment)


def body_rates(thrust: Array, q_world_body: Array, determined: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Body rates [rad/s] and accelerations [rad/s²] that keep b3 along f, body axes, both (..., 3).

    `thrust` holds f, f', f'' (..., 3, 3); where the attitude is not `determined` (...), both are zero.
    """
    f, df, ddf = (thrust[..., k, :] for k in range(3))
    n = np.where(determined, np.linalg.norm(f, axis=-1), np.inf)[..., None]
    b3 = f / n
    dn = _dot(b3, df)
    db3 = (df - b3 * dn) / n
    ddn = _dot(b3, ddf) + _dot(db3, df)
    ddb3 = (ddf - 2 * dn * db3 - ddn * b3) / n
    # b3 is e3 in the body: the cross product with it turns x, y into -y, x
    turned = so3.unrotate(q_world_body[..., None, :], np.stack([db3, ddb3], axis=-2))[..., [1, 0, 2]] * TURN
    return turned[..., 0, :], turned[..., 1, :]


def wrench_for(thrust: Array, airspeed: Array, omega: Array, omega_dot: Array, vehicle: Vehicle) -> Wrench:
    """Collective thrust m|f| + (d_z − d) b3·v and moment J ω' + ω × J ω; ω, ω' (..., 3) in body axes.

    `airspeed` is the velocity v relative to the wind, world.
    """
    moment = omega_dot @ vehicle.inertia.T + so3.cross(omega, omega @ vehicle.inertia.T)
    f = thrust[..., 0, :]
    size = np.linalg.norm(f, axis=-1)
    along = np.sum(f * airspeed, axis=-1) / np.where(size > 0.0, size, 1.0)
    return Wrench(vehicle.mass * (size + axial_drag(vehicle) * along), moment)


def specific_thrust(
    vehicle: Vehicle,
    environment: Environment,
    airspeed: Array,
    acceleration: Array,
    jerk: Array,
    snap: Array,
) -> Array:
    """f = a + g e3 + (d/m) v and its two derivatives, (..., 3, 3), of the flat outputs' (..., 3).

    `airspeed` is the velocity v relative to the wind, world.
    """
    drag = lateral_drag(vehicle)
    thrust = np.stack([acceleration, jerk, snap], axis=-2)
    if drag:
        thrust += drag * np.stack([airspeed, acceleration, jerk], axis=-2)
    thrust[..., 0, 2] += environment.gravity
    return thrust


def lateral_drag(vehicle: Vehicle) -> float:
    """The drag coefficient across the thrust axis per mass, d/m [1/s]."""
    return float(vehicle.drag_body[:2].mean()) / vehicle.mass


def axial_drag(vehicle: Vehicle) -> float:
    """By how much the drag coefficient along the thrust exceeds that across it, per mass [1/s]."""
    return float(vehicle.drag_body[2]) / vehicle.mass - lateral_drag(vehicle)


def end_thrust(velocity: Array, acceleration: Array, vehicle: Vehicle, environment: Environment) -> Array:
    """Specific thrust f [m/s²] (..., 3) at a velocity and an acceleration of a path, world."""
    airspeed = velocity - environment.wind
    return np.asarray(acceleration + environment.weight + lateral_drag(vehicle) * airspeed)


def _thrust(flat: FlatState, vehicle: Vehicle, environment: Environment) -> Array:
    airspeed = flat.velocity - environment.wind
    return specific_thrust(vehicle, environment, airspeed, flat.acceleration, flat.jerk, flat.snap)


def _thrust_at_seams(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> Array:
    """f, f', f'' at the ends of all segments, then at their starts, (2S, 3, 3)."""
    v, a, j, s = (trajectory.on_segments([1.0, 0.0], k).swapaxes(0, 1).reshape(-1, 3) for k in (1, 2, 3, 4))
    return specific_thrust(vehicle, environment, v - environment.wind, a, j, s)


def _frames(times: Array, thrust: Array, environment: Environment, heading: float) -> Frames:
    return frames(times, thrust, UNDETERMINED * environment.gravity, float(frozen(heading, "heading", ())))


def _assembled(
    times: Array,
    flat: FlatState,
    path: Frames,
    nodes: NDArray[np.intp],
    vehicle: Vehicle,
    environment: Environment,
) -> Reference:
    thrust, q = path.thrust[nodes], path.q_world_body[nodes]
    omega, omega_dot = body_rates(thrust, q, path.determined[nodes])
    wrench = wrench_for(thrust, flat.velocity - environment.wind, omega, omega_dot, vehicle)
    setpoint = Setpoint(flat, q, omega, omega_dot, wrench)
    rotors = rotor_thrusts(vehicle, wrench)
    for array in (*vars(flat).values(), q, omega, omega_dot, wrench.thrust, wrench.moment_body, rotors):
        array.flags.writeable = False
    return Reference(times, setpoint, rotors, path.undetermined)


def _rising(times: ArrayLike | None) -> Array:
    asked = frozen(times, "times", (None,)) if times is not None else np.empty(0)
    if asked.ndim != 1 or asked.size == 0 or (np.diff(asked) < 0).any():
        raise SpecError("times must be a list of at least one number of seconds, none before the last")
    return asked


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1, keepdims=True))
