"""Trajectory: position as piecewise polynomials with a heading, its derivatives and their exact extrema."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from aerobat.arrays import Array, frozen, numbers
from aerobat.declaration import AS_IT_IS, Angle, FieldError, Positive, by_value, short, shown, validated
from aerobat.errors import SpecError
from aerobat.states import FlatState
from aerobat.trajectory import polynomial

TIME_TOLERANCE = 1e-9  # [s] by which a time may lie outside a trajectory
MAX_DEGREE = 30  # higher powers of normalised time cannot be distinguished in float64
MAX_MAGNITUDE = 1e30  # [m/s^k] of a derivative up to snap: products of several do not overflow
MAX_DURATION = 1e6  # [s], eleven days
MAX_SAMPLES = 10_000_000
KNOT_TOLERANCE = 1e-12  # [s] a time this close before a knot counts as on it


@runtime_checkable
class HasTrajectory(Protocol):
    """An object with a trajectory, for instance a plan."""

    @property
    def trajectory(self) -> Trajectory:
        """The trajectory."""


Carrier = Annotated[HasTrajectory, AS_IT_IS, Field(description="plan")]


def as_trajectory(flown: Trajectory | HasTrajectory) -> Trajectory:
    """Return the trajectory itself, or the trajectory of a plan."""
    return flown if isinstance(flown, Trajectory) else flown.trajectory


@dataclass(frozen=True)
class Extremum:
    """The extreme value of a quantity along a trajectory, and the time at which it occurs."""

    value: float
    time: float  # [s]


@validated
@short
@by_value
class Trajectory:
    """Position over time, p(t) = Σ_k c_k s^k with s = (t - knot)/T on each segment; starts at t = 0.

    Neighbouring segments may differ in every derivative. At a knot the values are those of the segment that
    begins there; `on_segments` returns both sides. SpecError is raised for durations that are not positive,
    for numbers that are not finite or unreasonably large, and for shapes that do not match.

    The initial attitude is the smallest rotation from upright to the thrust, turned about the thrust by the
    heading. From there the attitude is carried along without spin. `yaw` additionally turns the body about
    its thrust axis, by polynomials in the same s.
    """

    durations: Array  # [s], (S,)
    coefficients: Array  # [m], (S, degree + 1, 3), powers of normalised time rising
    heading: Angle = 0.0  # [rad] about the thrust axis at the start
    # [rad] relative to the frame without spin, (S, any), powers rising; None: no spin
    yaw: Array | None = None

    def __post_init__(self) -> None:
        """Copy, check and write-protect the arrays."""
        durations = frozen(self.durations, "durations", (None,))
        coefficients = frozen(self.coefficients, "coefficients", (None, None, 3))
        if durations.ndim != 1 or durations.size == 0 or not (durations > 0).all():
            raise SpecError("durations must be a list of at least one positive number of seconds")
        if coefficients.ndim != 3 or coefficients.shape[0] != len(durations) or coefficients.shape[1] == 0:
            raise SpecError(
                f"coefficients must have the shape (segments, degree + 1, 3) with {len(durations)} "
                f"segments as in durations, got {coefficients.shape}"
            )
        if coefficients.shape[1] > MAX_DEGREE + 1:
            raise SpecError(
                f"coefficients must be of degree {MAX_DEGREE} at most, got {coefficients.shape[1] - 1}; "
                "cut long polynomials into segments"
            )
        _check_magnitude(durations, coefficients)
        if self.yaw is not None:
            yaw = frozen(self.yaw, "yaw", (None, None))
            if yaw.ndim != 2 or len(yaw) != len(durations) or not 0 < yaw.shape[1] <= MAX_DEGREE + 1:
                raise SpecError(f"yaw must have the shape ({len(durations)}, degree + 1), got {yaw.shape}")
            object.__setattr__(self, "yaw", yaw)
        object.__setattr__(self, "durations", durations)
        object.__setattr__(self, "coefficients", coefficients)
        object.__setattr__(self, "heading", float(self.heading))

    @classmethod
    @validated
    def from_inputs(
        cls, initial: ArrayLike, inputs: ArrayLike, dt: ArrayLike, heading: Angle = 0.0
    ) -> Trajectory:
        """Integrate exactly a chain of r integrators whose input is constant on each interval.

        For r = 3 (jerk input) this is the paper's Section II. SpecError is raised for other shapes.

        Args:
            initial: Position, velocity, ... at t = 0 [m/s^k], world, (r, 3).
            inputs: The r-th derivative of position on each interval [m/s^r], world, (N, 3).
            dt: Duration of an interval [s]: one number for all, or (N,).
            heading: The trajectory's heading [rad].
        """
        state = frozen(initial, "initial", (None, 3))
        inputs = frozen(inputs, "inputs", (None, 3))
        steps = frozen(dt, "dt")
        fits = steps.shape in ((), inputs.shape[:1]) and state.ndim == inputs.ndim == 2
        if not fits or not len(state) or not len(inputs) or (steps <= 0).any():
            raise SpecError("from_inputs needs initial (r, 3), inputs (N, 3) and a positive dt, or N of them")
        steps = np.broadcast_to(steps, len(inputs))
        if not steps.sum() <= MAX_DURATION or not np.abs(inputs).max() <= MAX_MAGNITUDE:
            raise SpecError(
                f"inputs must last {MAX_DURATION:g} s at most, got {steps.sum():g} s, and stay below "
                f"{MAX_MAGNITUDE:g} m/s^k; check distances, limits and their units"
            )
        # scaled by dt^k/k!, the derivatives at an interval's start are its coefficients, and those at its end
        # are the same polynomial expanded about s = 1
        order = len(state)
        factorials = np.array([math.factorial(k) for k in range(order + 1)])
        scale = (steps[:, None] ** np.arange(order + 1) / factorials)[..., None]
        pascal = np.array([[math.comb(j, k) for j in range(order + 1)] for k in range(order)], dtype=float)
        coefficients = np.empty((len(inputs), order + 1, 3))
        coefficients[:, order] = scale[:, order] * inputs
        coefficients[0, :order] = scale[0, :order] * state
        for n in range(1, len(inputs)):
            longer = (steps[n] / steps[n - 1]) ** np.arange(order)[:, None]
            coefficients[n, :order] = longer * (pascal @ coefficients[n - 1])
        return cls(steps, coefficients, heading)

    def __str__(self) -> str:
        """Return a short description."""
        return f"Trajectory({self.segments} segments of degree {self.degree}, {self.duration:.6g} s)"

    @property
    def segments(self) -> int:
        """The number of polynomial segments."""
        return len(self.durations)

    @property
    def degree(self) -> int:
        """The degree of the polynomials."""
        return int(self.coefficients.shape[1]) - 1

    @cached_property
    def knots(self) -> Array:
        """The times at which segments begin, and the end [s], (S + 1,)."""
        knots = np.concatenate([[0.0], np.cumsum(self.durations)])
        knots.flags.writeable = False
        return knots

    @property
    def duration(self) -> float:
        """The time from start to end [s]."""
        return float(self.knots[-1])

    def evaluate(self, t: ArrayLike, derivative: int = 0) -> Array:
        """Return d^k p/dt^k at the times t [s] (...), world, (..., 3); at a knot, of the later segment.

        SpecError is raised for times outside [0, duration], with a tolerance of a nanosecond.
        """
        segment, s = self._locate(t)
        return polynomial.evaluate(self._rates(derivative)[segment], s)

    def flat(self, t: ArrayLike) -> FlatState:
        """Return position to snap at the times t [s] (...). Raise SpecError as `evaluate` does."""
        segment, s = self._locate(t)
        return FlatState(*(polynomial.evaluate(self._rates(k)[segment], s) for k in range(5)))

    def yaw_rates(self, t: ArrayLike) -> Array:
        """Return the yaw relative to the frame without spin [rad], and two derivatives, (..., 3)."""
        segment, s = self._locate(t)
        return np.stack(
            [polynomial.evaluate(self.yaw_polynomials(k)[segment], s)[..., 0] for k in range(3)], -1
        )

    def yaw_polynomials(self, derivative: int) -> Array:
        """Return coefficients of a derivative of the yaw [rad/s^k] on each segment, (S, K, 1)."""
        yaw = np.zeros((self.segments, 1)) if self.yaw is None else self.yaw
        return (
            polynomial.differentiate(yaw[..., None], derivative) / self.durations[:, None, None] ** derivative
        )

    def on_segments(self, s: ArrayLike, derivative: int = 0) -> Array:
        """Return d^k p/dt^k at the normalised times s (k,) of every segment, (S, k, 3).

        With s = 0 and 1 the result contains both sides of every knot.
        """
        return polynomial.evaluate(self._rates(derivative)[:, None], _normalised(s))

    @validated
    def sample(self, rate: Positive) -> Array:
        """Return the times 0, 1/rate, 2/rate, ... [s], and the end, even if the last step is shorter."""
        whole_steps = max(math.floor((self.duration - TIME_TOLERANCE) * rate), 0)
        if whole_steps > MAX_SAMPLES:
            raise SpecError(f"rate must ask for {MAX_SAMPLES} samples at most, {rate!r} asks {whole_steps}")
        return np.append(np.arange(whole_steps + 1) / rate, self.duration)

    def jumps(self, derivative: int) -> Array:
        """Return the norm of the jump of d^k p/dt^k at each inner knot, (S - 1,)."""
        ends = self.on_segments([0.0, 1.0], derivative)
        return np.asarray(np.linalg.norm(ends[1:, 0] - ends[:-1, 1], axis=-1))

    def effort(self, derivative: int) -> float:
        """Return ∫ |d^k p/dt^k|² dt over the whole trajectory, exactly."""
        derivative = _whole(derivative)
        quadratic = polynomial.gram(self.degree, derivative)
        per_segment = np.einsum("sid,ij,sjd->s", self.coefficients, quadratic, self.coefficients)
        return float(np.sum(per_segment / self.durations ** (2 * derivative - 1)))

    def peak(self, derivative: int) -> Extremum:
        """Return the largest |d^k p/dt^k| over continuous time, from roots of the square's derivative."""
        return self._extrema(self._rates(derivative))[1]

    def component_range(self, derivative: int) -> tuple[Array, Array]:
        """Return the minimum and maximum of each component of d^k p/dt^k over continuous time, (3,) each."""
        values = []
        for axis in range(3):
            component = self._rates(derivative)[..., axis : axis + 1]
            # of the square; its additional points, the zeros, do no harm
            s = polynomial.stationary_points(component)
            values.append(polynomial.evaluate(component[:, None], s).ravel())
        return np.min(values, axis=1), np.max(values, axis=1)

    @validated
    def specific_thrust_range(
        self, gravity: Annotated[float, Field(ge=0, le=1e9)]
    ) -> tuple[Extremum, Extremum]:
        """Return the minimum and maximum of |a + g e3| [m/s²] over continuous time, exactly."""
        thrust = self._rates(2).copy()
        thrust[:, 0, 2] += gravity
        return self._extrema(thrust)

    def _rates(self, derivative: int) -> Array:
        """Return coefficients of d^k p/dt^k on each segment, (S, K, 3)."""
        derivative = _whole(derivative)
        scale = self.durations[:, None, None] ** derivative
        return np.asarray(polynomial.differentiate(self.coefficients, derivative) / scale)

    def _locate(self, t: ArrayLike) -> tuple[NDArray[np.intp], Array]:
        """Return the segment of each time and the normalised time in it. Raise SpecError outside."""
        times = numbers(t, "times")
        if not ((times >= -TIME_TOLERANCE) & (times <= self.duration + TIME_TOLERANCE)).all():
            raise SpecError(f"times must lie in [0, {self.duration:.9g}] s, the trajectory's span")
        times = np.clip(times, 0.0, self.duration)
        segment = np.asarray(np.searchsorted(self.knots[1:-1] - KNOT_TOLERANCE, times, side="right"))
        return segment, (times - self.knots[segment]) / self.durations[segment]

    def _extrema(self, coefficients: Array) -> tuple[Extremum, Extremum]:
        """Return the minimum and maximum norm of segment polynomials (S, K, 3), with their times."""
        s = polynomial.stationary_points(coefficients)
        norms = np.linalg.norm(polynomial.evaluate(coefficients[:, None], s), axis=-1)
        times = self.knots[:-1, None] + s * self.durations[:, None]
        smallest, largest = norms.argmin(), norms.argmax()
        return (
            Extremum(float(norms.flat[smallest]), float(times.flat[smallest])),
            Extremum(float(norms.flat[largest]), float(times.flat[largest])),
        )


