"""A reader of .plan files that needs Python and NumPy alone: copy this file to where a plan is flown.

It imports nothing of Aerobat. What a file holds, and which versions of it a reader may read, is in
docs/flight-package.md. Units are SI, the world is ENU, the body FLU, quaternions (w, x, y, z), body to world.

    package = read_flight_package("flip-roll.plan")
    setpoints = package.setpoints(np.arange(0.0, package.duration, 0.01))
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from dataclasses import dataclass
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
FORMAT = "aerobat-plan-1"
MAX_SIZE = 2**26  # bytes of all arrays, unpacked: a path of half an hour at 100 segments a second
MAX_ARRAYS = 100
GRAVITY = 9.81  # [m/s²] of files that say nothing of it
STEP = 5e-4  # [s] by which the attitude is carried along: in a flip that errs by 1e-4°
UNDETERMINED = 1e-3  # of gravity: less thrust has no direction, and the attitude stays as it was


@dataclass(frozen=True, eq=False)
class Setpoints:
    """Motion, attitude and thrust that a vehicle is to have at instants."""

    times: Array  # [s], (T,)
    position: Array  # [m] world, (T, 3)
    velocity: Array  # [m/s] world, (T, 3)
    acceleration: Array  # [m/s²] world, (T, 3)
    jerk: Array  # [m/s³] world, (T, 3)
    q_world_body: Array  # (T, 4)
    omega_body: Array  # [rad/s] body, without spin about the thrust but for the yaw, (T, 3)
    thrust: Array  # [N] of all rotors, along the body's z, (T,)


@dataclass(frozen=True, eq=False)
class FlightPackage:
    """A plan: its path, and all else as the file has it."""

    durations: Array  # [s] of the segments, (S,)
    coefficients: Array  # [m] powers of normalised time rising, (S, degree + 1, 3)
    heading: float  # [rad] about the thrust at the start
    document: dict[str, Any]
    yaw: Array | None = None  # [rad] beside the attitude without spin, (S, any), powers rising

    @property
    def duration(self) -> float:
        """The duration [s]."""
        return float(self.durations.sum())

    @property
    def certified(self) -> bool:
        """True if the file says that the vehicle is proven to fly it within all limits."""
        certificate = self.document["evidence"]["certificate"]
        if certificate is None or certificate["undetermined"] or certificate["discontinuities"]:
            return False
        return all(finding["verdict"] == "holds" for finding in certificate["findings"])

    @property
    def obstacles(self) -> tuple[tuple[str, Array, Array], ...]:
        """Name, points [m] (n, 3) and rounding L [m] (3, 3) of all that is solid, in convex pieces.

        A piece is the convex hull of its points, each with all L y for |y| ≤ 1. None where the file is of a
        revision before 5, or nothing stands in the way.
        """
        pieces = self.document.get("environment", {}).get("obstacles", ())
        return tuple((each["name"], np.array(each["points"]), np.array(each["rounding"])) for each in pieces)

    def evaluate(self, times: ArrayLike, derivative: int = 0) -> Array:
        """d^k p/dt^k at times [s] (T,) in the plan, at a knot of the later segment, (T, 3)."""
        return self._evaluated(self.coefficients, times, derivative)

    def _evaluated(self, coefficients: Array, times: ArrayLike, derivative: int) -> Array:
        t = np.clip(np.atleast_1d(np.asarray(times, dtype=float)), 0.0, self.duration)
        knots = np.concatenate([[0.0], np.cumsum(self.durations)])
        segment = np.searchsorted(knots[1:-1], t, side="right")
        s = (t - knots[segment]) / self.durations[segment]
        value = np.zeros((len(t), coefficients.shape[2]))
        for power in range(coefficients.shape[1] - 1, derivative - 1, -1):
            factor = factorial(power) / factorial(power - derivative)
            value = value * s[:, None] + factor * coefficients[segment, power]
        return np.asarray(value / self.durations[segment, None] ** derivative)

    def setpoints(self, times: ArrayLike) -> Setpoints:
        """Return the set-points at times [s] (T,). Raises ValueError for a plan without a vehicle."""
        t = np.atleast_1d(np.asarray(times, dtype=float))
        vehicle = self.document["vehicle"]
        if vehicle is None:
            raise ValueError("the plan has no vehicle, from which thrust and attitude follow")
        mass, drag = vehicle["mass"], np.array(vehicle.get("drag_body", [0.0, 0.0, 0.0]))
        across = drag[:2].mean() / mass
        grid = np.union1d(np.arange(0.0, self.duration, STEP), t)
        thrust = self._specific_thrust(grid, across)
        rows = np.searchsorted(grid, t)
        q = self._carried(_directions(thrust, UNDETERMINED * self.gravity))[rows]
        yaw = np.zeros((len(self.durations), 1)) if self.yaw is None else self.yaw
        turned, spin = (self._evaluated(yaw[..., None], t, k)[:, 0] for k in (0, 1))
        q = _product(q, np.stack([np.cos(turned / 2), 0 * t, 0 * t, np.sin(turned / 2)], axis=1))
        rate = self.evaluate(t, 3) + across * self.evaluate(t, 2)
        f = np.maximum(np.linalg.norm(thrust[rows], axis=1), UNDETERMINED * self.gravity)
        turning = _rotated(_conjugate(q), rate) / f[:, None]
        omega = np.stack([-turning[:, 1], turning[:, 0], spin], axis=1)
        b3 = _rotated(q, np.array([0.0, 0.0, 1.0]))
        airspeed = ((self.evaluate(t, 1) - self.wind) * b3).sum(axis=1)
        collective = mass * (thrust[rows] * b3).sum(axis=1) + (drag[2] - mass * across) * airspeed
        position, velocity, acceleration, jerk = (self.evaluate(t, k) for k in range(4))
        return Setpoints(t, position, velocity, acceleration, jerk, q, omega, collective)

    @property
    def gravity(self) -> float:
        """Gravity [m/s²]."""
        return float(self._environment.get("gravity", GRAVITY))

    @property
    def wind(self) -> Array:
        """The velocity of the air [m/s], world, (3,)."""
        return np.array(self._environment.get("wind", [0.0, 0.0, 0.0]), dtype=float)

    @property
    def _environment(self) -> dict[str, Any]:
        """Of files of revision 0, the problem's, where what is usual is left out."""
        usual: dict[str, Any] = self.document["problem"].get("environment", {})
        found: dict[str, Any] = self.document.get("environment", usual)
        return found

    def _specific_thrust(self, times: Array, across: float) -> Array:
        """Thrust per mass [m/s²], drag across it counted, (T, 3)."""
        air = across * (self.evaluate(times, 1) - self.wind)
        return np.asarray(self.evaluate(times, 2) + air + np.array([0.0, 0.0, self.gravity]))

    def _carried(self, directions: Array) -> Array:
        """Attitudes carried along thrust directions without spin, from the heading on, (T, 3) -> (T, 4)."""
        turns = _smallest_rotations(directions[:-1], directions[1:])
        first = _smallest_rotations(np.array([[0.0, 0.0, 1.0]]), directions[:1])[0]
        about = np.array([np.cos(self.heading / 2.0), 0.0, 0.0, np.sin(self.heading / 2.0)])
        q = np.empty((len(directions), 4))
        q[0] = _product(first, about)
        for i, turn in enumerate(turns):
            q[i + 1] = _product(turn, q[i])
        return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def read_flight_package(path: str | os.PathLike[str]) -> FlightPackage:
    """The plan in a .plan file.

    Raises ValueError for another format, for a damaged file and for one that was changed after it was
    written, OSError where there is no file.
    """
    content = _arrays(path)
    found = str(content.get("format", "something else"))
    if found != FORMAT:
        raise ValueError(
            f"{path} holds {found[:40] if found.isprintable() else 'something else'}, not {FORMAT}"
        )
    if "digest" in content and str(content.pop("digest")) != _digest(content):
        raise ValueError(f"{path} was changed after it was written")
    try:
        document = json.loads(content["document"].tobytes())
        heading = float(content["heading"])
        arrays = content["durations"], content["coefficients"], heading
        package = FlightPackage(*arrays, document, content.get("yaw"))
        _require_whole(package)
    except (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError):
        raise ValueError(f"{path} is damaged") from None
    return package


