"""Lenses: read and change the fields that a study varies, by the names that files use.

`limits.velocity`, `gate.tilt_deg`, `gates[1].position.z`, `maneuver.passage.speed` are fields of a problem.
`vehicle.mass`, `planner.reserve`, `conditions.gusts.mean_wind` begin with their owner. The last part alone
names a field if no other field ends so, as `speed`. Two names are no fields of their own: `angle`, the tilt
of a half-flip's gate [deg], and `vehicle.thrust_to_weight`, which changes the rotors' fields.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from math import degrees, radians
from typing import Any, TypeVar

import numpy as np

from aerobat.declaration import FieldError, from_table, shown, unknown_key, within_field
from aerobat.declaration.sentences import closest
from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.planning import Planner
from aerobat.problem import Gate, Heading, Problem
from aerobat.problem.heading import HeadingMode
from aerobat.studies.units import DEGREES, unit_of
from aerobat.vehicle import Vehicle

GATE = "gate"  # in files, the only entry of `gates`
PROBLEM = "problem"  # prefix that may be left out of the names of its fields
ANGLE = "angle"
MAX_ANGLE = 90.0  # [deg] largest tilt of a half-flip's gate
THRUST_TO_WEIGHT = "thrust_to_weight"
ALL_ROTORS = "rotor_defaults"  # in files, the fields that all rotors share
AXES = ("x", "y", "z")
FEW = 4  # largest number of names listed in a sentence
_PART = re.compile(r"([^\W\d]\w*)((?:\[\d{1,6}\])*)")  # one part of a dotted name, as gates[0]

Key = str | int
Varied = TypeVar("Varied")


@dataclass(frozen=True)
class Scenario:
    """A problem with vehicle, planner and conditions: all that a study may vary."""

    problem: Problem
    vehicle: Vehicle
    planner: Planner | None = None  # None: the planner that suits the problem
    conditions: Dispersion | None = None  # None: flights without disturbances


@dataclass(frozen=True)
class Lens:
    """A field of a `Scenario`, or of another dataclass of values, that a study varies."""

    name: str  # as given by the user
    keys: tuple[Key, ...]  # keys that lead to the field from the outermost value

    @property
    def place(self) -> str:
        """The full name of the field."""
        return _joined(self.keys[self.keys[0] == PROBLEM :])

    @property
    def unit(self) -> str:
        """The unit of the field, empty where it has none."""
        return unit_of(tuple(key for key in self.keys if isinstance(key, str)))

    def get(self, whole: Any) -> Any:
        """Return the field's value; a vector if one number may stand for all of its entries."""
        value = whole
        for key in self.keys:
            value = _inner(value, key)
        return value

    def set(self, whole: Varied, value: Any) -> Varied:
        """Return a copy of the whole with this field at a value.

        Raises FieldError: for `place`, where the field cannot take the value; for another field, where that
        field contradicts the value.
        """
        try:
            return _changed(whole, self.keys, value)  # type: ignore[no-any-return]
        except FieldError as error:
            raise FieldError(error.field.removeprefix(f"{PROBLEM}."), error.complaint) from None

    def require(self, whole: Any, values: Sequence[float]) -> None:
        """Raise SpecError for a field that is no number, and for values that the field cannot take."""
        with within_field(self.place):
            _require_number(self.get(whole), len(self.keys) > 1 and self._takes_number(whole))
        for value in values:
            try:
                self.set(whole, value)
            except FieldError as error:
                if error.field in (self.place, re.sub(rf"(\[\d\]|{DEGREES})$", "", self.place)):
                    raise SpecError(f"{self.name} at {value:g}: {error}") from None

    def _takes_number(self, whole: Any) -> bool:
        """Return True for a vector for which one number may stand, as for limits per axis."""
        try:
            self.set(whole, 1)
        except FieldError:
            return False
        return isinstance(self.keys[-1], str)


