"""Numbers of a problem and its vehicle by the names that their files use: found, and changed.

`limits.velocity`, `gate.tilt_deg`, `gates[1].position.z`, `maneuver.passage.speed`, `vehicle.mass`; the last
part alone where no other field has it, as `speed`. Beside those there are `angle`, the tilt of a half-flip's
gate [deg], and `vehicle.thrust_to_weight`, which spans the rotors' fields.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from math import degrees, radians
from typing import Any

import numpy as np

from aerobat.declaration import FieldError, from_table, shown, unknown_key, within_field
from aerobat.declaration.sentences import closest
from aerobat.errors import SpecError
from aerobat.problem import Gate, Problem
from aerobat.studies.feasibility.units import DEGREES, unit_of
from aerobat.vehicle import Vehicle

VEHICLE = "vehicle"  # begins the names of the vehicle's fields
GATE = "gate"  # in files, the only one of `gates`
ANGLE = "angle"
MAX_ANGLE = 90.0  # [deg] of a half-flip's gate
THRUST_TO_WEIGHT = "thrust_to_weight"
ALL_ROTORS = "rotor_defaults"  # in files, what all rotors share
AXES = ("x", "y", "z")
FEW = 4  # names in a sentence
_PART = re.compile(r"([^\W\d]\w*)((?:\[\d{1,6}\])*)")  # between the points of a name, as gates[0]

Key = str | int


@dataclass(frozen=True)
class Scenario:
    """A problem, and what shall fly it."""

    problem: Problem
    vehicle: Vehicle


@dataclass(frozen=True)
class Field:
    """A number of a scenario, by its name."""

    name: str  # as it was given
    keys: tuple[Key, ...]  # that lead to it from the problem or, behind "vehicle", from that

    @classmethod
    def of(cls, name: str, scenario: Scenario) -> Field:
        """The field of a name. Raises SpecError, which names the nearest, where there is no such number."""
        problem, keys = scenario.problem, _parsed(name)
        if keys == (ANGLE,):
            problem.maneuver.with_gate_tilt(problem.gates, 0.0)
            return cls(name, keys)
        if len(keys) == 1 and keys[0] not in (VEHICLE, *_names(problem)):
            keys = _only(name, scenario)
        if keys[0] == GATE and len(problem.gates) == 1:
            keys = ("gates", 0, *keys[1:])
        prefix = keys[:1] if keys[0] == VEHICLE else ()
        with within_field(_joined(prefix)):
            found = _found(scenario.vehicle if prefix else problem, keys[len(prefix) :])
        return cls(name, (*prefix, *found))

    @property
    def place(self) -> str:
        """The whole name of the field."""
        return _joined(self.keys)

    @property
    def unit(self) -> str:
        """The unit of the field, empty where it has none."""
        if self.keys == (ANGLE,):
            return "°"
        of_vehicle = self.keys[0] == VEHICLE
        names = tuple(key for key in self.keys[of_vehicle:] if isinstance(key, str))
        return unit_of(names, of_vehicle)

    def changed(self, scenario: Scenario, value: float) -> Scenario:
        """The scenario with this field at a value.

        Raises FieldError: about `place` for a value that the field cannot take, about another one where the
        two contradict each other.
        """
        if self.keys == (ANGLE,):
            return Scenario(_tilted(scenario.problem, value), scenario.vehicle)
        if self.keys[0] != VEHICLE:
            return Scenario(_changed(scenario.problem, self.keys, value), scenario.vehicle)
        with within_field(VEHICLE):
            return Scenario(scenario.problem, _changed(scenario.vehicle, self.keys[1:], value))

    def require(self, scenario: Scenario, values: Sequence[float]) -> None:
        """Refuse values that the field cannot take, whatever the others are. Raises SpecError."""
        for value in values:
            try:
                self.changed(scenario, value)
            except FieldError as error:
                if error.field in (self.place, re.sub(rf"(\[\d\]|{DEGREES})$", "", self.place)):
                    raise SpecError(f"{self.name} at {value:g}: {error}") from None


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
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys).removeprefix(".")


def _only(name: str, scenario: Scenario) -> tuple[Key, ...]:
    """The keys of the one field whose last part is a name. Raises SpecError where none or several have it."""
    known = [*_leaves(scenario.problem, ()), *_leaves(scenario.vehicle, (VEHICLE,))]
    meant = [keys for keys in known if keys[-1] == name]
    if not meant:
        guess = closest(name, [ANGLE, *(str(keys[-1]) for keys in known)])
        remedy = f"did you mean {guess!r}?" if guess else "give one as limits.velocity or vehicle.mass"
        raise SpecError(f"no field named {shown(name)}; {remedy}")
    if len(meant) > 1:
        names = " or ".join(map(_joined, meant[:FEW]))
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
    """The keys that lead to a number, components by their numbers. Raises FieldError where there is none."""
    if not keys:
        if value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
            return ()
        whole = isinstance(value, np.ndarray) and value.ndim == 1
        remedy = f"one of its numbers, as {AXES[0]} or [0]" if whole else "a number of it"
        raise FieldError("", f": this is {shown(value)}, which cannot be varied; name {remedy}")
    key, rest = keys[0], keys[1:]
    if isinstance(value, tuple | np.ndarray):
        key = AXES.index(key) if isinstance(value, np.ndarray) and key in AXES else key
        if not isinstance(key, int) or key >= len(value):
            raise FieldError("", f"has no {_joined([key])}; give a number from [0] to [{len(value) - 1}]")
    elif not is_dataclass(value):
        said = "is not given; give it first" if value is None else "has no fields of its own"
        raise FieldError("", said)
    elif key not in _names(value):
        raise unknown_key(_joined([key]), _names(value))
    inner = _inner(value, key)
    if isinstance(inner, np.ndarray) and not rest and isinstance(key, str) and _takes_number(value, key):
        return (key,)
    with within_field(_joined([key])):
        return key, *_found(inner, rest)


def _takes_number(value: Any, name: str) -> bool:
    """True for a vector for which one number stands too, as for limits per axis."""
    try:
        _with(value, name, 1)
    except FieldError:
        return False
    return True


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


def _changed(value: Any, keys: Sequence[Key], number: float) -> Any:
    """The value with the number at the end of keys at another. Raises FieldError."""
    if not keys:
        return int(number) if float(number).is_integer() else number
    key, rest = keys[0], keys[1:]
    with within_field(_joined([key])):
        if key == ALL_ROTORS:
            key, inner = "rotors", tuple(_changed(rotor, rest, number) for rotor in value.rotors)
        else:
            inner = _changed(_inner(value, key), rest, number)
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
    table = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Gate) and name in Gate.ANGLES:
        angles = {key: _inner(value, key) for key in Gate.ANGLES}
        del table["normal"], table["up"]
        return from_table(Gate, table | angles | {name: inner})
    if name not in table:
        name, inner = name.removesuffix(DEGREES), radians(inner)
    return from_table(type(value), table | {name: inner})


def _tilted(problem: Problem, angle: float) -> Problem:
    """The problem with the gate of its half-flip at another tilt [deg]. Raises FieldError."""
    if not abs(angle) <= MAX_ANGLE:
        raise FieldError(ANGLE, f"must be from {-MAX_ANGLE:g} to {MAX_ANGLE:g} degrees, got {angle:g}")
    gates = problem.maneuver.with_gate_tilt(problem.gates, radians(angle))
    return _with(problem, "gates", gates)  # type: ignore[no-any-return]
