"""What flies: a rigid body with rotors, checked when it is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array, frozen
from aerobat.errors import SpecError
from aerobat.states import STANDARD_GRAVITY

_ROUNDING = 1e-9  # [-] relative: inertias are written with a few digits


@dataclass(frozen=True, eq=False)
class Rotor:
    """A motor with its propeller, thrust along the body's +z, first-order in its command.

    Raises SpecError, beginning with the field's name, for values that no rotor has.
    """

    position_body: Array  # [m] from the centre of mass, (3,)
    spin: int  # +1 counter-clockwise seen from above, -1 clockwise; the body feels -spin·c·f about +z
    min_thrust: float  # [N]; negative for a variable pitch
    max_thrust: float  # [N]
    torque_coefficient: float  # [m] c: N·m of drag torque per N of thrust
    lag: float  # [s] time constant; zero for a thrust that follows its command at once
    radius: float  # [m] of the propeller

    def __post_init__(self) -> None:
        _set(self, "position_body", _array(self.position_body, "position_body", (3,)))
        for name in ("min_thrust", "max_thrust", "torque_coefficient", "lag", "radius"):
            _set(self, name, _number(getattr(self, name), name))
        if self.spin not in (1, -1):
            raise SpecError(
                f"spin must be 1 (counter-clockwise seen from above) or -1 (clockwise), got {self.spin!r}"
            )
        _set(self, "spin", int(self.spin))
        if not self.min_thrust < self.max_thrust:
            raise SpecError(
                f"min_thrust must be below max_thrust, got {self.min_thrust:g} N and {self.max_thrust:g} N"
            )
        if self.max_thrust <= 0:
            raise SpecError(f"max_thrust must be positive, got {self.max_thrust:g} N")
        if self.torque_coefficient < 0:
            raise SpecError(
                "torque_coefficient must not be negative (spin carries the sign), "
                f"got {self.torque_coefficient:g} m"
            )
        if self.lag < 0:
            raise SpecError(f"lag must not be negative, got {self.lag:g} s")
        _check_positive(self.radius, "radius", "m")


@dataclass(frozen=True, eq=False)
class Vehicle:
    """A multirotor: one rigid body, n >= 4 rotors, linear drag.

    Compared and hashed by identity. Raises SpecError, beginning with the field's name, for what cannot be a
    vehicle; whether it can hover depends on where, see `require_hover`.
    """

    name: str
    mass: float  # [kg]
    inertia: Array  # [kg·m²] about the centre of mass in body axes, (3, 3)
    rotors: tuple[Rotor, ...]
    drag_body: Array = field(default_factory=lambda: np.zeros(3))  # [kg/s] force_body = -drag_body·v_body
    description: str = ""  # where its numbers come from

    def __post_init__(self) -> None:
        _set(self, "mass", _number(self.mass, "mass"))
        _check_positive(self.mass, "mass", "kg")
        _set(self, "inertia", _array(self.inertia, "inertia", (3, 3)))
        _set(self, "drag_body", _array(self.drag_body, "drag_body", (3,)))
        _set(self, "rotors", tuple(self.rotors))
        _check_name(self.name)
        _check_inertia(self.inertia)
        if (self.drag_body < 0).any():
            raise SpecError(f"drag_body must not be negative, got {self.drag_body.tolist()} kg/s")
        _check_rotors(self.rotors)
        _check_rank(self.allocation)
        self._check_balance()

    @cached_property
    def min_thrusts(self) -> Array:
        """The rotors' lower limits [N], (n,)."""
        return frozen([rotor.min_thrust for rotor in self.rotors], "min_thrust")

    @cached_property
    def max_thrusts(self) -> Array:
        """The rotors' upper limits [N], (n,)."""
        return frozen([rotor.max_thrust for rotor in self.rotors], "max_thrust")

    @cached_property
    def lags(self) -> Array:
        """The rotors' time constants [s], (n,)."""
        return frozen([rotor.lag for rotor in self.rotors], "lag")

    @cached_property
    def allocation(self) -> Array:
        """The map from rotor thrusts [N] to thrust and moments (T [N], Mx, My, Mz [N·m]), (4, n).

        With rotor i at (x, y, z) in body axes, thrust f_i along +z, spin s_i and torque coefficient c_i,

            T = Σ f_i    Mx = Σ y_i f_i    My = -Σ x_i f_i    Mz = -Σ s_i c_i f_i

        since r × f e3 = (y f, -x f, 0), and since a rotor that turns counter-clockwise (s = +1) drives the
        body clockwise. Sections III and V-C of the paper use such a matrix.
        """
        x, y, _ = np.array([rotor.position_body for rotor in self.rotors]).T
        drag_torque = [-rotor.spin * rotor.torque_coefficient for rotor in self.rotors]
        return frozen([np.ones_like(x), y, -x, drag_torque], "allocation")

    @property
    def max_specific_thrust(self) -> float:
        """All rotors at full thrust, per mass [m/s²]."""
        return float(self.max_thrusts.sum()) / self.mass

    @property
    def thrust_to_weight(self) -> float:
        """All rotors at full thrust, in weights on Earth [-]."""
        return self.max_specific_thrust / STANDARD_GRAVITY

    def __str__(self) -> str:
        about_axes = ", ".join(f"{value:.3g}" for value in np.diag(self.inertia))
        facts = (
            f"{self.name}: {self.mass:.4g} kg, {len(self.rotors)} rotors, thrust-to-weight "
            f"{self.thrust_to_weight:.2f}, inertia ({about_axes}) kg·m²"
        )
        source = " ".join(self.description.split())  # one line, however it was written
        return f"{facts}; {source}" if source else facts

    def require_hover(self, gravity: float) -> None:
        """Raise SpecError, naming the rotors, unless they can hold a level hover under `gravity` [m/s²]."""
        weight = self.mass * gravity
        total = self.max_thrusts.sum()
        if total <= weight:
            raise SpecError(
                f"rotors cannot lift {self.name}: their max_thrust adds up to {total:.4g} N, its weight is "
                f"{weight:.4g} N; raise max_thrust or lower mass"
            )
        hover = weight * np.linalg.pinv(self.allocation)[:, 0]
        wrong = (hover < self.min_thrusts) | (hover > self.max_thrusts)
        if wrong.any():
            i = int(np.argmax(wrong))
            raise SpecError(
                f"rotors cannot hold a level hover: it takes {hover[i]:.4g} N of rotors[{i}], which gives "
                f"{self.min_thrusts[i]:.4g} to {self.max_thrusts[i]:.4g} N; check position_body, spin, limits"
            )

    def _check_balance(self) -> None:
        """Refuse rotors that can hold a level hover under no gravity whatever."""
        fractions = np.linalg.pinv(self.allocation)[:, 0]  # of the weight that each rotor bears
        wrong = (fractions <= _ROUNDING) & (self.min_thrusts >= 0.0)
        if wrong.any():
            i = int(np.argmax(wrong))
            raise SpecError(
                f"rotors cannot hold a level hover: rotors[{i}] would bear {fractions[i]:.2g} of the weight, "
                f"but gives {self.min_thrusts[i]:.4g} N or more; check position_body, spin, limits"
            )


