"""Jumps between segments that no finite force or moment can produce.

Only the norm of the thrust and the moments may jump. Where rotors have lag, their thrusts may not jump
either.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.certification import quantities
from aerobat.certification.certificate import Discontinuity
from aerobat.certification.enclosure.interpolation_error import first_order
from aerobat.certification.enclosure.queries import ChebyshevSeries
from aerobat.certification.quantities import MagnitudeBounds
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.flatness import has_unequal_drag, reference
from aerobat.flatness.unequal_drag import UnequalDrag
from aerobat.trajectory import Trajectory, polynomial

NEGLIGIBLE_JUMP = 1e-6  # of the largest value at knots; no controller or solver resolves less
NEGLIGIBLE_SEAM = 1e-6  # of the largest value, or of 1 rad or 1 rad/s, where a lap closes
# of a rotor's range: the resolution of motor commands, pulses of 1000 to 2000 µs
COMMAND_RESOLUTION = 1 / 1000
CANCELLATION = 1e3  # rounding error of fitted segments, in units in the last place of the largest coefficient


def discontinuities(curve: ThrustCurve, found: ChebyshevSeries | None) -> tuple[Discontinuity, ...]:
    """Return the jump of lowest order at every inner knot with one that cannot be flown.

    Thrust directions are compared where the thrust is above the curve's floor. Rates are compared as b3' in
    the world frame: where b3 is continuous, its jump is that of the body rate.

    Args:
        curve: The thrust curve of the vehicle.
        found: Series with the rotors' thrusts as the first columns; None if the attitude is never determined.
    """
    trajectory, floor = curve.trajectory, curve.floor
    ends = curve.at(np.arange(trajectory.segments), np.tile([0.0, 1.0], (trajectory.segments, 1)))
    position = trajectory.on_segments([0.0, 1.0]) - trajectory.coefficients[0, 0]
    velocity, f, df = np.moveaxis(ends[:, :, :3], 2, 0)
    n = np.linalg.norm(f, axis=-1, keepdims=True)
    determined = (n[1:, 0, 0] >= floor) & (n[:-1, 1, 0] >= floor)
    inverse = 1 / np.maximum(n, floor)
    b3 = f * inverse
    db3 = (df - b3 * np.sum(b3 * df, axis=-1, keepdims=True)) * inverse
    if has_unequal_drag(curve.vehicle):
        b3, db3 = _unequal_directions(curve, ends)
    min_thrust = np.maximum(np.minimum(n[1:, 0, 0], n[:-1, 1, 0]), floor)
    turn = _tolerance(trajectory, f, 2) / min_thrust
    speeds = np.linalg.norm(db3, axis=-1)
    spin = _tolerance(trajectory, df, 3) / min_thrust + 2 * turn * np.maximum(speeds[1:, 0], speeds[:-1, 1])
    everywhere = np.full(len(determined), True)
    thrust = _thrust_jumps(curve, ends, min_thrust, found)
    checks = (
        ("position", "m", _jump(position), _tolerance(trajectory, position, 0), everywhere),
        ("velocity", "m/s", _jump(velocity), _tolerance(trajectory, velocity, 1), everywhere),
        ("thrust direction", "rad", _jump(b3), turn, determined),
        ("body rate", "rad/s", _jump(db3), spin, determined),
        *_yaw_checks(curve),
        ("rotor thrusts", "N", thrust, np.zeros_like(thrust), determined),
    )
    jumps: dict[int, Discontinuity] = {}
    for name, unit, norm, tolerance, counts in checks:
        for knot in np.flatnonzero(counts & (norm > tolerance)):
            time = float(trajectory.knots[knot + 1])
            jumps.setdefault(int(knot), Discontinuity(name, unit, float(norm[knot]), time))
    return tuple(jumps[knot] for knot in sorted(jumps))


def _yaw_checks(curve: ThrustCurve) -> Iterator[tuple[str, str, Array, float, Array]]:
    """Yield the jumps of yaw and its rate at inner knots, with their tolerance."""
    for name, unit, yaw in zip(("attitude", "body rate"), ("rad", "rad/s"), curve.yaw, strict=False):
        ends = polynomial.evaluate(yaw[:, None], np.array([0.0, 1.0]))
        size = max(1.0, float(np.abs(ends).max()))
        yield name, unit, _jump(ends), NEGLIGIBLE_JUMP * size, np.full(len(ends) - 1, True)


def _unequal_directions(curve: ThrustCurve, ends: Array) -> tuple[Array, Array]:
    """Return the thrust axis and its derivative that each side of a knot requires, (S, 2, 3) each.

    Both sides are evaluated in one attitude. With drag that differs along body x and y, in body axes b3 =
    (α_x/α_z, β_y/β_z, 1) to first order and b3' = (α'_x/α_z, β'_y/β_z, 0).

    Args:
        curve: The thrust curve of the vehicle.
        ends: v, f, f', f'' at both ends of segments, (S, 2, 4, 3).
    """
    drag = UnequalDrag.of(curve.vehicle, curve.environment)
    found = reference(curve.trajectory, curve.vehicle, curve.trajectory.knots, environment=curve.environment)
    q = found.setpoint.q_world_body
    axes = so3.axes(np.stack([q[:-1], q[1:]], axis=1))  # (S, 2, 3, 3)
    airspeed, thrust, change = np.moveaxis(ends[:, :, :3], 2, 0)
    acceleration = thrust - drag.weight - drag.mean * airspeed
    body = np.stack([thrust, airspeed, change, acceleration], axis=2) @ axes
    alpha, beta = (body[:, :, [0, 2]] + sign * drag.difference * body[:, :, [1, 3]] for sign in (1.0, -1.0))
    across = np.stack([alpha[..., 0] / alpha[:, :, :1, 2], beta[..., 1] / beta[:, :, :1, 2]], axis=-1)
    local = np.concatenate([across, np.broadcast_to([[1.0], [0.0]], (*across.shape[:2], 2, 1))], axis=-1)
    b3, db3 = np.moveaxis(local @ np.swapaxes(axes, -1, -2), 2, 0)
    return b3, db3


def seam(curve: ThrustCurve) -> tuple[Discontinuity, ...]:
    """Return the first jump from the end to the start of a lap that is flown repeatedly, if there is one.

    Full attitudes are compared: a body carried around the lap without spin may return rotated.
    """
    trajectory, vehicle = curve.trajectory, curve.vehicle
    flat = reference(trajectory, vehicle, [0.0, trajectory.duration], environment=curve.environment)
    state = flat.setpoint
    checks = (
        ("position", "m", state.flat.position, np.ptp(trajectory.on_segments([0.0]), axis=0)),
        ("velocity", "m/s", state.flat.velocity, trajectory.peak(1).value),
        ("body rate", "rad/s", state.omega_body, max(1.0, float(np.abs(state.omega_body).max()))),
        ("rotor thrusts", "N", flat.rotor_thrusts * (vehicle.lags > 0.0), vehicle.thrust_ranges),
    )
    jumps = [("attitude", "rad", float(so3.angle_between(*state.q_world_body)), 1.0)]
    for name, unit, ends, size in checks:
        jumps.append((name, unit, float(np.linalg.norm(ends[1] - ends[0])), float(np.max(size))))
    found = [
        Discontinuity(name, unit, jump, trajectory.duration)
        for name, unit, jump, size in jumps
        if jump > NEGLIGIBLE_SEAM * size
    ]
    return tuple(found[:1])


def _thrust_jumps(curve: ThrustCurve, ends: Array, min_thrust: Array, found: ChebyshevSeries | None) -> Array:
    """Return the largest jump [N] of a lagging rotor's thrust at each inner knot, (S - 1,).

    Jumps below the tolerance count as zero.

    Args:
        curve: The thrust curve of the vehicle.
        ends: v, f, f', f'' at both ends of segments, (S, 2, 4, 3).
        min_thrust: Lower bound of |f| at inner knots [m/s²], (S - 1,).
        found: Series with the rotors' thrusts as the first columns, or None.
    """
    vehicle, jumps = curve.vehicle, np.zeros(len(min_thrust))
    if found is None or not vehicle.lags.any():
        return jumps
    count, pieces = len(vehicle.rotors), found.pieces
    inner = np.flatnonzero((np.diff(pieces.interval) == 1) & (pieces.start[1:] == 0.0))
    values = found.ends()[..., :count]
    size = np.abs(values[inner + 1, 0] - values[inner, 1])
    excess = size > _thrust_tolerances(curve, ends, min_thrust)[pieces.interval[inner]]
    jumps[pieces.interval[inner]] = np.where(excess & (vehicle.lags > 0), size, 0.0).max(axis=1)
    return jumps


def _thrust_tolerances(curve: ThrustCurve, ends: Array, min_thrust: Array) -> Array:
    """Return the rotor thrust jumps that rounding or the resolution of commands explains, (S - 1, n)."""
    off = [_tolerance(curve.trajectory, ends[:, :, k], k + 1) for k in range(4)]
    norms = np.linalg.norm(ends, axis=-1)
    speed, thrust, jerk, snap = np.maximum(norms[1:, 0], norms[:-1, 1]).T
    omega = jerk / min_thrust
    real = MagnitudeBounds(thrust, np.ones_like(thrust), omega, snap / min_thrust + 2 * omega**2)
    errors = first_order(real, min_thrust, speed, np.stack(off, axis=-1), curve.vehicle)
    rounding = quantities.errors(curve.vehicle, real, errors)[:, : len(curve.vehicle.rotors)]
    return np.maximum(rounding, COMMAND_RESOLUTION * curve.vehicle.thrust_ranges)


def _jump(ends: Array) -> Array:
    """Return the norms of the jumps at inner knots (S - 1,) of values at segment ends (S, 2, 3)."""
    return np.asarray(np.linalg.norm(ends[1:, 0] - ends[:-1, 1], axis=-1))


def _tolerance(trajectory: Trajectory, ends: Array, derivative: int) -> Array:
    """Return the largest jump of `ends` (S, 2, 3) that rounding explains, at each inner knot, (S - 1,)."""
    largest = np.abs(trajectory.coefficients).max(axis=(1, 2))
    steepness = math.perm(trajectory.degree, derivative) / trajectory.durations**derivative
    rounding = CANCELLATION * np.finfo(float).eps * largest * steepness
    relative = NEGLIGIBLE_JUMP * float(np.linalg.norm(ends, axis=-1).max())
    return np.asarray(np.maximum(rounding[1:], rounding[:-1]) + relative)
