"""certify(): a trajectory and a vehicle in, a proof or its refutation out.

Three steps: `resolution` cuts the trajectory into pieces on which interpolation is proven to be accurate,
`attitude` carries the frame along them, and `extremes` encloses the greatest values of the interpolants.
"""

from __future__ import annotations

import numpy as np

from aerobat.certification import quantities
from aerobat.certification.attitude import ThrustDirectionRates
from aerobat.certification.certificate import Certificate, Finding
from aerobat.certification.continuity import discontinuities
from aerobat.certification.enclosure import interpolation_error
from aerobat.certification.enclosure.queries import ChebyshevSeries
from aerobat.certification.envelope import Envelope
from aerobat.certification.kinematics import kinematic_findings
from aerobat.certification.subdivision import resolve
from aerobat.certification.thrust_curve import Pieces, ThrustCurve
from aerobat.environment import Environment
from aerobat.flatness.reference import UNDETERMINED
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

DEGREE = 20  # of interpolation
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
    over continuous time, rounding included. A limit nearer than about 1e-7 of a rotor's range stays
    undecided, as does all that needs an attitude where thrust, and with it the attitude, is undetermined;
    speed and what `envelope.limits` bounds may meet their limits exactly (`kinematics.LIMIT_TOLERANCE`).
    Raises SpecError for derivatives beyond all reason.

    Args:
        trajectory: The path and its heading.
        vehicle: What flies it.
        environment: Gravity and wind, by default those of a calm day on Earth.
        envelope: What else it shall stay within, by default nothing.
    """
    envelope = Envelope() if envelope is None else envelope
    environment = Environment() if environment is None else environment
    curve = ThrustCurve.of(trajectory, vehicle, environment, DEGREE)
    floor = UNDETERMINED * environment.gravity
    resolution = resolve(curve, floor)
    findings: list[Finding] = []
    if len(resolution.pieces.segment):
        flown = _interpolated(curve, resolution.pieces, everywhere=not resolution.vanishing)
        findings += flown.answers(quantities.questions(vehicle, envelope))
    findings += kinematic_findings(trajectory, envelope)
    return Certificate(tuple(findings), resolution.vanishing, discontinuities(curve, floor))


def _interpolated(curve: ThrustCurve, pieces: Pieces, everywhere: bool) -> ChebyshevSeries:
    """All quantities along pieces that follow each other, in the frame that is carried along them."""
    vehicle, basis = curve.vehicle, curve.basis
    values = curve.on(pieces)
    series = curve.series(values)
    seconds = pieces.seconds(curve.trajectory)
    turning = ThrustDirectionRates.along(values[..., 1:, :], series[:, 0, 1], seconds, basis)
    omega, omega_dot = turning.body(turning.carried(curve.trajectory.heading))
    found = interpolation_error.accuracy(
        curve.norms(series, pieces), seconds, curve.sums[pieces.segment], vehicle
    )
    angle = np.cumsum(found.twist_remainder + basis.lebesgue * found.twist_rounding)
    error = found.remainder + basis.lebesgue * (found.rounding + angle[:, None] * found.turning)
    columns = basis.analysis @ quantities.values(vehicle, values, omega, omega_dot)
    scale = quantities.scales(vehicle)
    return ChebyshevSeries(curve.trajectory, pieces, columns, error, scale, TIGHTNESS, everywhere)
