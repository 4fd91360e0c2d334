"""The vehicle: a rigid body with rotors, checked when it is made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, PlainValidator

from aerobat.arrays import Array, frozen
from aerobat.declaration import (
    FieldError,
    Label,
    Limit,
    Positive,
    Vector3,
    declared,
    finite,
    from_table,
    missing_fields,
    unknown_key,
    validated,
    within_field,
)
from aerobat.errors import Reason, SpecError
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle.controller import Controller
from aerobat.vehicle.ellipsoid import ENCLOSING_TOLERANCE, Ellipsoid, about_rotors
from aerobat.vehicle.hover import mixing_matrix, outside, overloaded, strength_weighted, why_no_hover
from aerobat.vehicle.rotor import Rotor, rotor_table

_ROUNDING = 1e-9  # [-] relative tolerance: files write inertias with a few digits


def _inertia(value: Any) -> Array:
    """Return the inertia matrix, from itself or from three principal moments."""
    vector = np.ndim(value) == 1 if hasattr(value, "__array__") else not _is_matrix(value)
    return finite(np.diag(finite(value, 3)) if vector else value, 3, 3)


@declared
class Vehicle:
    """A multirotor: one rigid body, n >= 4 rotors, linear drag.

    Raises SpecError, naming the field, for values that no vehicle can have. Whether the vehicle can hover
    depends on gravity, see `require_hover`.
    """

    name: Label  # left out in a file, the file's
    mass: Positive  # [kg] of all
    inertia: Annotated[
        Array, PlainValidator(_inertia), Field(description="three principal moments, or a 3 x 3 matrix")
    ]  # [kg·m²] about the centre of mass, body axes
    rotors: tuple[Rotor, ...]  # four or more
    drag_body: Vector3 = field(default_factory=lambda: np.zeros(3))  # [kg/s] force_body = -drag_body·v_body
    max_body_rate: Limit = np.inf  # [rad/s] the largest norm of ω
    # what encloses it, propellers included, and passes gates; a flat one about the rotors unless given
    body: Ellipsoid | None = None
    # what tracks its paths, where a flight names no other
    controller: Controller = Controller()
    description: str = ""  # where its numbers come from

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "rotor_defaults": "any keys of rotors, for all of them",
        "centre_of_mass": "[m] where the centre of mass lies, in the axes and from the origin from which "
        "position_body and the body's centre are then counted ([0, 0, 0])",
    }

    def __post_init__(self) -> None:
        _check_inertia(self.inertia)
        if (self.drag_body < 0).any():
            raise FieldError("drag_body", f"must not be negative, got {self.drag_body.tolist()} kg/s")
        if len(self.rotors) < 4:
            raise FieldError("rotors", f"must be 4 or more, got {len(self.rotors)}")
        if not self.dead_rotors:  # otherwise see `without_dead_rotors`
            self._check_control()
        if self.body is not None:
            _check_enclosed(self.body, self.rotors)

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Make every rotor about the centre of mass, with the keys of `rotor_defaults` that it lacks."""
        defaults = table.pop("rotor_defaults", {})
        if not isinstance(defaults, Mapping):
            raise FieldError("rotor_defaults", "must be a table; begin it with [rotor_defaults]")
        keys = [*(each.name for each in fields(Rotor)), *Rotor.SHORTHANDS]
        for key in defaults:
            if key not in keys:
                raise unknown_key(key, keys).inside("rotor_defaults")
        if isinstance(rotors := table.get("rotors"), list | tuple):
            table["rotors"] = tuple(_rotor(rotor, defaults, f"rotors[{i}]") for i, rotor in enumerate(rotors))
        if "centre_of_mass" in table:
            with within_field("centre_of_mass"):
                centre = finite(table.pop("centre_of_mass"), 3)
            table["rotors"] = tuple(_about(centre, rotor) for rotor in table.get("rotors", ()))
            if isinstance(body := table.get("body"), Mapping):
                with within_field("body"):
                    body = from_table(Ellipsoid, body)
                table["body"] = replace(body, centre=body.centre - centre)
        return table

    def abbreviate(self, table: dict[str, Any]) -> dict[str, Any]:
        """Write a diagonal inertia as its moments, and keys that all rotors share once."""
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
    def thrust_ranges(self) -> Array:
        """The differences between the rotors' upper and lower limits [N], (n,)."""
        return frozen(self.max_thrusts - self.min_thrusts, "thrust_ranges")

    @cached_property
    def lags(self) -> Array:
        """The rotors' time constants [s], (n,)."""
        return frozen([rotor.lag for rotor in self.rotors], "lag")

    @cached_property
    def allocation(self) -> Array:
        """The map from rotor thrusts [N] to thrust and moments (T [N], Mx, My, Mz [N·m]), (4, n).

        Rotor i is at (x, y, z) in body axes, has its thrust f_i along +z, the spin s_i and the torque
        coefficient c_i. Then

            T = Σ f_i    Mx = Σ y_i f_i    My = -Σ x_i f_i    Mz = -Σ s_i c_i f_i.

        Mx and My follow from r × f e3 = (y f, -x f, 0). Mz follows from the drag torque: a rotor that spins
        counter-clockwise (s = +1) turns the body clockwise. Sections III and V-C of the paper use such a
        matrix.
        """
        x, y, _ = np.array([rotor.position_body for rotor in self.rotors]).T
        drag_torque = [-rotor.spin * rotor.torque_coefficient for rotor in self.rotors]
        return frozen([np.ones_like(x), y, -x, drag_torque], "allocation")

    @cached_property
    def mixer(self) -> Array:
        """The mixing matrix, an inverse of the allocation from loads to rotor thrusts, (n, 4)."""
        rotors = self.allocation, self.min_thrusts, self.max_thrusts
        weight = np.array(self.mass * STANDARD_GRAVITY)
        return frozen(strength_weighted(mixing_matrix(*rotors), *rotors, weight), "mixer")

    @cached_property
    def bounding_ellipsoid(self) -> Ellipsoid:
        """The ellipsoid that encloses vehicle and propellers: `body`, or else a flat one about the rotors."""
        return about_rotors(self.rotors) if self.body is None else self.body

    @property
    def body_radius(self) -> float:
        """The radius [m] of a ball about the centre of mass that encloses the body in any attitude."""
        body = self.bounding_ellipsoid
        return float(np.linalg.norm(body.centre) + body.semi_axes.max())

    @cached_property
    def dead_rotors(self) -> tuple[int, ...]:
        """The indices of the rotors that give no thrust, counted from 0."""
        return tuple(i for i, rotor in enumerate(self.rotors) if rotor.is_dead)

    def without_dead_rotors(self) -> Vehicle:
        """Return the vehicle that can be controlled: unchanged, or with its live rotors only.

        Raises SpecError, one sentence on what can still be controlled, where the live rotors do not suffice.
        """
        if not self.dead_rotors:
            return self
        try:
            self._check_control()
        except FieldError as error:
            raise SpecError(f"vehicle '{self.name}': {error}") from None
        rotors = tuple(rotor for rotor in self.rotors if not rotor.is_dead)
        return replace(self, rotors=rotors, body=self.bounding_ellipsoid)

    @property
    def max_specific_thrust(self) -> float:
        """The maximum specific thrust, all rotors at full thrust over mass [m/s²]."""
        return float(self.max_thrusts.sum()) / self.mass

    @property
    def thrust_to_weight(self) -> float:
        """The thrust-to-weight ratio of all rotors at full thrust, with gravity on Earth [-]."""
        return self.max_specific_thrust / STANDARD_GRAVITY

    @validated
    def with_thrust_to_weight(self, ratio: Positive) -> Vehicle:
        """Return the vehicle with maximum thrusts scaled by one factor to this thrust-to-weight ratio [-]."""
        factor = ratio / self.thrust_to_weight
        rotors = tuple(replace(rotor, max_thrust=factor * rotor.max_thrust) for rotor in self.rotors)
        return replace(self, rotors=rotors)

    def __str__(self) -> str:
        about_axes = ", ".join(f"{value:.3g}" for value in np.diag(self.inertia))
        facts = (
            f"{self.name}: {self.mass:.4g} kg, {len(self.rotors)} rotors, thrust-to-weight "
            f"{self.thrust_to_weight:.2f}, inertia ({about_axes}) kg·m²"
        )
        source = " ".join(self.description.split())  # on one line, whatever its line breaks
        return f"{facts}; {source}" if source else facts

    @validated
    def require_hover(self, gravity: Positive) -> None:
        """Raise SpecError, naming the rotors, unless they can hold a level hover under `gravity` [m/s²]."""
        weight = self.mass * gravity
        total = self.max_thrusts.sum()
        if total <= weight:
            sentence = (
                f"rotors cannot lift {self.name}: their max_thrust adds up to {total:.4g} N, its weight is "
                f"{weight:.4g} N; raise max_thrust or lower mass"
            )
            raise SpecError(Reason(sentence, ("max_thrust",)))
        hover = weight * self.mixer[:, 0]
        wrong = outside(hover, self.min_thrusts, self.max_thrusts)
        if wrong.any():
            i = int(np.argmax(wrong))
            sentence = (
                f"rotors cannot hold a level hover: it takes {hover[i]:.4g} N of rotors[{i}], which gives "
                f"{self.min_thrusts[i]:.4g} to {self.max_thrusts[i]:.4g} N; check position_body, spin, limits"
            )
            raise SpecError(
                Reason(sentence, ("min_thrust" if hover[i] < self.min_thrusts[i] else "max_thrust",))
            )

    def _rank(self) -> int:
        """Return how many of thrust, roll, pitch and yaw can be controlled independently."""
        allocation = self.allocation * (self.max_thrusts > 0.0)
        sizes = np.abs(allocation).max(axis=1, keepdims=True)  # rows have different units
        return int(np.linalg.matrix_rank(allocation / np.where(sizes > 0, sizes, 1.0)))

    def _control_complaint(self) -> str:
        """Return the message for rotors that cannot control thrust, roll, pitch and yaw independently."""
        must = "must give thrust, roll, pitch and yaw independently"
        axes = {"roll": self.allocation[1], "pitch": self.allocation[2]}
        lost = [name for name, arms in axes.items() if np.ptp(arms) == 0.0]
        if lost:
            return f"{must}, but they stand on one line and cannot {' or '.join(lost)}; check position_body"
        if len({rotor.spin for rotor in self.rotors}) == 1:
            turn = "counter-clockwise" if self.rotors[0].spin > 0 else "clockwise"
            return (
                f"{must}, but all {len(self.rotors)} spin alike, {turn}: nothing holds the yaw against their "
                "drag torque; let half of them spin the other way, neighbours against each other"
            )
        if not any(rotor.torque_coefficient for rotor in self.rotors):
            return f"{must}, but torque_coefficient is 0, so that none of them yaws; give the propellers' own"
        return (
            f"{must}, but those that push one way of roll or pitch all spin alike, so that turning and yaw "
            "come together; vary spin, position_body or torque_coefficient"
        )

    def _check_control(self) -> None:
        """Raise FieldError for rotors without independent control, or without any level hover."""
        limits = self.min_thrusts, self.max_thrusts
        rank = self._rank()
        if rank < 4 and not self.dead_rotors:
            raise FieldError("rotors", self._control_complaint())
        if rank < 4 or overloaded(self.mixer[:, 0], *limits).any():
            raise FieldError("rotors", why_no_hover(self.allocation, *limits))