def _whole(derivative: int) -> int:
    """Return the order of a derivative. Raise SpecError if it is invalid; higher derivatives are zero."""
    is_whole = isinstance(derivative, int | np.integer) and not isinstance(derivative, bool)
    if not is_whole or not 0 <= derivative <= MAX_DEGREE + 1:
        complaint = f"must be a whole number from 0 to {MAX_DEGREE + 1}, got {shown(derivative)}"
        raise FieldError("derivative", complaint)
    return int(derivative)


def _normalised(s: ArrayLike) -> Array:
    """Return normalised times. Raise SpecError outside [0, 1]."""
    times = numbers(s, "s")
    if not ((times >= 0.0) & (times <= 1.0)).all():
        raise SpecError("s must lie in [0, 1], from a segment's start to its end")
    return times


def _check_magnitude(durations: Array, coefficients: Array) -> None:
    """Raise SpecError for unreasonably large numbers, whose squares would overflow."""
    if not durations.sum() <= MAX_DURATION:
        raise SpecError(f"durations must add up to {MAX_DURATION:g} s at most, got {durations.sum():g} s")
    powers = np.arange(coefficients.shape[1])
    bound = np.ones_like(powers, dtype=float)
    for derivative in range(5):
        with np.errstate(all="ignore"):
            sizes = np.einsum("skd,k->s", np.abs(coefficients), bound) / durations**derivative
        if not (sizes <= MAX_MAGNITUDE).all():  # infinite and NaN neither
            raise SpecError(
                f"coefficients and durations must keep every derivative below {MAX_MAGNITUDE:g} m/s^k, "
                f"segment {int(np.argmin(sizes <= MAX_MAGNITUDE))} does not; check their units"
            )
        bound = bound * np.maximum(powers - derivative, 0)
