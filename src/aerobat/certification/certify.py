"""Certification: prove or refute that a vehicle can fly a trajectory in its environment.

`subdivision` cuts the trajectory into pieces on which interpolation is proven to be accurate, `attitude`
carries the frame along them, and `enclosure` bounds the extrema of the interpolants. DERIVATION.md beside
this file has the proof.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import acos, inf

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import quantities
from aerobat.certification.attitude import ThrustDirectionRates
from aerobat.certification.body_path import BodyPath
from aerobat.certification.certificate import Certificate, Finding, Side
from aerobat.certification.clearance import clearance_finding, frame_finding
from aerobat.certification.continuity import discontinuities, seam
from aerobat.certification.enclosure.queries import (
    SUMMATION_ROUNDING,
    ChebyshevSeries,
    ExtremumQuery,
    angle,
    both_sides,
    root,
    within,
)
from aerobat.certification.envelope import Envelope
from aerobat.certification.path.ends import end_findings
from aerobat.certification.path.kinematics import kinematic_findings
from aerobat.certification.path.passages import passage_findings, waypoint_finding
from aerobat.certification.series_columns import SeriesColumns
from aerobat.certification.subdivision import subdivide, vanishing
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.certification.unequal_drag import interpolated_with_unequal_drag
from aerobat.declaration import validated
from aerobat.environment import Environment
from aerobat.flatness import Planned, environment_of, has_unequal_drag, vehicle_of
from aerobat.limits.along import limits_along
from aerobat.limits.limit import Limit
from aerobat.limits.quantity import BODY_RATE, UPRIGHT, WRENCH, WRENCH_RATE
from aerobat.problem import Condition, Quantity
from aerobat.states import TimeInterval
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import Vehicle
from aerobat.vehicle.ellipsoid import Revolved


@validated
def certify(
    trajectory: Trajectory | Planned,
    vehicle: Vehicle | str | None = None,
    environment: Environment | None = None,
    envelope: Envelope | None = None,
) -> Certificate:
    """Prove that a vehicle can fly a trajectory within its limits at every instant, or refute it.

    The quantities are those of `flatness.reference`: the thrust of every rotor and their sum, tilt, body
    rate, moment, speed, and everything that `envelope.limits` and `envelope.conditions` bound. For a rotor
    with lag the command is bounded too. The requirements of `envelope.passages` are checked at their
    instants. Among obstacles the clearance of the whole body is bounded, for all angles about its thrust axis
    at once.

    Bounds are proven over continuous time, rounding included. Margins below about 1e-7 of a rotor's range
    stay undecided (1e-5 after tens of seconds, and for commands), as do clearances below 1e-6 m. All
    quantities that need an attitude stay undecided where thrust vanishes and leaves the attitude
    undetermined. Speed, and the quantities of `envelope.limits` and `envelope.conditions`, may reach their
    limits exactly (`path.kinematics.LIMIT_TOLERANCE`).

    Dead rotors are left out, and the others are numbered without them. SpecError is raised for unreasonably
    large derivatives, and for a vehicle that is not controllable without its dead rotors.

    Args:
        trajectory: The path [m] over time [s], world, and its heading [rad]; of a plan only its path. All
            that a plan's problem requires is proven in `plan.certificate`.
        vehicle: The vehicle that flies it, or its name, by default the plan's; its rotors' limits [N] and its
            body rate limit [rad/s] are those that count.
        environment: Gravity, wind and obstacles, by default the plan's, else those of a calm day on Earth.
            Drag acts on the velocity relative to the wind; speed and its limit are relative to the ground.
        envelope: Further limits, by default none.
    """
    envelope = Envelope() if envelope is None else envelope
    whole = vehicle_of(trajectory, vehicle)
    vehicle = whole.without_dead_rotors()
    environment = environment_of(trajectory, environment)
    trajectory = as_trajectory(trajectory)
    limits = limits_along(vehicle, environment, envelope.limits, envelope.conditions)
    on_measures = [limit for limit in limits if limit.is_proven and not limit.quantity.is_of_path]
    on_path = [limit for limit in limits if limit.quantity.is_of_path]
    curve = ThrustCurve.of(trajectory, vehicle, environment)
    pieces = subdivide(curve)
    findings: list[Finding] = []
    unequal = has_unequal_drag(vehicle)
    on_thrust = [limit for limit in on_path if unequal and _is_of_thrust(limit, envelope.conditions)]
    derived = [limit for limit in on_measures if not _is_stated(limit)]
    has_obstacles = len(environment.pieces) > 0
    is_near = has_obstacles or len(envelope.passages) > 0
    columns = SeriesColumns(derived, on_thrust, with_axis=is_near)
    series, unproven = _series(curve, pieces, columns)
    if series is not None:
        findings += series.findings(_queries(vehicle, envelope, on_measures, columns))
    findings += kinematic_findings(trajectory, envelope.speed, [x for x in on_path if x not in on_thrust])
    bodies = _bodies(curve, series, whole.bounding_ellipsoid.revolved) if is_near else None
    if bodies and has_obstacles:
        findings += [clearance_finding(*bodies, environment.pieces)]
    findings += end_findings(trajectory, envelope.start, envelope.goal)
    findings += passage_findings(curve, envelope.passages)
    findings += [frame_finding(*bodies, passage) for passage in envelope.passages] if bodies else []
    findings += [waypoint_finding(trajectory, waypoint) for waypoint in envelope.waypoints]
    jumps = discontinuities(curve, series)
    if envelope.closed:
        jumps += seam(curve)
    too_unequal = next((span.start for span in unproven), None)
    undetermined = vanishing(trajectory, pieces) + unproven
    return Certificate(tuple(findings), undetermined, jumps, too_unequal)


def _series(
    curve: ThrustCurve, pieces: Subintervals, columns: SeriesColumns
) -> tuple[ChebyshevSeries | None, tuple[TimeInterval, ...]]:
    """Return all quantities along the pieces, or None, and where unequal drag leaves the attitude open."""
    if not len(pieces):
        return None, ()
    if has_unequal_drag(curve.vehicle):
        return interpolated_with_unequal_drag(curve, pieces, columns)
    return interpolated(curve, pieces, columns), ()


def _bodies(
    curve: ThrustCurve, series: ChebyshevSeries | None, body: Revolved
) -> tuple[BodyPath | None, BodyPath]:
    """Return the body in its attitude, where one is known, and as a ball on the rest of the path.

    Args:
        curve: The thrust curve of the vehicle.
        series: Series with the components of the thrust axis as the last columns, or None without any
            attitude.
        body: The vehicle's body.
    """
    known = Subintervals.whole(0) if series is None else series.pieces
    attitude = None if series is None else BodyPath.in_attitude(series, body)
    rest = known.rest(curve.trajectory.segments)
    return attitude, BodyPath.in_every_attitude(curve.trajectory, rest, body)


def _is_of_thrust(limit: Limit, conditions: Sequence[Condition]) -> bool:
    """Return True for conditions on the specific thrust, which unequal drag makes nonlinear in the path."""
    return limit.name in {x.name for x in conditions if x.quantity is Quantity.SPECIFIC_THRUST}


def _is_stated(limit: Limit) -> bool:
    """Return True for limits that a certificate always states: plain rotor thrusts, tilt and body rate."""
    used = limit.quantity.measures
    is_thrust = limit.rotor is not None and max(used) < WRENCH.stop
    return is_thrust or used in ((UPRIGHT,), (BODY_RATE,))


def _queries(
    vehicle: Vehicle, envelope: Envelope, limits: Sequence[Limit], columns: SeriesColumns
) -> list[ExtremumQuery]:
    """Return the queries for the extrema that a certificate states.

    Args:
        vehicle: The vehicle, with n rotors.
        envelope: Further limits.
        limits: Limits on measures, including those of the rotors.
        columns: Columns of the series.
    """
    count = len(vehicle.rotors)
    behind = count + 4 + len(columns.derived)
    thrusts = [limit for limit in limits if limit.rotor is not None and _is_stated(limit)]
    low, high = (sum(ends) for ends in zip(*((limit.lower, limit.upper) for limit in thrusts), strict=True))
    tilts = [(acos(limit.lower), limit) for limit in limits if limit.quantity.measures == (UPRIGHT,)]
    rates = [(limit.upper, limit) for limit in limits if limit.quantity.measures == (BODY_RATE,)]
    tilt = ExtremumQuery("tilt", "rad", Side.MAX, envelope.tilt, count + 1, -1, angle)
    rate = ExtremumQuery("body rate", "rad/s", Side.MAX, envelope.body_rate, count + 2, 1, root)
    return [
        *(query for i, limit in enumerate(thrusts) for query in within(limit, i)),
        *(query for i, limit in enumerate(columns.derived, count + 4) for query in within(limit, i)),
        *both_sides("collective thrust", "N", count, low, high),
        _nearest(tilt, tilts),
        _nearest(rate, rates),
        ExtremumQuery("moment", "N·m", Side.MAX, envelope.moment, count + 3, 1, root),
        *(query for i, limit in enumerate(columns.on_thrust, behind) for query in within(limit, i)),
    ]


def _nearest(query: ExtremumQuery, limits: Sequence[tuple[float, Limit]]) -> ExtremumQuery:
    """Return the query with the tightest of its own limit and others, and the source of that limit."""
    least, source = min(limits, key=lambda pair: pair[0], default=(inf, None))
    return query if query.limit <= least else replace(query, limit=least, source=source)


def interpolated(
    curve: ThrustCurve, pieces: Subintervals, columns: SeriesColumns | None = None
) -> ChebyshevSeries:
    """Return all quantities along consecutive pieces, in the frame without spin that is carried along them.

    Args:
        curve: The thrust curve of a vehicle without unequal drag.
        pieces: Consecutive pieces on which interpolation is accurate.
        columns: Columns of the series, by default only those of `quantities.values`.
    """
    columns = SeriesColumns() if columns is None else columns
    vehicle, basis = curve.vehicle, curve.basis
    values = curve.on(pieces)
    series = curve.series(values)
    seconds = pieces.seconds(curve.trajectory)
    rates = ThrustDirectionRates.along(values[..., 1:, :], series[:, 0, 1], seconds, basis)
    angle, yaw = rates.carried(curve.trajectory.heading), curve.yaw_on(pieces)
    omega, omega_dot = rates.body(angle) if yaw is None else rates.with_yaw(angle, yaw)
    bound = curve.error_bounds(curve.norms(series, pieces), pieces)
    # errors of the frame's angle accumulate from piece to piece
    own_error = (bound.twist_remainder + basis.lebesgue * bound.twist_rounding)[:, None]
    angle_error = np.cumsum(own_error, axis=0)
    error = bound.remainder + basis.lebesgue * (bound.rounding + angle_error * bound.per_radian)
    found = [basis.analysis @ quantities.values(vehicle, values, omega, omega_dot)]
    errors = [error]
    if columns.derived:
        per_second, thrusts = 2 / seconds[:, None], found[0][..., : len(vehicle.rotors)]
        # error of the interpolated values, which differentiation amplifies
        noise = bound.rounding + own_error * bound.per_radian
        noise += SUMMATION_ROUNDING * np.abs(found[0]).sum(axis=1)
        rate_error = bound.rate_remainder + (angle_error - own_error) * bound.rate_per_radian
        rate_error += per_second * basis.steepening * noise
        weights = _weights(columns.derived, vehicle)
        found.append(_weighted(weights, found[0], per_second[..., None] * (basis.derivative @ thrusts)))
        errors.append(_weighted([np.abs(each) for each in weights], error, rate_error))
    if columns.with_axis:  # each component is as exact as the one along z
        thrust = values[:, :, 1]
        found.append(basis.analysis @ (thrust / np.linalg.norm(thrust, axis=-1, keepdims=True)))
        errors.append(np.tile(error[:, len(vehicle.rotors) + 1, None], 3))
    series, error = (np.concatenate(each, axis=-1) for each in (found, errors))
    return ChebyshevSeries(curve.trajectory, pieces, series, error, columns.scale(vehicle))


def _weighted(weights: Sequence[Array], values: Array, rates: Array) -> Array:
    """Return the quantities of derived limits, or their errors, from `quantities.values` and derivatives.

    A wrench is linear in the rotors' thrusts, so quantities that are linear in the wrench are linear in the
    thrusts.

    Args:
        weights: Weights from `_weights`; for errors their absolute values.
        values: The thrusts of n rotors, their sum, the cosine of the tilt, and other quantities, (..., n +
            4).
        rates: Derivatives of these values [1/s], beginning with the n thrusts.
    """
    plain, change, tilting = weights
    count = len(plain)
    return np.asarray(
        values[..., :count] @ plain + rates[..., :count] @ change + values[..., count + 1, None] * tilting
    )


def _weights(derived: Sequence[Limit], vehicle: Vehicle) -> tuple[Array, Array, Array]:
    """Return the weights of D limits on n thrusts and on their derivatives, (n, D) each, and on cos tilt."""
    plain, change = np.array([_on_rotors(limit, vehicle) for limit in derived]).transpose(1, 2, 0)
    return plain, change, np.array([limit.quantity.measured[UPRIGHT] for limit in derived])


def _on_rotors(limit: Limit, vehicle: Vehicle) -> tuple[Array, Array]:
    """Return a limit's weights on the rotors' thrusts and on their derivatives, (n,) each."""
    wrench, rate = limit.quantity.measured[WRENCH], limit.quantity.measured[WRENCH_RATE]
    if limit.rotor is None:
        return wrench @ vehicle.allocation, rate @ vehicle.allocation
    own = np.eye(len(vehicle.rotors))[limit.rotor]
    size = float(np.linalg.norm(wrench))
    return own, float(np.linalg.norm(rate)) / size * own
