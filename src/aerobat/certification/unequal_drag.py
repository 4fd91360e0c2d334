"""The certified quantities of a vehicle whose drag differs between body x and body y.

The attitude R of such a vehicle solves a differential equation (`kernels.unequal_drag`). On each piece the
quaternion of `flatness.reference` is replaced by a polynomial, which solves the equation with a small defect.
The defects are polynomials too, and bound the distance from R. All quantities are then rational functions of
polynomials, whose interpolation error follows from bounds in complex time. DERIVATION.md, section 8, has the
details.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev as series_of

from aerobat.arrays import Array, Mask
from aerobat.certification.enclosure import chebyshev
from aerobat.certification.enclosure.bounded import Bounded, Polynomials
from aerobat.certification.enclosure.interpolation_error import MAX_COMMAND_REMAINDER, MAX_REMAINDER
from aerobat.certification.enclosure.queries import ChebyshevSeries
from aerobat.certification.series_columns import SeriesColumns
from aerobat.certification.thrust_curve import MIN_DURATION, ThrustCurve
from aerobat.flatness import reference
from aerobat.flatness.unequal_drag import analysis, nodes
from aerobat.kernels import flatness
from aerobat.kernels import unequal_drag as kernel
from aerobat.kernels.ops import Scalar, Vector
from aerobat.kernels.vectors import dot
from aerobat.limits.quantity import UPRIGHT, WRENCH, WRENCH_RATE
from aerobat.so3 import UP
from aerobat.states import TimeInterval
from aerobat.trajectory import polynomial
from aerobat.trajectory.subintervals import Subintervals
from aerobat.vehicle import mixer

QUATERNION_DEGREE = 14
RHO = np.array([1.0, 1.4, 1.6, 1.8, 2.0, 2.3])
HALVINGS = 8  # rounds of halving pieces on which interpolation for the mean drag is already accurate
# [rad] largest attitude error: first-order errors, doubled, are valid far beyond it
MAX_ATTITUDE_ERROR = 1e-3


def interpolated_with_unequal_drag(
    curve: ThrustCurve, pieces: Subintervals, columns: SeriesColumns
) -> tuple[ChebyshevSeries | None, tuple[TimeInterval, ...]]:
    """Return the series of `certify.interpolated`, and the intervals without a proven attitude.

    Args:
        curve: The thrust curve of the vehicle.
        pieces: Consecutive pieces on which the quantities for the mean drag are interpolated accurately.
        columns: Columns of the series.
    """
    pieces = pieces.halves()
    for _ in range(HALVINGS):
        pieces = pieces.in_order()
        motion = _Motion.of(curve, pieces)
        with np.errstate(invalid="ignore", over="ignore"):
            bounded = motion.columns(columns)
        rough = _is_rough(bounded, motion, columns) & (pieces.seconds(curve.trajectory) > MIN_DURATION)
        if not rough.any():
            break
        pieces = Subintervals.joined([pieces[~rough], pieces[rough].halves()])
    with np.errstate(invalid="ignore"):
        error = np.stack([_remainder(x, motion) + motion.basis.lebesgue * x.error for x in bounded], axis=1)
    values = np.stack([x.values for x in bounded], axis=-1)
    proven = np.isfinite(error).all(axis=1) & np.isfinite(values).all(axis=(1, 2))
    count = len(motion.pieces) if proven.all() else int(np.argmin(proven))
    unproven = _from(curve, motion.pieces, count)
    if count == 0:
        return None, unproven
    known, series = motion.pieces[:count], motion.basis.analysis @ values[:count]
    scale = columns.scale(curve.vehicle)
    return ChebyshevSeries(curve.trajectory, known, series, error[:count], scale), unproven


@dataclass(frozen=True, eq=False)
class _Motion:
    """A motion on pieces, at the nodes of a basis that holds products of it with two quaternions."""

    curve: ThrustCurve
    pieces: Subintervals
    basis: chebyshev.Basis
    world: Array  # airspeed to crackle, (P, N, 5, 3)
    sums: Array  # sums of the absolute values of their terms, (P, 5)
    attitude: Array  # coefficients of an almost unit quaternion, (P, QUATERNION_DEGREE + 1, 4)
    start: Array  # the quaternion at the trajectory's start, (4,)

    @classmethod
    def of(cls, curve: ThrustCurve, pieces: Subintervals) -> _Motion:
        """Return the motion of a vehicle, and the attitude of its reference."""
        trajectory = curve.trajectory
        sizes = [yaw.shape[1] for yaw in curve.yaw]
        basis = chebyshev.basis(2 * QUATERNION_DEGREE + max(trajectory.degree, 1, *sizes))
        s = pieces.positions(basis.nodes)
        world, sums = [], []
        for k in range(1, 6):
            rates = polynomial.differentiate(trajectory.coefficients, k)[pieces.interval]
            per_second = trajectory.durations[pieces.interval] ** -float(k)
            world.append(polynomial.evaluate(rates[:, None], s) * per_second[:, None, None])
            sums.append(np.linalg.norm(rates, axis=-1).sum(axis=1) * per_second)
        wind = curve.environment.wind
        world[0] = world[0] - wind
        sums[0] = sums[0] + np.linalg.norm(wind)
        count = QUATERNION_DEGREE + 1
        times = np.append(0.0, pieces.times_at(trajectory, nodes(count)))
        found = reference(trajectory, curve.vehicle, times, environment=curve.environment)
        start, q = np.split(found.setpoint.q_world_body, [1])
        attitude = analysis(count) @ q.reshape(len(pieces), -1, 4)
        return cls(curve, pieces, basis, np.stack(world, axis=2), np.stack(sums, axis=1), attitude, start[0])

    @cached_property
    def yaw(self) -> tuple[Bounded, ...] | None:
        """The yaw rate and its two derivatives; None without a yaw."""
        if not self.curve.yaw:
            return None
        polynomials = (self.curve.trajectory.yaw_polynomials(k) for k in (1, 2, 3))
        at = self.pieces.interval, self.pieces.positions(self.basis.nodes)
        values = (polynomial.evaluate(yaw[at[0], None], at[1])[..., 0] for yaw in polynomials)
        return tuple(self.polynomials(each).bounded() for each in values)

    @cached_property
    def drag(self) -> Array:
        """Drag coefficients divided by the mass [1/s], (3,)."""
        return np.asarray(self.curve.vehicle.drag_body / self.curve.vehicle.mass)

    @cached_property
    def quaternion(self) -> tuple[Array, Array, Array, Array]:
        """The components of the polynomial quaternion at the nodes, (P, N) each."""
        w, x, y, z = np.moveaxis(self._at_nodes @ self.attitude, -1, 0)
        return w, x, y, z

    @cached_property
    def _at_nodes(self) -> Array:
        return np.asarray(series_of.chebvander(self.basis.nodes, QUATERNION_DEGREE))

    def polynomials(self, values: Array) -> Polynomials:
        """Return polynomials of the basis's degree with these values (P, N) at the nodes."""
        return Polynomials(values, self.basis, RHO)

    @cached_property
    def squared(self) -> Polynomials:
        """The squared norm of the quaternion, almost 1."""
        w, x, y, z = self.quaternion
        return self.polynomials(w * w + x * x + y * y + z * z)

    @cached_property
    def per_square(self) -> Bounded:
        """The inverse of the squared norm of the quaternion."""
        return self.squared.bounded().inverse(self.squared.least())

    def body_polynomials(self, world: Array) -> list[Array]:
        """Return world vectors (P, N, 3) or (3,) in body axes, times `squared`: polynomials, (P, N) each."""
        w, x, y, z = self.quaternion
        a, b, c = np.moveaxis(world, -1, 0)
        return [
            (w * w + x * x - y * y - z * z) * a + 2 * (x * y + w * z) * b + 2 * (x * z - w * y) * c,
            2 * (x * y - w * z) * a + (w * w - x * x + y * y - z * z) * b + 2 * (y * z + w * x) * c,
            2 * (x * z + w * y) * a + 2 * (y * z - w * x) * b + (w * w - x * x - y * y + z * z) * c,
        ]

    def dragged(self, coefficient: float, k: int) -> tuple[Array, Array]:
        """Return the k-th derivative of a + g e3 + c v at the nodes, (P, N, 3), and its rounding, (P,)."""
        weight = self.curve.environment.weight if k == 0 else np.zeros(3)
        vector = self.world[:, :, k + 1] + weight + coefficient * self.world[:, :, k]
        summed = self.sums[:, k + 1] + np.linalg.norm(weight) + coefficient * self.sums[:, k]
        return vector, chebyshev.EVALUATION_ROUNDING * summed

    def body(self, world: Array, rounding: Array) -> Vector:
        """Return a world vector in body axes, with the errors of its rounding and of the attitude."""
        bounds = [self.polynomials(component).bound()[:, 0] for component in np.moveaxis(world, -1, 0)]
        size = np.linalg.norm(bounds, axis=0)
        off = rounding + self.attitude_error * size
        x, y, z = (
            self.polynomials(component).bounded() * self.per_square
            for component in self.body_polynomials(world)
        )
        return x.with_error(off), y.with_error(off), z.with_error(off)

    @cached_property
    def attitude_error(self) -> Array:
        """The largest angle [rad] between the polynomial's attitude and R, (P,); infinite if unknown.

        Let θ be the rotation between them in body axes, with the defects ε₁ = b1·α, ε₂ = b2·β and σ = ω_z. To
        first order θ_y = (ε₁ + θ_z α_y)/α_z, θ_x = (θ_z β_x − ε₂)/β_z and |θ_z'| ≤ |σ| + |ω| |(θ_x, θ_y)|,
        where ω is the body rate across the thrust axis. With a yaw, σ is ω_z minus the yaw rate.
        """
        square = self.squared.least()[:, 0]

        def sup(values: Array) -> Array:
            return np.asarray(self.polynomials(values).bound()[:, 0] / square)

        least, defect, slope, rate = [], [], [], []
        for axis, coefficient in enumerate(self.drag[:2].tolist()):
            (zeroth, off), (first, off_first) = (self.dragged(coefficient, k) for k in (0, 1))
            parts = self.body_polynomials(zeroth)
            least.append(self.polynomials(parts[2]).least()[:, 0] / self.squared.bound()[:, 0] - off)
            defect.append(sup(parts[axis]) + off)
            slope.append(sup(parts[1 - axis]) + off)
            rate.append(sup(self.body_polynomials(first)[axis]) + off_first)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            lowest = np.where(np.minimum(*least) > 0.0, np.minimum(*least), 0.0)
            tilt = np.hypot(*defect) / lowest  # tilt error without any error about the thrust axis
            lever = np.hypot(*slope) / lowest  # tilt error per angle about the thrust axis
            turn = self.yaw[0].bound[:, 0] if self.yaw is not None else 0.0
            omega = 1.01 * (np.hypot(*rate) + turn * np.hypot(*slope)) / lowest
            seconds = self.pieces.seconds(self.curve.trajectory)
            driven = seconds * (sup(self._spin) + omega * tilt)
            grown = np.exp(seconds * omega * lever)
            angle, largest = 0.0, []
            for jump, more, growth in zip(self._attitude_jumps, driven, grown, strict=True):
                angle = 2 * growth * (angle / 2 + jump + more)
                largest.append(angle)
            found = 2 * tilt + np.array(largest) * (1 + lever)
        return np.where(found < MAX_ATTITUDE_ERROR, found, np.inf)

    @cached_property
    def _spin(self) -> Array:
        """The defect of ω_z, times `squared`, at the nodes [rad/s], (P, N)."""
        seconds = self.pieces.seconds(self.curve.trajectory)[:, None]
        slopes = np.asarray(series_of.chebder(self.attitude, axis=1))
        dw, dx, dy, dz = np.moveaxis(self._at_nodes[:, :-1] @ slopes, -1, 0) * 2 / seconds
        w, x, y, z = self.quaternion
        spin = np.asarray(2 * (w * dz - x * dy + y * dx - z * dw))
        return spin if self.yaw is None else spin - self.yaw[0].values * self.squared.values

    @cached_property
    def _attitude_jumps(self) -> Array:
        """The angle [rad] between the attitude at a piece's start and that of its predecessor's end, (P,)."""
        ends = series_of.chebvander(np.array([-1.0, 1.0]), QUATERNION_DEGREE) @ self.attitude
        before = np.concatenate([self.start[None], ends[:-1, 1]])
        after = ends[:, 0]
        before, after = (q / np.linalg.norm(q, axis=-1, keepdims=True) for q in (before, after))
        sine = np.minimum(np.linalg.norm(after - before, axis=-1), np.linalg.norm(after + before, axis=-1))
        return np.asarray(4 * np.arcsin(np.minimum(sine / 2, 1.0)))

    def columns(self, columns: SeriesColumns) -> list[Bounded]:
        """Return all quantities, in the order of the columns."""
        vehicle = self.curve.vehicle
        cx, cy, cz = self.drag.tolist()
        rated = any(limit.quantity.measured[WRENCH_RATE].any() for limit in columns.derived)
        alpha, beta = ([self.body(*self.dragged(c, k)) for k in range(4 if rated else 3)] for c in (cx, cy))
        gamma = [self.body(*self.dragged(cz, k)) for k in range(2)]
        inverse = self._inverse(cx, alpha[0][2]), self._inverse(cy, beta[0][2])
        turn, change = (None, None) if self.yaw is None else (self.yaw[:2], self.yaw[2])
        omega, omega_dot = kernel.body_rates(inverse, alpha, beta, turn)
        thrust, thrust_rate = kernel.collective(vehicle.mass, gamma, omega)
        inertia, rate = vehicle.inertia.tolist(), (thrust_rate, 0.0, 0.0, 0.0)
        moment = flatness.moment(inertia, omega, omega_dot)
        if rated:
            jerk = kernel.angular_jerk(inverse, alpha, beta, omega, omega_dot, change)
            rate = (thrust_rate, *flatness.moment_and_rate(inertia, omega, omega_dot, jerk)[1])
        upright, wrench = self.axis(UP), (thrust, *moment)
        found = [_weighted(weights, wrench) for weights in mixer(vehicle)]
        found += [thrust, upright, dot(omega, omega), dot(moment, moment)]
        for limit in columns.derived:
            measured = limit.quantity.measured
            weights = [*measured[WRENCH], *measured[WRENCH_RATE], measured[UPRIGHT]]
            found.append(_weighted(weights, (*wrench, *rate, upright)))
        along = 0.5 * (alpha[0][2] + beta[0][2])
        found += [along * self.axis(limit.quantity.path[2]) for limit in columns.on_thrust]
        return found + [self.axis(each) for each in np.eye(3) if columns.with_axis]

    def axis(self, direction: Array) -> Bounded:
        """Return the component of the thrust axis along a direction (3,)."""
        off = self.attitude_error * float(np.linalg.norm(direction))
        along = self.polynomials(self.body_polynomials(direction)[2]).bounded() * self.per_square
        return along.with_error(off)

    def _inverse(self, coefficient: float, along: Bounded) -> Bounded:
        """Return 1/α_z or 1/β_z, given `along` = α_z or β_z."""
        whole = self.polynomials(self.body_polynomials(self.dragged(coefficient, 0)[0])[2])
        least = whole.least() / self.squared.bound()
        return along.inverse(least)


