"""The sliders of a live page: the numbers of problem, planner and vehicle that they change."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import chain
from math import degrees, radians
from typing import Any, get_type_hints

import numpy as np

from aerobat import so3
from aerobat.arrays import round_step
from aerobat.environment import Dispersion
from aerobat.errors import SpecError
from aerobat.planning import Plan, Planner
from aerobat.problem import Problem
from aerobat.problem.condition import THRUST_FRACTION
from aerobat.so3 import UP
from aerobat.studies.lens import lens
from aerobat.vehicle import Vehicle

LEAST_REACH = 0.5  # [m] least distance by which a gate can be moved to either side
STEPS = 40  # least number of steps of a slider, whose step is a round number
MAX_OBSTACLES = 12  # largest number of obstacles with sliders
PLACES = ("position", "start", "end", "origin", "points")  # fields of obstacles with their place


@dataclass(frozen=True)
class Setting:
    """The values that sliders change: problem, planner, vehicle and the conditions of flights."""

    problem: Problem
    planner: Planner
    vehicle: Vehicle
    conditions: Dispersion
    dispersion: float = 0.0  # times the conditions; at 0 it is flown as planned


@dataclass(frozen=True)
class Slider:
    """One number of a setting, and its range."""

    key: str
    group: str
    name: str
    unit: str
    low: float
    high: float
    step: float
    value: float
    axis: tuple[float, ...] | None = None  # of a gate's turn, (3,)
    move: Callable[[Setting, float], Setting] | None = None  # instead of the field that the key names

    def moved(self, setting: Setting, value: float) -> Setting:
        """Return the setting with the slider at `value`. Raise SpecError for a value that makes no sense."""
        return lens(self.key, setting).set(setting, value) if self.move is None else self.move(setting, value)

    def record(self) -> dict[str, Any]:
        """Return the slider as plain data for the page."""
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name != "move"}


def sliders_of(setting: Setting, plan: Plan) -> tuple[Slider, ...]:
    """Return the sliders of a setting, at the values of its plan."""
    gates = range(len(setting.problem.gates))
    obstacles = range(min(len(setting.problem.environment.obstacles), MAX_OBSTACLES))
    return (
        *chain.from_iterable(_gate_sliders(setting.problem, k) for k in gates),
        *chain.from_iterable(_obstacle_sliders(setting.problem, k) for k in obstacles),
        *_placeless_sliders(setting, plan),
    )


def moved(setting: Setting, sliders: Sequence[Slider], values: Mapping[str, float]) -> Setting:
    """Return the setting with some sliders at new values, by their keys.

    Raise SpecError for an unknown key, a value out of range, and values that contradict each other.
    """
    known = {slider.key: slider for slider in sliders}
    for key, value in values.items():
        slider = known.get(key)
        if slider is None or not slider.low <= value <= slider.high:
            raise SpecError(f"{key}: there is no slider that stands at {value}; load the page anew")
        setting = slider.moved(setting, value)
    return setting


def _gate_sliders(problem: Problem, k: int) -> Iterator[Slider]:
    """Yield the sliders of a gate's position and tilt."""
    gate, (lower, upper) = problem.gates[k], problem.path_limits.of(0)
    reach, step = _range(problem)
    for i, axis in enumerate("xyz"):
        value = float(gate.position[i])
        low, high = max(value - reach, float(lower[i])), min(value + reach, float(upper[i]))
        yield Slider(f"gates[{k}].position.{axis}", gate.name, axis, "m", low, high, step, value)
    yield _tilt_slider(problem, k)


def _tilt_slider(problem: Problem, k: int) -> Slider:
    """Return the slider of a gate's tilt about the axis of the maneuver's turn, else about its normal."""
    gate, turn_axis = problem.gates[k], problem.maneuver.turn_axis
    axis, tilt, low, high = gate.normal, degrees(gate.angles[2]), -180.0, 180.0
    if turn_axis is not None:
        axis, low, high = turn_axis, 0.0, 360.0
        tilt = degrees(np.arctan2(gate.up @ np.cross(axis, UP), gate.up @ UP)) % 360.0
    tilt = round(tilt, 6)

    def turned(setting: Setting, value: float) -> Setting:
        turn = so3.about_axis(axis, np.asarray(radians(value - tilt)))
        gates = list(setting.problem.gates)
        normal, up = (so3.rotate(turn, side) for side in (gates[k].normal, gates[k].up))
        gates[k] = replace(gates[k], normal=normal, up=up)
        return replace(setting, problem=replace(setting.problem, gates=tuple(gates)))

    key = f"gates[{k}].tilt"
    return Slider(key, gate.name, "tilt", "°", low, high, 1.0, tilt, tuple(axis.tolist()), turned)


