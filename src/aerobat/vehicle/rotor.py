"""A motor with its propeller, and the data sheet values by which it may be specified."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import pi
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import BeforeValidator

from aerobat.arrays import Array
from aerobat.declaration.declared import declared
from aerobat.declaration.field_types import Finite, NonNegative, Positive, Vector3, finite, number, positive
from aerobat.declaration.sentences import FieldError, shown, within_field

RAD_PER_S = 2 * pi / 60  # [rad/s] per revolution per minute
WITH_TORQUE = 3  # number of columns of a thrust curve with torques


def _no_truth(value: Any) -> Any:
    """Return the value. Raises FieldError for True and False, which Python would take for 1 and 0."""
    if isinstance(value, bool):
        raise FieldError("", f"must be 1 or -1, got {value}")
    return value


@declared
class Rotor:
    """A motor with its propeller, thrust along the body's +z, first-order in its command.

    A rotor with `max_thrust` 0 is dead: it has mass but gives no thrust. Raises SpecError, naming the field,
    for values that no rotor can have.
    """

    position_body: Vector3  # [m] from the centre of mass; in a file, from where `centre_of_mass` is counted
    spin: Annotated[
        Literal[1, -1], BeforeValidator(_no_truth)
    ]  # 1 counter-clockwise seen from above, -1 clockwise; the body feels -spin·c·f about +z
    min_thrust: Finite  # [N] negative for a variable pitch
    max_thrust: NonNegative  # [N] at full throttle; 0 for a rotor that has failed
    torque_coefficient: NonNegative  # [m] c: N·m of drag torque per N of thrust
    lag: NonNegative  # [s] time constant; zero for a thrust that follows its command at once
    radius: Positive  # [m] of the propeller

    SHORTHANDS: ClassVar[Mapping[str, str]] = {
        "k_f": "[N/(rad/s)²] thrust over speed squared",
        "k_m": "[N·m/(rad/s)²] drag torque over speed squared: with k_f, instead of torque_coefficient",
        "max_rpm": "[1/min] highest speed: with k_f, instead of max_thrust",
        "min_rpm": "[1/min] lowest speed, idle: with k_f, instead of min_thrust",
        "thrust_curve": "rows [command, N] or [command, N, N·m] of a thrust stand, commands (rpm, throttle) "
        "rising from idle to full: instead of min_thrust, max_thrust and, with torques, torque_coefficient",
    }

    def __post_init__(self) -> None:
        if self.is_dead and self.min_thrust != 0.0:
            raise FieldError("min_thrust", f"must be 0 where max_thrust is, got {self.min_thrust:g} N")
        if not (self.is_dead or self.min_thrust < self.max_thrust):
            raise FieldError(
                "min_thrust", f"must be below max_thrust, got {self.min_thrust:g} N and {self.max_thrust:g} N"
            )

    @property
    def is_dead(self) -> bool:
        """True for a rotor that gives no thrust."""
        return self.max_thrust == 0.0

    @classmethod
    def expand(cls, table: dict[str, Any]) -> dict[str, Any]:
        """Replace speeds and their coefficients, or a thrust curve, by thrusts and a torque coefficient."""
        return rotor_table(table, {})


class _KeyedValue(NamedTuple):
    """A value that a table gives for a field, and the key that gives it."""

    field: str
    key: str
    value: Any
    is_own: bool  # true: from the rotor's own table; false: from the defaults


def rotor_table(own: Mapping[str, Any], defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a rotor, from its own keys and, where it has none, from those of the defaults.

    A rotor whose own `max_thrust` is 0 is dead, whatever its other keys say about thrust. Raises FieldError
    for shorthands that lack one another, and where two keys of one table give the same field.
    """
    if own.get("max_thrust") == 0:
        own, defaults = _of_dead_rotor(own, defaults)
    merged = {**defaults, **own}
    table: dict[str, _KeyedValue] = {}
    for source in (
        *_plain(own, True),
        *_plain(defaults, False),
        *_of_speeds(merged, own),
        *_of_curve(merged, own),
    ):
        known = table.get(source.field)
        if known is not None and known.is_own == source.is_own:
            by = " and by ".join("itself" if key == source.field else key for key in (known.key, source.key))
            raise FieldError(source.field, f"is given twice, by {by}; leave one of them out")
        if known is None or source.is_own:
            table[source.field] = source
    return {name: source.value for name, source in table.items()}


