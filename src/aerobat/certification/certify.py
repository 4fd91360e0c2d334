"""certify(): a trajectory, a vehicle and its environment in, a proof or its refutation out.

Three steps: `subdivision` cuts the trajectory into pieces on which interpolation is proven to be accurate,
`attitude` carries the frame along them, and `enclosure` bounds the extrema of the interpolants. DERIVATION.md
beside this file says why that is a proof.
"""

from __future__ import annotations

import numpy as np

from aerobat.certification import quantities
from aerobat.certification.attitude import ThrustDirectionRates
from aerobat.certification.certificate import Certificate, Finding, Side
from aerobat.certification.continuity import discontinuities
from aerobat.certification.enclosure.interpolation_error import accuracy
from aerobat.certification.enclosure.queries import ChebyshevSeries, ExtremumQuery, angle, both_sides, root
from aerobat.certification.envelope import Envelope
from aerobat.certification.kinematics import kinematic_findings
from aerobat.certification.subdivision import subdivide
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.environment import Environment
from aerobat.flatness.references import UNDETERMINED
from aerobat.trajectory import Trajectory
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import Vehicle

INTERPOLATION_DEGREE = 20  # of interpolation
TIGHTNESS = 1e-7  # of a rotor's range: how near the proven bounds are to what is reached


def certify(
    trajectory: Trajectory,
    vehicle: Vehicle,
    environment: Environment | None = None,
    envelope: Envelope | None = None,
) -> Certificate:
    """Prove that a vehicle can fly a trajectory within its limits at every instant, or refute it.

    Quantities are those of `flatness.reference`: the thrust of every rotor and their
    sum, tilt, body rate, moment and speed, and per axis what `envelope.limits` bounds. Bounds are proven
    over continuous time, rounding included. A limit nearer than about 1e-7 of a rotor's range (1e-5 after
    tens of seconds) stays undecided, as does all that needs an attitude where thrust, and with it the
    attitude, is undetermined; speed and what `envelope.limits` bounds may meet their limits exactly
    (`kinematics.LIMIT_TOLERANCE`).
    Raises SpecError for derivatives beyond all reason.

    Args:
        trajectory: The path [m] over time [s], world, and its heading [rad].
        vehicle: What flies it; its rotors' limits [N] are those that count.
        environment: Gravity and wind, by default those of a calm day on Earth. Drag acts on the velocity
            relative to the wind; speed and its limit are relative to the ground.
        envelope: What else it shall stay within, by default nothing.
    """
    envelope = Envelope() if envelope is None else envelope
    environment = Environment() if environment is None else environment
    curve = ThrustCurve.of(trajectory, vehicle, environment, INTERPOLATION_DEGREE)
    floor = UNDETERMINED * environment.gravity
    found = subdivide(curve, floor)
    findings: list[Finding] = []
    if len(found.pieces):
        series = interpolated(curve, found.pieces, everywhere=not found.vanishing)
        findings += series.answers(_queries(vehicle, envelope))
    findings += kinematic_findings(trajectory, envelope)
    return Certificate(tuple(findings), found.vanishing, discontinuities(curve, floor))


def _queries(vehicle: Vehicle, envelope: Envelope) -> list[ExtremumQuery]:
    """The extrema of the columns of `quantities.values` that a certificate states."""
    count = len(vehicle.rotors)
    low, high = vehicle.min_thrusts, vehicle.max_thrusts
    rotors = [query for i in range(count) for query in both_sides(f"rotor {i}", "N", i, low[i], high[i])]
    return [
        *rotors,
        *both_sides("thrust", "N", count, low.sum(), high.sum()),
        ExtremumQuery("tilt", "rad", Side.MAX, envelope.tilt, count + 1, -1, angle),
        ExtremumQuery("body rate", "rad/s", Side.MAX, envelope.body_rate, count + 2, 1, root),
        ExtremumQuery("moment", "N·m", Side.MAX, envelope.moment, count + 3, 1, root),
    ]


def interpolated(curve: ThrustCurve, pieces: Subintervals, everywhere: bool) -> ChebyshevSeries:
    """All quantities along pieces that follow each other, in the frame that is carried along them."""
    vehicle, basis = curve.vehicle, curve.basis
    values = curve.on(pieces)
    series = curve.series(values)
    seconds = pieces.seconds(curve.trajectory)
    rates = ThrustDirectionRates.along(values[..., 1:, :], series[:, 0, 1], seconds, basis)
    omega, omega_dot = rates.body(rates.carried(curve.trajectory.heading))
    bound = accuracy(curve.norms(series, pieces), seconds, curve.sums[pieces.interval], vehicle)
    # errors of the frame's angle add up from piece to piece
    angle_error = np.cumsum(bound.twist_remainder + basis.lebesgue * bound.twist_rounding)
    error = bound.remainder + basis.lebesgue * (bound.rounding + angle_error[:, None] * bound.per_radian)
    columns = basis.analysis @ quantities.values(vehicle, values, omega, omega_dot)
    scale = quantities.scales(vehicle)
    return ChebyshevSeries(curve.trajectory, pieces, columns, error, scale, TIGHTNESS, everywhere)