def lens(name: str, whole: Any) -> Lens:
    """Return the lens for a field's name.

    Args:
        name: As in files: limits.velocity, gates[0].width, vehicle.mass, conditions.gusts.mean_wind.
        whole: The value that has the field: a Scenario, or another dataclass of values.

    Raises SpecError, which suggests the nearest name, where there is no such field.
    """
    keys = _parsed(name)
    problem: Problem | None = getattr(whole, PROBLEM, None)
    if keys == (ANGLE,) and problem is not None:
        problem.maneuver.with_gate_tilt(problem.gates, 0.0)
        return Lens(name, (PROBLEM, ANGLE))
    roots = [field.name for field in fields(whole)]
    if problem is not None:
        if len(keys) == 1 and keys[0] not in (*roots, *_names(problem), GATE):
            keys = _only(name, whole)
        if keys[0] not in roots:
            keys = (PROBLEM, *keys)
        if keys[:2] == (PROBLEM, GATE) and len(problem.gates) == 1:
            keys = (PROBLEM, "gates", 0, *keys[2:])
    try:
        return Lens(name, _found(whole, keys))
    except FieldError as error:
        raise FieldError(error.field.removeprefix(f"{PROBLEM}."), error.complaint) from None


def _parsed(name: str) -> tuple[Key, ...]:
    """Return the keys of a dotted name. Raises SpecError for text that is no dotted name."""
    keys: list[Key] = []
    for part in name.split("."):
        match = _PART.fullmatch(part)
        if match is None:
            raise SpecError(
                f"{shown(name)} is no field's name; give one as limits.velocity or gates[0].width"
            )
        keys += [match[1], *map(int, re.findall(r"\d+", match[2]))]
    return tuple(keys)


def _joined(keys: Sequence[Key]) -> str:
    """Return the keys as a dotted name."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys).removeprefix(".")


def _only(name: str, whole: Any) -> tuple[Key, ...]:
    """Return the keys of the only field whose last part is `name`. Raises SpecError for none or several."""
    known = list(_leaves(whole, ()))
    meant = [keys for keys in known if keys[-1] == name]
    if not meant:
        guess = closest(name, [ANGLE, *(str(keys[-1]) for keys in known)])
        remedy = f"did you mean {guess!r}?" if guess else "give one as limits.velocity or vehicle.mass"
        raise SpecError(f"no field named {shown(name)}; {remedy}")
    if len(meant) > 1:
        names = " or ".join(Lens(name, keys).place for keys in meant[:FEW])
        more = f" or one of {len(meant) - FEW} more" if len(meant) > FEW else ""
        raise SpecError(f"{name} may be {names}{more}; give the whole name")
    return meant[0]


def _leaves(value: Any, keys: tuple[Key, ...]) -> Iterator[tuple[Key, ...]]:
    """Yield the keys of all numbers and vectors of a declared value; of rotors only the shared fields."""
    for name in _names(value):
        inner = _inner(value, name)
        if is_dataclass(inner):
            yield from _leaves(inner, (*keys, name))
        elif isinstance(inner, tuple) and any(map(is_dataclass, inner)):
            for i, each in enumerate(inner if name != "rotors" else ()):
                yield from _leaves(each, (*keys, name, i)) if is_dataclass(each) else ()
        elif not isinstance(inner, str | bool):
            yield *keys, name


def _names(value: Any) -> list[str]:
    """Return the names of a declared value's fields, with the names of angles in degrees and shorthands."""
    names = [field.name for field in fields(value)]
    names += [key for key in getattr(value, "SHORTHANDS", ()) if key.removesuffix(DEGREES) in names]
    if isinstance(value, Gate):
        names += Gate.ANGLES
    return [*names, THRUST_TO_WEIGHT, ALL_ROTORS] if isinstance(value, Vehicle) else names