def _obstacle_sliders(problem: Problem, k: int) -> Iterator[Slider]:
    """Yield the sliders of an obstacle's place, its first field of PLACES; none without such a field."""
    obstacles = problem.environment.obstacles
    fields_of_place = [name for name in PLACES if hasattr(obstacles[k], name)]
    if not fields_of_place:
        return

    def shifted(axis: int, stands: float, setting: Setting, value: float) -> Setting:
        environment = setting.problem.environment
        changed: list[Any] = list(environment.obstacles)
        shift = (value - stands) * np.eye(3)[axis]
        places = {name: getattr(changed[k], name) + shift for name in fields_of_place}
        changed[k] = replace(changed[k], **places)
        world = replace(environment, obstacles=tuple(changed))
        return replace(setting, problem=replace(setting.problem, environment=world))

    name = getattr(obstacles[k], "name", obstacles[k].kind)
    is_one_of_many = sum(getattr(each, "name", each.kind) == name for each in obstacles) > 1
    group = f"{name} {k}" if is_one_of_many else name
    reach, step = _range(problem)
    place = np.atleast_2d(getattr(obstacles[k], fields_of_place[0]))[0]
    for i, axis in enumerate("xyz"):
        value, key = float(place[i]), f"environment.obstacles[{k}].{axis}"
        move = partial(shifted, i, value)
        yield Slider(key, group, axis, "m", value - reach, value + reach, step, value, move=move)


def _range(problem: Problem) -> tuple[float, float]:
    """Return how far gates and obstacles can be moved to either side, and the step of their sliders [m]."""
    places = [end.position for end in problem.ends.values()] + [gate.position for gate in problem.gates]
    size = float(np.ptp(places, axis=0).max()) if places else 0.0  # [m] of what is flown through
    reach = max(0.5 * size, LEAST_REACH)
    step = round_step(2 * reach / STEPS)
    return step * round(reach / step), step


def _placeless_sliders(setting: Setting, plan: Plan) -> Iterator[Slider]:
    """Yield the sliders of the maneuver's minimum specific thrusts, the paper's ε, and of other numbers.

    These are the order, the derivative that is the input, of planners that have one, the thrust-to-weight
    ratio, and the dispersion.
    """
    maneuver, top = setting.problem.maneuver, setting.vehicle.max_specific_thrust
    for name in get_type_hints(type(maneuver)):
        if name.startswith("min_") and name.endswith("_thrust"):
            asked = getattr(maneuver, name)
            value = round(THRUST_FRACTION * top if asked is None else float(asked), 2)
            words = name.removeprefix("min_").removesuffix("thrust").replace("_", " ").strip()
            shown = f"ε {words}".strip()
            high = float(np.ceil(1.2 * max(top, value)))
            yield Slider(f"maneuver.{name}", "maneuver", shown, "m/s²", 0.5, high, 0.5, value)
    if plan.order is not None and hasattr(setting.planner, "order"):
        low, high = min(3, plan.order), max(5, plan.order)  # jerk to crackle
        yield Slider("planner.order", "maneuver", "order", "", low, high, 1, plan.order)
    ratio = round(setting.vehicle.thrust_to_weight, 2)
    # from vehicles that hardly climb to racing quadrotors
    least, most = min(1.2, ratio), max(8.0, float(np.ceil(1.5 * ratio)))
    yield Slider("vehicle.thrust_to_weight", "vehicle", "thrust-to-weight", "", least, most, 0.05, ratio)
    unit = f"× {setting.conditions.name}"
    # at three times the conditions, most maneuvers fail
    yield Slider("dispersion", "flight", "dispersion", unit, 0.0, 3.0, 0.1, 0.0)