def _is_matrix(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(value) > 0 and isinstance(value[0], list | tuple)


def _rotor(table: Any, defaults: Mapping[str, Any], place: str) -> Any:
    """Return the rotor of a table and the defaults. Raises FieldError, naming the place of a wrong value."""
    if not isinstance(table, Mapping):
        return table
    try:
        values = rotor_table(table, defaults)
        missing = [each.name for each in fields(Rotor) if each.name not in values]
        if missing:
            raise missing_fields(missing, " there or, for all rotors, in [rotor_defaults]")
        return from_table(Rotor, values)
    except FieldError as error:
        key = error.field.partition("[")[0]
        raise error.inside("rotor_defaults" if key in defaults and key not in table else place) from None


def _about(centre: Array, rotor: Any) -> Any:
    """Return a rotor with its position relative to the centre of mass."""
    return replace(rotor, position_body=rotor.position_body - centre) if isinstance(rotor, Rotor) else rotor


def _check_enclosed(body: Ellipsoid, rotors: Sequence[Rotor]) -> None:
    """Raise FieldError for a body that a propeller extends beyond."""
    for i, rotor in enumerate(rotors):
        scale = body.enclosing_scale(rotor)
        if scale > 1.0 + ENCLOSING_TOLERANCE:
            raise FieldError(
                "body",
                f"must enclose rotors[{i}] with its propeller; {scale:.3g} times its semi_axes would, or "
                "another centre",
            )


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