def _of_dead_rotor(
    own: Mapping[str, Any], defaults: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the tables without keys for thrusts; a thrust curve is kept if only it gives torques."""
    speeds = ("min_rpm", "max_rpm")
    own = {key: value for key, value in own.items() if key not in speeds} | {"min_thrust": 0.0}
    defaults = {key: value for key, value in defaults.items() if key not in speeds}
    curve = own.pop("thrust_curve", None)
    if curve is not None and not {"torque_coefficient", "k_m"} & {*own, *defaults}:
        defaults["thrust_curve"] = curve
    return own, defaults


def _plain(table: Mapping[str, Any], is_own: bool) -> Iterator[_KeyedValue]:
    """Yield the keys that are fields, and unknown keys."""
    for key, value in table.items():
        if key not in Rotor.SHORTHANDS:
            yield _KeyedValue(key, key, value, is_own)


def _of_speeds(table: Mapping[str, Any], own: Mapping[str, Any]) -> Iterator[_KeyedValue]:
    """Yield thrusts f = k_f ω² at the limits of speed, and the torque coefficient c = k_m / k_f."""
    needing = [key for key in ("max_rpm", "min_rpm", "k_m") if key in table]
    if not needing:
        return
    if "k_f" not in table:
        raise FieldError("k_f", f"is missing; {needing[0]} says nothing without it")
    k_f = positive(table["k_f"], "k_f")
    for key, name in (("max_rpm", "max_thrust"), ("min_rpm", "min_thrust")):
        if key in table:
            yield _KeyedValue(
                name, key, k_f * (_not_negative(table, key) * RAD_PER_S) ** 2, key in own or "k_f" in own
            )
    if "k_m" in table:
        yield _KeyedValue(
            "torque_coefficient", "k_m", _not_negative(table, "k_m") / k_f, "k_m" in own or "k_f" in own
        )


def _of_curve(table: Mapping[str, Any], own: Mapping[str, Any]) -> Iterator[_KeyedValue]:
    """Yield the end points of a thrust curve, and the least-squares torque per thrust of its rows."""
    key = "thrust_curve"
    if key not in table:
        return
    with within_field(key):
        rows = _curve(table[key])
    yield _KeyedValue("min_thrust", key, float(rows[0, 1]), key in own)
    yield _KeyedValue("max_thrust", key, float(rows[-1, 1]), key in own)
    if rows.shape[1] == WITH_TORQUE:
        thrust, torque = rows[:, 1], rows[:, 2]
        yield _KeyedValue("torque_coefficient", key, float(thrust @ torque / (thrust @ thrust)), key in own)


def _curve(value: Any) -> Array:
    """Return the rows of a thrust curve, (rows, 2 or 3)."""
    if not isinstance(value, list | tuple) or len(value) < 2:
        raise FieldError("", f"must be two rows or more, got {shown(value)}")
    columns = WITH_TORQUE if isinstance(value[0], list | tuple) and len(value[0]) == WITH_TORQUE else 2
    rows = finite(value, len(value), columns)
    for column, name in ((0, "commands"), (1, "thrusts")):
        falling = np.diff(rows[:, column]) <= 0.0
        if falling.any():
            raise FieldError(
                f"[{int(np.argmax(falling)) + 1}]",
                f"must continue the rise: {name}, column {column}, go from idle to full throttle",
            )
    return rows


def _not_negative(table: Mapping[str, Any], key: str) -> float:
    value = number(table[key], key)
    if value < 0.0:
        raise FieldError(key, f"must be 0 or more, got {value:g}")
    return value