def _check_name(name: str) -> None:
    if not isinstance(name, str) or not name.strip() or not name.isprintable():
        raise SpecError(f"name must be one line of text, got {name!r}")


def _check_inertia(inertia: Array) -> None:
    if not np.allclose(inertia, inertia.T, rtol=0, atol=_ROUNDING * np.abs(inertia).max()):
        raise SpecError("inertia must be symmetric; give its products of inertia twice, mirrored")
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    if smallest <= 0:
        raise SpecError(
            f"inertia must be positive definite; its smallest principal moment is {smallest:.4g} kg·m²"
        )
    if largest > (smallest + middle) * (1 + _ROUNDING):
        raise SpecError(
            "inertia belongs to no rigid body: its largest principal moment exceeds the sum of the others, "
            f"{largest:.4g} > {smallest:.4g} + {middle:.4g} kg·m²; check the values"
        )


def _check_rotors(rotors: Sequence[Rotor]) -> None:
    if len(rotors) < 4:
        raise SpecError(f"rotors must be 4 or more, got {len(rotors)}")
    for i, rotor in enumerate(rotors):
        if not isinstance(rotor, Rotor):
            raise SpecError(f"rotors[{i}] must be a Rotor, got {rotor!r}")


def _check_rank(allocation: Array) -> None:
    """All of thrust, roll, pitch and yaw must be had independently; rows differ in unit, so are scaled."""
    sizes = np.linalg.norm(allocation, axis=1, keepdims=True)
    rank = np.linalg.matrix_rank(allocation / np.where(sizes > 0, sizes, 1.0))
    if rank < 4:
        raise SpecError(
            "rotors must give thrust, roll, pitch and yaw independently, but their allocation has rank "
            f"{rank} instead of 4; vary position_body, spin or torque_coefficient"
        )


def _number(value: float, name: str) -> float:
    return float(_array(value, name, ()))


def _array(value: ArrayLike, name: str, shape: tuple[int, ...]) -> Array:
    """A frozen array of exactly this shape; a value has no leading axes."""
    array = frozen(value, name)
    if array.shape != shape:
        wanted = " x ".join(map(str, shape)) + " numbers" if shape else "one number"
        raise SpecError(f"{name} must be {wanted}, got an array of the shape {array.shape}")
    return array


def _check_positive(value: float, name: str, unit: str) -> None:
    if value <= 0:
        raise SpecError(f"{name} must be positive, got {value:g} {unit}")


def _set(instance: object, name: str, value: object) -> None:
    object.__setattr__(instance, name, value)  # frozen dataclasses normalise their fields this way