def _weighted(weights: Sequence[float], terms: Sequence[Scalar]) -> Bounded:
    """Return the sum of weights times terms."""
    nothing: Bounded = 0.0 * terms[0]
    return sum((float(w) * term for w, term in zip(weights, terms, strict=True) if w != 0.0), nothing)


def _remainder(column: Bounded, motion: _Motion) -> Array:
    """Return the largest interpolation error of a quantity without rounding, (P,)."""
    decay, _ = chebyshev.tails(motion.basis.degree, RHO[1:])
    return np.asarray((column.bound[:, 1:] * decay).min(axis=1))


def _is_rough(bounded: Sequence[Bounded], motion: _Motion, columns: SeriesColumns) -> Mask:
    """Tell on which pieces the interpolation error of values or derived limits is too large, (P,)."""
    stated = len(motion.curve.vehicle.rotors) + 4
    scales = columns.scale(motion.curve.vehicle)[: stated + len(columns.derived)]
    rough = np.zeros(len(motion.pieces), dtype=bool)
    for i, (column, scale) in enumerate(zip(bounded, scales, strict=False)):
        tolerance = MAX_REMAINDER if i < stated else MAX_COMMAND_REMAINDER
        size = np.maximum(scale, column.bound[:, 0])
        rough |= ~(_remainder(column, motion) <= tolerance * size)
    return rough


def _from(curve: ThrustCurve, pieces: Subintervals, count: int) -> tuple[TimeInterval, ...]:
    """Return the interval from the end of the first `count` pieces to the end of the trajectory, if any."""
    if count == len(pieces):
        return ()
    starts, _ = pieces[count : count + 1].spans(curve.trajectory)
    return (TimeInterval(float(starts[0]), float(curve.trajectory.duration)),)
