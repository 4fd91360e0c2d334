"""certify(): a trajectory, a vehicle and its environment in, a proof or its refutation out.

Three steps: `subdivision` cuts the trajectory into pieces on which interpolation is proven to be accurate,
`attitude` carries the frame along them, and `enclosure` bounds the extrema of the interpolants. DERIVATION.md
beside this file says why that is a proof.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import quantities
from aerobat.certification.attitude import ThrustDirectionRates
from aerobat.certification.certificate import Certificate, Finding, Side
from aerobat.certification.continuity import discontinuities, seam
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.interpolation_error import accuracy
from aerobat.certification.enclosure.queries import (
    SUMMATION_ROUNDING,
    ChebyshevSeries,
    ExtremumQuery,
    angle,
    both_sides,
    root,
)
from aerobat.certification.envelope import Envelope
from aerobat.certification.path.kinematics import kinematic_findings
from aerobat.certification.path.passages import passage_findings, waypoint_findings
from aerobat.certification.subdivision import subdivide
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.declaration import validated
from aerobat.environment import Environment
from aerobat.flatness import Planned, environment_of, vehicle_of
from aerobat.flatness.references import UNDETERMINED, force_balance
from aerobat.trajectory import Trajectory, as_trajectory
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import Vehicle

INTERPOLATION_DEGREE = 20  # of interpolation
TIGHTNESS = 1e-7  # of a rotor's range: how near the proven bounds are to what is reached


@validated
def certify(
    trajectory: Trajectory | Planned,
    vehicle: Vehicle | str | None = None,
    environment: Environment | None = None,
    envelope: Envelope | None = None,
) -> Certificate:
    """Prove that a vehicle can fly a trajectory within its limits at every instant, or refute it.

    Quantities are those of `flatness.reference`: the thrust of every rotor and their
    sum, tilt, body rate, moment and speed, per axis what `envelope.limits` bounds, and what
    `envelope.conditions` do; of a rotor with lag the command too, and what `envelope.passages` ask at their
    instants. Bounds are proven
    over continuous time, rounding included. A limit nearer than about 1e-7 of a rotor's range (1e-5 after
    tens of seconds, and of a command) stays undecided, as does all that needs an attitude where thrust, and
    with it the attitude, is undetermined; speed and what `envelope.limits` and `envelope.conditions` bound
    may meet their limits exactly (`path.kinematics.LIMIT_TOLERANCE`).
    Dead rotors are left out, and the others counted without them. Raises SpecError for derivatives beyond all
    reason, and for a vehicle that its dead rotors leave without control.

    Args:
        trajectory: The path [m] over time [s], world, and its heading [rad]; of a plan its path alone, what
            its problem asks beside is proven in `plan.certificate`.
        vehicle: What flies it, or its name, by default the plan's; its rotors' limits [N] and its body rate's
            [rad/s] are those that count.
        environment: Gravity and wind, by default the plan's, else those of a calm day on Earth. Drag acts on
            the velocity relative to the wind; speed and its limit are relative to the ground.
        envelope: What else it shall stay within, by default nothing.
    """
    envelope = Envelope() if envelope is None else envelope
    vehicle = vehicle_of(trajectory, vehicle).without_dead_rotors()
    environment = environment_of(trajectory, environment)
    trajectory = as_trajectory(trajectory)
    curve = ThrustCurve.of(trajectory, vehicle, environment, INTERPOLATION_DEGREE)
    floor = UNDETERMINED * environment.gravity
    found = subdivide(curve, floor)
    series = interpolated(curve, found.pieces, everywhere=not found.vanishing) if len(found.pieces) else None
    findings: list[Finding] = []
    if series is not None:
        findings += series.answers(_queries(vehicle, envelope))
    balance = force_balance(environment, vehicle)
    findings += kinematic_findings(trajectory, envelope, balance)
    findings += passage_findings(trajectory, envelope.passages, balance)
    findings += waypoint_findings(trajectory, envelope.waypoints)
    jumps = discontinuities(curve, floor, series)
    if envelope.closed:
        jumps += seam(trajectory, vehicle, environment)
    return Certificate(tuple(findings), found.vanishing, jumps)


def _queries(vehicle: Vehicle, envelope: Envelope) -> list[ExtremumQuery]:
    """The extrema of the columns of `quantities.values` that a certificate states."""
    count = len(vehicle.rotors)
    low, high = vehicle.min_thrusts, vehicle.max_thrusts
    body_rate = min(envelope.body_rate, vehicle.max_body_rate)
    rotors = [query for i in range(count) for query in both_sides(f"rotor {i}", "N", i, low[i], high[i])]
    commands = [
        query
        for i in np.flatnonzero(vehicle.lags)
        for query in both_sides(f"rotor {i} command", "N", count + 4 + int(i), low[i], high[i])
    ]
    return [
        *rotors,
        *commands,
        *both_sides("thrust", "N", count, low.sum(), high.sum()),
        ExtremumQuery("tilt", "rad", Side.MAX, envelope.tilt, count + 1, -1, angle),
        ExtremumQuery("body rate", "rad/s", Side.MAX, body_rate, count + 2, 1, root),
        ExtremumQuery("moment", "N·m", Side.MAX, envelope.moment, count + 3, 1, root),
    ]


def interpolated(curve: ThrustCurve, pieces: Subintervals, everywhere: bool) -> ChebyshevSeries:
    """All quantities along pieces that follow each other, in the frame that is carried along them.

    The columns of `quantities.values`, and behind them the commands of the rotors where any has a lag.
    """
    vehicle, basis = curve.vehicle, curve.basis
    values = curve.on(pieces)
    series = curve.series(values)
    seconds = pieces.seconds(curve.trajectory)
    rates = ThrustDirectionRates.along(values[..., 1:, :], series[:, 0, 1], seconds, basis)
    omega, omega_dot = rates.body(rates.carried(curve.trajectory.heading))
    bound = accuracy(curve.norms(series, pieces), seconds, curve.sums[pieces.interval], vehicle)
    # errors of the frame's angle add up from piece to piece
    own_error = (bound.twist_remainder + basis.lebesgue * bound.twist_rounding)[:, None]
    angle_error = np.cumsum(own_error, axis=0)
    error = bound.remainder + basis.lebesgue * (bound.rounding + angle_error * bound.per_radian)
    columns = basis.analysis @ quantities.values(vehicle, values, omega, omega_dot)
    scale = quantities.scales(vehicle)
    found = ChebyshevSeries(curve.trajectory, pieces, columns, error, scale, TIGHTNESS, everywhere)
    if not vehicle.lags.any():
        return found
    # what is interpolated is off by so much, and its derivative by what that makes of it
    noise = bound.rounding + own_error * bound.per_radian + SUMMATION_ROUNDING * np.abs(columns).sum(axis=1)
    rate_error = bound.rate_remainder + (angle_error - own_error) * bound.rate_per_radian
    rate_error += 2 / seconds[:, None] * basis.steepening * noise
    return _with_commands(found, rate_error, vehicle, basis)


def _with_commands(
    found: ChebyshevSeries, rate_error: Array, vehicle: Vehicle, basis: chebyshev.Basis
) -> ChebyshevSeries:
    """The series with the commands f + τ f' of all rotors behind them.

    Args:
        found: The thrusts f among others.
        rate_error: Of the derivatives of its series [1/s], (P, Q).
        vehicle: What flies, with n rotors.
        basis: Of interpolation.
    """
    count = len(vehicle.rotors)
    thrusts = found.series[..., :count]
    per_second = 2 / found.pieces.seconds(found.trajectory)[:, None, None]
    commands = thrusts + vehicle.lags * per_second * (basis.derivative @ thrusts)
    error = found.error[:, :count] + vehicle.lags * rate_error[:, :count]
    return replace(
        found,
        series=np.concatenate([found.series, commands], axis=-1),
        error=np.concatenate([found.error, error], axis=-1),
        scale=np.concatenate([found.scale, found.scale[:count]]),
    )
