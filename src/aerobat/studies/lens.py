"""Lenses: fields by the names that files use, looked up and changed in whatever a study varies.

`limits.velocity`, `gate.tilt_deg`, `gates[1].position.z`, `maneuver.passage.speed` are a problem's;
`vehicle.mass`, `planner.reserve`, `conditions.gusts.mean_wind` begin with what they are of. The last part
alone stands for a field where no other field has it, as `speed`. Beside those there are `angle`, the tilt of
a half-flip's gate [deg], and `vehicle.thrust_to_weight`, which spans the rotors' fields.
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

GATE = "gate"  # in files, the only one of `gates`
PROBLEM = "problem"  # whose fields need not be said to be its
ANGLE = "angle"
MAX_ANGLE = 90.0  # [deg] of a half-flip's gate
THRUST_TO_WEIGHT = "thrust_to_weight"
ALL_ROTORS = "rotor_defaults"  # in files, what all rotors share
AXES = ("x", "y", "z")
FEW = 4  # names in a sentence
_PART = re.compile(r"([^\W\d]\w*)((?:\[\d{1,6}\])*)")  # between the points of a name, as gates[0]

Key = str | int
Varied = TypeVar("Varied")


@dataclass(frozen=True)
class Scenario:
    """A problem, what shall fly it, and how that is planned and flown: what a study may vary."""

    problem: Problem
    vehicle: Vehicle
    planner: Planner | None = None  # None for the one that suits the problem
    conditions: Dispersion | None = None  # None for flights as planned


@dataclass(frozen=True)
class Lens:
    """A field of what a study varies, which is a dataclass of values, as `Scenario`."""

    name: str  # as it was given
    keys: tuple[Key, ...]  # that lead to it from the outermost

    @property
    def place(self) -> str:
        """The whole name of the field."""
        return _joined(self.keys[self.keys[0] == PROBLEM :])

    @property
    def unit(self) -> str:
        """The unit of the field, empty where it has none."""
        if self._is_angle:
            return "°"
        return unit_of(tuple(key for key in self.keys if isinstance(key, str)))

    def get(self, whole: Any) -> Any:
        """Return the field's value; a vector where one number stands for all of its entries."""
        if self._is_angle:
            return degrees(whole.problem.gates[0].angles[2])
        value = whole
        for key in self.keys:
            value = _inner(value, key)
        return value

    def set(self, whole: Varied, value: Any) -> Varied:
        """Return the whole with this field at a value.

        Raises FieldError: about `place` for a value that the field cannot take, about another one where the
        two contradict each other.
        """
        if self._is_angle:
            return _with(whole, PROBLEM, _tilted(_inner(whole, PROBLEM), value))  # type: ignore[no-any-return]
        try:
            return _changed(whole, self.keys, value)  # type: ignore[no-any-return]
        except FieldError as error:
            raise FieldError(error.field.removeprefix(f"{PROBLEM}."), error.complaint) from None

    def require(self, whole: Any, values: Sequence[float]) -> None:
        """Refuse a field that is no number, and values that it cannot take. Raises SpecError."""
        if not self._is_angle:
            with within_field(self.place):
                _require_number(self.get(whole), len(self.keys) > 1 and self._takes_number(whole))
        for value in values:
            try:
                self.set(whole, value)
            except FieldError as error:
                if error.field in (self.place, re.sub(rf"(\[\d\]|{DEGREES})$", "", self.place)):
                    raise SpecError(f"{self.name} at {value:g}: {error}") from None

    @property
    def _is_angle(self) -> bool:
        return self.keys == (ANGLE,)

    def _takes_number(self, whole: Any) -> bool:
        """True for a vector for which one number stands too, as for limits per axis."""
        try:
            self.set(whole, 1)
        except FieldError:
            return False
        return isinstance(self.keys[-1], str)


