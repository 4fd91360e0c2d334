"""What flies: a rigid body with rotors, checked when it is made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, fields
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PlainValidator

from aerobat.arrays import Array, frozen
from aerobat.declaration import (
    FieldError,
    Label,
    Limit,
    NonNegative,
    Positive,
    Vector3,
    declared,
    door,
    finite,
    from_table,
    unknown_key,
)
from aerobat.errors import SpecError
from aerobat.states import STANDARD_GRAVITY

_ROUNDING = 1e-9  # [-] relative: inertias are written with a few digits


def _inertia(value: Any) -> Array:
    """The matrix, of itself or of three principal moments."""
    vector = np.ndim(value) == 1 if hasattr(value, "__array__") else not _is_matrix(value)
    return finite(np.diag(finite(value, 3)) if vector else value, 3, 3)


def _no_truth(value: Any) -> Any:
    """The value; Python takes True for 1."""
    if isinstance(value, bool):
        raise FieldError("", f"must be 1 or -1, got {value}")
    return value


@declared
class Rotor:
    """A motor with its propeller, thrust along the body's +z, first-order in its command.

    Raises SpecError, naming the field, for values that no rotor has.
    """

    position_body: Vector3  # [m] from the centre of mass
    spin: Annotated[
        Literal[1, -1], BeforeValidator(_no_truth)
    ]  # 1 counter-clockwise seen from above, -1 clockwise; the body feels -spin·c·f about +z
    min_thrust: float  # [N] negative for a variable pitch
    max_thrust: Positive  # [N] at full throttle
    torque_coefficient: NonNegative  # [m] c: N·m of drag torque per N of thrust
    lag: NonNegative  # [s] time constant; zero for a thrust that follows its command at once
    radius: Positive  # [m] of the propeller

    def __post_init__(self) -> None:
        if not self.min_thrust < self.max_thrust:
            raise FieldError(
                "min_thrust",
                f"must be below max_thrust, got {self.min_thrust:g} N and {self.max_thrust:g} N",
            )


@declared
class Vehicle:
    """A multirotor: one rigid body, n >= 4 rotors, linear drag.

    Raises SpecError, naming the field, for what cannot be a vehicle; whether it can hover depends on where,
    see `require_hover`.
    """

    name: Label  # left out in a file, the file's
    mass: Positive  # [kg] of all
    inertia: Annotated[
        Array, PlainValidator(_inertia), Field(description="three principal moments, or a 3 x 3 matrix")
    ]  # [kg·m²] about the centre of mass, body axes
    rotors: tuple[Rotor, ...]  # four or more
    drag_body: Vector3 = field(default_factory=lambda: np.zeros(3))  # [kg/s] force_body = -drag_body·v_body
    max_body_rate: Limit = np.inf  # [rad/s] the largest norm of ω
    description: str = ""  # where its numbers come from

    SHORTHANDS: ClassVar[Mapping[str, str]] = {"rotor_defaults": "any keys of rotors, for all of them"}

    def __post_init__(self) -> None:
        _check_inertia(self.inertia)
        if (self.drag_body < 0).any():
            raise FieldError("drag_body", f"must not be negative, got {self.drag_body.tolist()} kg/s")
        if len(self.rotors) < 4:
            raise FieldError("rotors", f"must be 4 or more, got {len(self.rotors)}")
        _check_rank(self.allocation)
        self._check_balance()

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Make every rotor, with the keys of `rotor_defaults` that it lacks."""
        defaults = table.pop("rotor_defaults", {})
        if not isinstance(defaults, Mapping):
            raise FieldError("rotor_defaults", "must be a table; begin it with [rotor_defaults]")
        keys = [each.name for each in fields(Rotor)]
        for key in defaults:
            if key not in keys:
                raise unknown_key(key, keys).inside("rotor_defaults")
        if isinstance(rotors := table.get("rotors"), list | tuple):
            table["rotors"] = tuple(_rotor(rotor, defaults, f"rotors[{i}]") for i, rotor in enumerate(rotors))
        return table

    def abbreviate(self, table: dict[str, Any]) -> dict[str, Any]:
        """Write a diagonal inertia as its moments, and once what all rotors share."""
        if not (self.inertia - np.diag(np.diag(self.inertia))).any():
            table["inertia"] = np.diag(self.inertia).tolist()
        rotors = table.pop("rotors")
        shared = {key: value for key, value in rotors[0].items() if all(r[key] == value for r in rotors)}
        own = [{key: value for key, value in rotor.items() if key not in shared} for rotor in rotors]
        return table | {"rotor_defaults": shared, "rotors": own}

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

    @door
    def require_hover(self, gravity: Positive) -> None:
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
            raise FieldError(
                "rotors",
                f"cannot hold a level hover: rotors[{i}] would bear {fractions[i]:.2g} of the weight, "
                f"but gives {self.min_thrusts[i]:.4g} N or more; check position_body, spin, limits",
            )


def _is_matrix(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(value) > 0 and isinstance(value[0], list | tuple)


def _rotor(table: Any, defaults: Mapping[str, Any], place: str) -> Any:
    """The rotor of a table and what it lacks. Raises FieldError, naming where the value at fault stands."""
    if not isinstance(table, Mapping):
        return table
    for each in fields(Rotor):
        if each.name not in table and each.name not in defaults:
            complaint = "is missing; add it there or, for all rotors, in [rotor_defaults]"
            raise FieldError(f"{place}.{each.name}", complaint)
    try:
        return from_table(Rotor, {**defaults, **table})
    except FieldError as error:
        key = error.field.partition("[")[0]
        raise error.inside("rotor_defaults" if key in defaults and key not in table else place) from None


def _check_inertia(inertia: Array) -> None:
    if not np.allclose(inertia, inertia.T, rtol=0, atol=_ROUNDING * np.abs(inertia).max()):
        raise FieldError("inertia", "must be symmetric; give its products of inertia twice, mirrored")
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    if smallest <= 0:
        raise FieldError(
            "inertia", f"must be positive definite; its smallest principal moment is {smallest:.4g} kg·m²"
        )
    if largest > (smallest + middle) * (1 + _ROUNDING):
        raise FieldError(
            "inertia",
            "belongs to no rigid body: its largest principal moment exceeds the sum of the others, "
            f"{largest:.4g} > {smallest:.4g} + {middle:.4g} kg·m²; check the values",
        )


def _check_rank(allocation: Array) -> None:
    """All of thrust, roll, pitch and yaw must be had independently; rows differ in unit, so are scaled."""
    sizes = np.abs(allocation).max(axis=1, keepdims=True)
    rank = np.linalg.matrix_rank(allocation / np.where(sizes > 0, sizes, 1.0))
    if rank < 4:
        raise FieldError(
            "rotors",
            "must give thrust, roll, pitch and yaw independently, but their allocation has rank "
            f"{rank} instead of 4; vary position_body, spin or torque_coefficient",
        )
