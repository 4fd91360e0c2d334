"""An axis of a map: the name of a field, and the values that it takes."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, isfinite

import numpy as np

from aerobat.declaration import shown
from aerobat.errors import SpecError

MAX_CELLS = 10_000  # cells of a map: hours of planning


@dataclass(frozen=True)
class Axis:
    """The name of a field, and its values in order."""

    name: str
    values: tuple[float, ...]
    unit: str = ""  # of the values

    @property
    def label(self) -> str:
        """The name with the unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @classmethod
    def of(cls, name: str, values: object) -> Axis:
        """Return the axis of a sequence of numbers. Raises SpecError unless they are finite and distinct."""
        try:
            row = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            row = np.zeros((0, 0))
        if row.ndim != 1 or not np.isfinite(row).all():
            raise SpecError(
                f"over: the values of {name} must be finite numbers in a row, got {shown(values)}"
            )
        if not len(row) or len(row) > MAX_CELLS:
            raise SpecError(f"over: {name} must have from 1 to {MAX_CELLS} values, got {len(row)}")
        if len(set(row.tolist())) < len(row):
            raise SpecError(f"over: {name} has a value twice; give each once")
        return cls(name, tuple(row.tolist()))

    @classmethod
    def parse(cls, text: str) -> Axis:
        """Parse an axis from text: NAME=FIRST:LAST:STEP, or NAME= and values separated by commas."""
        name, separator, numbers = text.partition("=")
        name = name.strip()
        if not separator or not name or not numbers.strip():
            raise SpecError(f"over: give a field and its values, as speed=2:20:2, got {shown(text)}")
        if ":" not in numbers:
            return cls.of(name, [_number(each, text) for each in numbers.split(",")])
        parts = [_number(each, text) for each in numbers.split(":")]
        if len(parts) != 3:
            raise SpecError(f"a range is FIRST:LAST:STEP, as speed=2:20:2, got {shown(text)}")
        return cls(name, _range(name, *parts))


def _number(text: str, whole: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    if not isfinite(number):
        raise SpecError(f"{shown(text)} is no finite number in {shown(whole)}; give one, as speed=2:20:2")
    return number


def _range(name: str, first: float, last: float, step: float) -> tuple[float, ...]:
    """Return the values from first to last in equal steps; last is included if a step ends there."""
    if step == 0.0:
        raise SpecError(f"the step of {name} is 0; give another, or one value, as {name}={first:g}")
    steps = (last - first) / step + 1e-9  # may be infinite
    if steps < 0.0:
        raise SpecError(
            f"the range of {name} is empty: steps of {step:g} do not lead from {first:g} to {last:g}; "
            "turn it round"
        )
    if steps >= MAX_CELLS:
        count = f"{floor(steps) + 1}" if isfinite(steps) else "too many"
        raise SpecError(f"{name} has {count} values, {MAX_CELLS} at most are allowed; take a larger step")
    values = (first + k * step for k in range(floor(steps) + 1))
    return tuple(round(value, 12) + 0.0 for value in values)  # steps of 0.1 add up to 0.3
