"""Causes of error as values: the changes that each makes to planning and flight; the paper's four causes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import radians
from types import MappingProxyType
from typing import Annotated, Any

from pydantic import AfterValidator

from aerobat.control import Controller
from aerobat.declaration import AS_IT_IS, Label, declared
from aerobat.environment import Dispersion, HandOff
from aerobat.errors import SpecError
from aerobat.planning import Planner
from aerobat.studies.lens import lens

OFFSET, TURN = 0.05, radians(2.0)  # [m], [rad] of the second camera system, as by an old calibration
DETUNING = 1.5  # factor by which the loops of the detuned controller are slower than tuned


def _read_only(changes: Mapping[str, Any]) -> Mapping[str, Any]:
    return MappingProxyType(dict(changes))


@declared
class Trial:
    """The settings by which a maneuver is planned and flown; causes change them."""

    planner: Annotated[Planner, AS_IT_IS]
    conditions: Dispersion
    controller: Controller
    vehicle_known: bool = True  # to the planner; false: it plans without a vehicle, so without rotor limits


@declared
class Cause:
    """A cause of error: the fields of a Trial that it changes, by their paths.

    As `Cause("jerk", {"planner.order": 3})`, `Cause("late", {"conditions.computation_delay": 0.01})` or
    `Cause("rotors unknown to the plan", {"vehicle_known": False})`.
    """

    name: Label
    changes: Annotated[Mapping[str, Any], AfterValidator(_read_only)]  # values by paths of fields

    def applied(self, trial: Trial) -> Trial:
        """Return the trial with this cause applied.

        Raises SpecError for a path that names no field, and for a value that the field does not take.
        """
        for path, value in self.changes.items():
            trial = lens(path, trial).set(trial, value)
        return trial


def together(causes: Iterable[Cause], name: str) -> Cause:
    """Return all causes as one. Raises SpecError where two of them change the same field."""
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
    """Return True where the paths are equal, or one path leads into the other."""
    return f"{path}.".startswith(f"{other}.") or f"{other}.".startswith(f"{path}.")


def four_causes(conditions: Dispersion, controller: Controller) -> tuple[Cause, ...]:
    """Return four causes: rotors unknown to the plan, a bad hand-off, jerk as the input, detuned gains.

    They suit a planner whose `order` is 4 or more. Raises SpecError for conditions without motion capture,
    which have no hand-off.
    """
    capture = conditions.motion_capture
    if capture is None:
        raise SpecError(
            f"conditions '{conditions.name}' have no motion capture, whose hand-off is a cause; take lab"
        )
    hand_off = replace(capture.hand_off or HandOff(), translation=OFFSET, rotation=TURN)
    return (
        Cause("rotors not known", {"vehicle_known": False}),
        Cause("hand-off 5 cm, 2°", {"conditions.motion_capture.hand_off": hand_off}),
        Cause("jerk as input", {"planner.order": 3}),
        Cause(
            "gains not tuned",
            {
                "controller.position_gain": controller.position_gain / DETUNING**2,
                "controller.velocity_gain": controller.velocity_gain / DETUNING,
                "controller.integral_gain": controller.integral_gain / DETUNING**3,
                "controller.attitude_frequency": controller.attitude_frequency / DETUNING,
                "controller.attitude_integral_gain": controller.attitude_integral_gain / DETUNING**3,
            },
        ),
    )