def _arrays(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The arrays of an .npz file. Raises ValueError, before it is unpacked, for one that is too large."""
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = [entry.file_size for entry in archive.infolist()]
        if len(sizes) <= MAX_ARRAYS and sum(sizes) <= MAX_SIZE:
            with np.load(path, allow_pickle=False) as file:
                return dict(file)
    except OSError:
        raise
    except Exception:  # zlib, struct, tokenize, memory: a damaged archive can end in anything
        pass
    raise ValueError(f"{path} is not a whole .npz file of a plan")


def _require_whole(package: FlightPackage) -> None:
    """Refuse arrays that are no path, and a document without what is asked of it. Raises as it comes."""
    durations, coefficients, vehicle = package.durations, package.coefficients, package.document["vehicle"]
    segments, powers, axes = coefficients.shape
    shapes = [durations.shape == (segments,), axes == 3, package.wind.shape == (3,)]
    yaw = np.zeros((segments, 1)) if package.yaw is None else package.yaw
    shapes.append(yaw.ndim == 2 and len(yaw) == segments and yaw.shape[1] > 0)
    numbers: list[Any] = [yaw, durations, coefficients, package.heading, package.gravity, package.wind]
    if vehicle is not None:
        drag = vehicle.get("drag_body", [0.0, 0.0, 0.0])
        shapes.append(len(drag) == 3)
        numbers += [1.0 / vehicle["mass"], drag]
    is_finite = all(np.isfinite(each).all() for each in numbers)
    if not (segments and powers and all(shapes) and is_finite and (durations > 0.0).all()):
        raise ValueError("no path, or no vehicle")
    _ = package.certified  # reads its whole certificate


def _digest(content: dict[str, Any]) -> str:
    """The SHA-256 of arrays and their names, in the order of these."""
    found = hashlib.sha256()
    for name in sorted(content):
        found.update(name.encode() + np.ascontiguousarray(content[name]).tobytes())
    return found.hexdigest()


def _directions(thrust: Array, floor: float) -> Array:
    """Directions of the thrust; where it is below the floor, the last one."""
    norms = np.linalg.norm(thrust, axis=1)
    is_known = norms >= floor
    last = np.maximum.accumulate(np.where(is_known, np.arange(len(thrust)), 0))
    directions = thrust[last] / np.maximum(norms[last], floor)[:, None]
    return np.asarray(np.where(norms[last, None] >= floor, directions, [0.0, 0.0, 1.0]))


def _smallest_rotations(a: Array, b: Array) -> Array:
    """The smallest rotations from unit vectors to others, by half a turn about x where they are opposite."""
    q = np.concatenate([1.0 + (a * b).sum(axis=1, keepdims=True), np.cross(a, b)], axis=1)
    q[np.linalg.norm(q, axis=1) < 1e-12] = [0.0, 1.0, 0.0, 0.0]
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def _product(p: Array, q: Array) -> Array:
    scalar = p[..., :1] * q[..., :1] - (p[..., 1:] * q[..., 1:]).sum(axis=-1, keepdims=True)
    vector = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def _conjugate(q: Array) -> Array:
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def _rotated(q: Array, v: Array) -> Array:
    """Vectors turned by quaternions, (..., 3)."""
    twice = 2.0 * np.cross(q[..., 1:], v)
    return np.asarray(v + q[..., :1] * twice + np.cross(q[..., 1:], twice))