def _found(value: Any, keys: Sequence[Key]) -> tuple[Key, ...]:
    """Return the keys of a field, with components as indices. Raises FieldError where there is none."""
    if not keys:
        return ()
    key, rest = keys[0], keys[1:]
    if isinstance(value, tuple | np.ndarray):
        key = AXES.index(key) if isinstance(value, np.ndarray) and key in AXES else key
        if not isinstance(key, int) or key >= len(value):
            raise FieldError("", f"has no {_joined([key])}; give a number from [0] to [{len(value) - 1}]")
    elif not is_dataclass(value):
        said = "is not given; give it first" if value is None else f"is {shown(value)}, it has no fields"
        raise FieldError("", said)
    elif key not in _names(value):
        raise unknown_key(_joined([key]), _names(value))
    with within_field(_joined([key])):
        return key, *_found(_inner(value, key), rest)


def _require_number(value: Any, takes_one: bool) -> None:
    """Raise FieldError unless a value is a number, None, or a vector for which one number may stand."""
    is_vector = isinstance(value, np.ndarray) and value.ndim == 1
    if (is_vector and takes_one) or value is None:
        return
    if not isinstance(value, int | float) or isinstance(value, bool):
        remedy = f"one of its numbers, as {AXES[0]} or [0]" if is_vector else "a number of it"
        raise FieldError("", f": this is {shown(value)}, which cannot be varied; name {remedy}")


def _inner(value: Any, key: Key) -> Any:
    """Return the value at a key."""
    if isinstance(key, int):
        inner = value[key]
        return inner.item() if isinstance(inner, np.generic) else inner
    if isinstance(value, Gate) and key in Gate.ANGLES:
        return degrees(value.angles[Gate.ANGLES.index(key)])
    if key == ALL_ROTORS:
        return value.rotors[0]
    if isinstance(value, Problem) and key == ANGLE:
        return degrees(value.gates[0].angles[2])
    if not hasattr(value, key):
        angle = getattr(value, key.removesuffix(DEGREES))
        return angle if angle is None else degrees(angle)
    return getattr(value, key)


def _changed(value: Any, keys: Sequence[Key], new: Any) -> Any:
    """Return a copy of the value with the field at the end of the keys changed. Raises FieldError."""
    if not keys:
        is_whole = isinstance(new, float) and new.is_integer()
        return int(new) if is_whole else new  # files write whole numbers as integers
    key, rest = keys[0], keys[1:]
    with within_field(_joined([key])):
        if key == ALL_ROTORS:
            key, inner = "rotors", tuple(_changed(rotor, rest, new) for rotor in value.rotors)
        else:
            inner = _changed(_inner(value, key), rest, new)
    if isinstance(key, int):
        changed = [*value[:key], inner, *value[key + 1 :]]
        return np.array(changed) if isinstance(value, np.ndarray) else tuple(changed)
    return _with_field(value, key, inner)


def _with_field(value: Any, name: str, inner: Any) -> Any:
    """Return a copy of the declared value with one of its `_names`, or angle, changed. Raises FieldError."""
    if name == THRUST_TO_WEIGHT:
        if inner <= 0:
            raise FieldError(name, f"must be positive, got {inner:g}")
        return value.with_thrust_to_weight(inner)
    if isinstance(value, Problem) and name == ANGLE:
        if not abs(inner) <= MAX_ANGLE:
            raise FieldError(ANGLE, f"must be from {-MAX_ANGLE:g} to {MAX_ANGLE:g} degrees, got {inner:g}")
        return _with_field(value, "gates", value.maneuver.with_gate_tilt(value.gates, radians(inner)))
    if not hasattr(value, "__checked_init__"):  # a plain dataclass of values that are themselves checked
        changes: dict[str, Any] = {name: inner}
        return replace(value, **changes)
    table = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Gate) and name in Gate.ANGLES:
        angles = {key: _inner(value, key) for key in Gate.ANGLES}
        del table["normal"], table["up"]
        return from_table(Gate, table | angles | {name: inner})
    if name not in table:
        name, inner = name.removesuffix(DEGREES), radians(inner)
        if isinstance(table[name], Heading) and table[name].mode is not HeadingMode.FREE:
            inner = _with_field(table[name], "start", inner)
    return from_table(type(value), table | {name: inner})