def lens(name: str, whole: Any) -> Lens:
    """Return the lens on the field of a name.

    Args:
        name: As in files: limits.velocity, gates[0].width, vehicle.mass, conditions.gusts.mean_wind.
        whole: What holds the field: a Scenario, or another dataclass of values.

    Raises SpecError, which names the nearest, where there is no such field.
    """
    keys = _parsed(name)
    problem: Problem | None = getattr(whole, PROBLEM, None)
    if keys == (ANGLE,) and problem is not None:
        problem.maneuver.with_gate_tilt(problem.gates, 0.0)
        return Lens(name, keys)
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
    """The keys of a dotted name. Raises SpecError for what is none."""
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
    """The keys as a dotted name."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys).removeprefix(".")


def _only(name: str, whole: Any) -> tuple[Key, ...]:
    """The keys of the one field whose last part is a name. Raises SpecError where none or several have it."""
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
    """The keys of all numbers, and vectors, of a declared value; of rotors those that all share."""
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
    """The names of a declared value's fields, those of angles in degrees and of several together."""
    names = [field.name for field in fields(value)]
    names += [key for key in getattr(value, "SHORTHANDS", ()) if key.removesuffix(DEGREES) in names]
    if isinstance(value, Gate):
        names += Gate.ANGLES
    return [*names, THRUST_TO_WEIGHT, ALL_ROTORS] if isinstance(value, Vehicle) else names


def _found(value: Any, keys: Sequence[Key]) -> tuple[Key, ...]:
    """The keys that lead to a field, components by their numbers. Raises FieldError where there is none."""
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
    """Refuse a value that is no number, None, or a vector for which one number stands. Raises FieldError."""
    is_vector = isinstance(value, np.ndarray) and value.ndim == 1
    if (is_vector and takes_one) or value is None:
        return
    if not isinstance(value, int | float) or isinstance(value, bool):
        remedy = f"one of its numbers, as {AXES[0]} or [0]" if is_vector else "a number of it"
        raise FieldError("", f": this is {shown(value)}, which cannot be varied; name {remedy}")


def _inner(value: Any, key: Key) -> Any:
    """The value behind a key."""
    if isinstance(key, int):
        inner = value[key]
        return inner.item() if isinstance(inner, np.generic) else inner
    if isinstance(value, Gate) and key in Gate.ANGLES:
        return degrees(value.angles[Gate.ANGLES.index(key)])
    if key == ALL_ROTORS:
        return value.rotors[0]
    if not hasattr(value, key):
        angle = getattr(value, key.removesuffix(DEGREES))
        return angle if angle is None else degrees(angle)
    return getattr(value, key)


def _changed(value: Any, keys: Sequence[Key], new: Any) -> Any:
    """The value with the field at the end of keys at another. Raises FieldError."""
    if not keys:
        is_whole = isinstance(new, float) and new.is_integer()
        return int(new) if is_whole else new  # whole numbers are no floats in files
    key, rest = keys[0], keys[1:]
    with within_field(_joined([key])):
        if key == ALL_ROTORS:
            key, inner = "rotors", tuple(_changed(rotor, rest, new) for rotor in value.rotors)
        else:
            inner = _changed(_inner(value, key), rest, new)
    if isinstance(key, int):
        changed = [*value[:key], inner, *value[key + 1 :]]
        return np.array(changed) if isinstance(value, np.ndarray) else tuple(changed)
    return _with(value, key, inner)


def _with(value: Any, name: str, inner: Any) -> Any:
    """The declared value with one of its `_names` at another. Raises FieldError."""
    if name == THRUST_TO_WEIGHT:
        if inner <= 0:
            raise FieldError(name, f"must be positive, got {inner:g}")
        return value.with_thrust_to_weight(inner)
    if not hasattr(value, "__checked_init__"):  # a plain dataclass, of values that are checked themselves
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
            inner = _with(table[name], "start", inner)
    return from_table(type(value), table | {name: inner})


def _tilted(problem: Problem, angle: float) -> Problem:
    """The problem with the gate of its half-flip at another tilt [deg]. Raises FieldError."""
    if not abs(angle) <= MAX_ANGLE:
        raise FieldError(ANGLE, f"must be from {-MAX_ANGLE:g} to {MAX_ANGLE:g} degrees, got {angle:g}")
    gates = problem.maneuver.with_gate_tilt(problem.gates, radians(angle))
    return _with(problem, "gates", gates)  # type: ignore[no-any-return]
