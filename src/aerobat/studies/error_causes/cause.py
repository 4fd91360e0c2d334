"""Causes of error as values: what each changes in how a maneuver is planned and flown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import AfterValidator

from aerobat.control import Controller
from aerobat.declaration import AS_IT_IS, Label, declared
from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.planning import Planner
from aerobat.studies.lens import lens


def _read_only(changes: Mapping[str, Any]) -> Mapping[str, Any]:
    return MappingProxyType(dict(changes))


@declared
class Trial:
    """The settings by which a maneuver is planned and flown; causes change them."""

    planner: Annotated[Planner, AS_IT_IS]
    conditions: Dispersion
    controller: Controller
    vehicle_known: bool = True  # by the planner; false: it plans for none, and no rotor has a limit


@declared
class Cause:
    """A cause of error: the fields of a Trial that it changes, by their paths.

    As `Cause("jerk", {"planner.order": 3})`, `Cause("late", {"conditions.computation_delay": 0.01})` or
    `Cause("rotors unknown to the plan", {"vehicle_known": False})`.
    """

    name: Label
    changes: Annotated[Mapping[str, Any], AfterValidator(_read_only)]  # values by paths of fields

    def applied(self, trial: Trial) -> Trial:
        """The trial with this cause in it.

        Raises SpecError for a path that names no field, and for a value that the field does not take.
        """
        for path, value in self.changes.items():
            trial = lens(path, trial).set(trial, value)
        return trial


def together(causes: Iterable[Cause], name: str) -> Cause:
    """All causes as one. Raises SpecError where two change the same: they are not independent."""
    changes: dict[str, Any] = {}
    owners: dict[str, str] = {}
    for cause in causes:
        for path, value in cause.changes.items():
            for other, owner in owners.items():
                if owner != cause.name and _overlap(path, other):
                    raise SpecError(
                        f"causes '{owner}' and '{cause.name}' both change {path}; make them one, or drop one"
                    )
            changes[path], owners[path] = value, cause.name
    return Cause(name, changes)


def _overlap(path: str, other: str) -> bool:
    """True where one path is the other, or leads into it."""
    return f"{path}.".startswith(f"{other}.") or f"{other}.".startswith(f"{path}.")
