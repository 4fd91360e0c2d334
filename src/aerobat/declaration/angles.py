"""Angles: radians in values, degrees in the tables of files, whose keys then end in `_deg`."""

from __future__ import annotations

from math import degrees, radians
from typing import Any

from aerobat.declaration.field_types import number
from aerobat.errors import SpecError


def in_radians(table: dict[str, Any], name: str) -> dict[str, Any]:
    """The table with an angle's shorthand in degrees replaced. Raises SpecError where both are given."""
    shorthand = f"{name}_deg"
    if shorthand not in table:
        return table
    if name in table:
        raise SpecError(f"{name} and {shorthand} are both given; give one of them")
    table[name] = radians(number(table.pop(shorthand), shorthand))
    return table


def in_degrees(table: dict[str, Any], name: str) -> dict[str, Any]:
    """The table with an angle in degrees where those say exactly the same."""
    angle = table.get(name, 0.0)
    for angle_deg in (round(degrees(angle), 9), degrees(angle)):
        if name in table and radians(angle_deg) == angle:
            del table[name]
            return {f"{name}_deg": angle_deg} | table
    return table
