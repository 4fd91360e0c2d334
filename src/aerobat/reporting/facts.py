"""Facts: the content of a result, from which tables, JSON, data frames and notebooks' views follow.

A kind of result has one function here or elsewhere, registered with `@facts.register`, and where it can be
drawn one more, registered with `@picture.register`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import singledispatch
from importlib import import_module
from typing import TYPE_CHECKING, Any

from aerobat.errors import SpecError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT, EXPLAIN = 0, 1  # levels of facts: the lines of a run's report, and all others
WARNING = "warning"  # the label of facts that stand last in a table
NONE = "–"  # in place of a missing number

# the packages of results, each with the module of their facts, imported with the first result
TOLD_IN = {
    "aerobat.certification": "plans",
    "aerobat.planning": "plans",
    "aerobat.simulation.autopilot": "plans",
    "aerobat.simulation": "flights",
    "aerobat.estimation": "flights",
    "aerobat.evaluation": "flights",
    "aerobat.flatness": "flights",
    "aerobat.vehicle": "vehicles",
    "aerobat.studies.compare": "comparison",
    "aerobat.studies.error_causes": "error_causes",
    "aerobat.studies.feasibility": "feasibility.facts",
    "aerobat.studies.inspection": "inspection",
    "aerobat.studies.sweep": "sweeps.facts",
    "aerobat.studies.tune": "sweeps.tuning",
}


@dataclass(frozen=True)
class Fact:
    """A fact of a result.

    A fact without a key is in tables only, a fact without label and text in files only. A text without a
    label is a line of its own, above or below a table. A value may be a result, whose facts stand in its
    place, or a sequence of results, the rows of a table.
    """

    key: str  # in JSON and data frames, ending in its unit: "duration_s"
    value: Any = None
    label: str = ""  # in tables
    text: str | None = None  # in tables; left out, the value in its form, and its unit
    unit: str = ""
    form: str = ".4g"  # of a number that is no integer
    level: int = EXPLAIN
    style: str = ""  # red: something is wrong

    @property
    def words(self) -> str:
        """The text of the fact in tables."""
        if self.text is not None:
            return self.text
        if self.value is None:
            return NONE
        if isinstance(self.value, bool):
            return "yes" if self.value else "no"
        number = f"{self.value:{self.form}}" if isinstance(self.value, float) else str(self.value)
        return f"{number} {self.unit}".rstrip()


class Facts(tuple[Fact, ...]):
    """Several facts that are one result, without a class of its own."""

    __slots__ = ()


class Columns(dict[str, Any]):
    """A table by its columns, (rows,) each; it is in data frames only, as it is too long for JSON."""


class Rows(tuple[Any, ...]):
    """A table by its rows, each a result; a table without rows is a table too."""

    __slots__ = ()


@singledispatch
def facts(result: object) -> Iterator[Fact]:
    """Yield the facts of a result. Raise SpecError for other values.

    The facts of a dataclass without a registered function are its fields, in files only.
    """
    function = _registered(facts, result)
    if function is not None:
        yield from function(result)
    elif is_dataclass(result) and not isinstance(result, type):
        yield from fields_of(result)
    else:
        raise SpecError(f"no facts are known of {type(result).__name__}; register a function that tells them")


@facts.register
def _(result: Facts) -> Iterator[Fact]:
    yield from result


@singledispatch
def picture(result: object) -> Figure | None:
    """Return the figure of a result, or None."""
    drawn = _registered(picture, result)
    return None if drawn is None else drawn(result)


def fields_of(result: Any) -> Iterator[Fact]:
    """Yield the fields of a dataclass as facts that are in files only."""
    yield from (Fact(field.name, getattr(result, field.name)) for field in fields(result))


def line(label: str, text: str, level: int = EXPLAIN, style: str = "") -> Fact:
    """Return a fact that is in tables only."""
    return Fact("", None, label, text, level=level, style=style)


def record(**values: Any) -> Iterator[Fact]:
    """Yield facts that are in files only."""
    yield from (Fact(key, value) for key, value in values.items())


def _registered(generic: Any, result: object) -> Any:
    """Import the module of `TOLD_IN` for a result, and return its registered function, or None."""
    own = generic.dispatch(object)
    for cls in type(result).__mro__:
        rooms = [room for room in TOLD_IN if f"{cls.__module__}.".startswith(f"{room}.")]
        if rooms:
            import_module(f"aerobat.reporting.{TOLD_IN[max(rooms, key=len)]}")
    found = generic.dispatch(type(result))
    return None if found is own else found
