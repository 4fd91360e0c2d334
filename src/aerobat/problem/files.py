"""Problems from TOML and back; the built-in ones are such files too."""

from __future__ import annotations

from dataclasses import asdict
from importlib.resources import files
from math import degrees, inf, radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from aerobat.arrays import Array
from aerobat.documents import (
    document_names,
    in_document,
    read_document,
    resolve_document,
    within,
    write_document,
)
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.problem.gate import Gate, tilted_gate
from aerobat.problem.maneuver import CustomManeuver, Flip, GatePassage, HalfFlip, Line, Maneuver
from aerobat.problem.problem import DERIVATIVES, EndState, Limits, Problem
from aerobat.problem.stage import Condition, Quantity, Stage
from aerobat.problem.waypoints import FREE, GIVEN, Waypoint, Waypoints

if TYPE_CHECKING:
    from aerobat.problem import schema

PRESETS = files("aerobat.problem") / "presets"


def problem_names() -> tuple[str, ...]:
    """The names of the built-in problems."""
    return document_names(PRESETS)


def load_problem(name: str | Path) -> Problem:
    """A built-in problem by its name, or the one in a TOML file.

    Raises SpecError, in one sentence that names the field, when there is no such problem or it is malformed.
    """
    from aerobat.problem.schema import ProblemTable

    path = resolve_document(name, PRESETS, "problem")
    table = read_document(path, ProblemTable, "problem")
    with in_document(path, "problem"):
        return _problem(table)


def write_problem(problem: Problem, path: str | Path) -> None:
    """Write a problem as TOML, whole or not at all. Raises SpecError when the file cannot be written."""
    write_document(path, _document(problem), "problem")


def _problem(table: schema.ProblemTable) -> Problem:
    return Problem(
        name=table.name,
        description=table.description,
        start=_end(table.start, "start"),
        goal=_end(table.goal, "goal"),
        gates=_gates(table),
        maneuver=_maneuver(table.maneuver),
        limits=Limits(**{k: np.array(v) for k, v in table.limits.model_dump(exclude_none=True).items()}),
        heading=radians(table.heading_deg),
        environment=Environment(**table.environment.model_dump()),
    )


def _end(table: schema.EndTable, name: str) -> EndState:
    with within(f"{name}."):
        return EndState(np.array(table.position), np.array(table.velocity), np.array(table.acceleration))


def _gates(table: schema.ProblemTable) -> tuple[Gate, ...]:
    if table.gate is not None and table.gates:
        raise SpecError("gate and gates are both given; give all gates as tables [[gates]]")
    return tuple(_gate(each) for each in (table.gates if table.gate is None else [table.gate]))


def _gate(table: schema.GateTable) -> Gate:
    heading, elevation, tilt = (radians(a) for a in (table.heading_deg, table.elevation_deg, table.tilt_deg))
    return tilted_gate(
        np.array(table.position), heading, elevation, tilt, table.width, table.height, table.name
    )


def _maneuver(
    table: schema.FlipTable
    | schema.HalfFlipTable
    | schema.LineTable
    | schema.StagesTable
    | schema.WaypointsTable,
) -> Maneuver:
    options = table.model_dump(exclude={"kind", "passage"})
    match table.kind:
        case "flip":
            return Flip(**options, passage=_passage(table.passage))
        case "half-flip":
            return HalfFlip(**options, passage=_passage(table.passage))
        case "line":
            return Line(_passage(table.passage))
        case "stages":
            return CustomManeuver(
                tuple(_stage(s, f"maneuver.stages[{i}]") for i, s in enumerate(table.stages)),
                _conditions(table.path_constraints, "maneuver.path_constraints"),
                table.ordered,
            )
        case "waypoints":
            waypoints = (_waypoint(w, f"maneuver.waypoints[{i}].") for i, w in enumerate(table.waypoints))
            return Waypoints(tuple(waypoints), table.duration)


def _waypoint(table: schema.WaypointTable, name: str) -> Waypoint:
    with within(name):
        return Waypoint(
            position=_components(table.position),
            velocity=_components(table.velocity),
            acceleration=_components(table.acceleration),
            up=None if table.up is None else np.array(table.up),
            thrust=table.thrust,
            time=table.time,
            gate=table.gate,
        )


def _components(vector: schema.Vector | schema.PartialVector) -> Array:
    values = vector if isinstance(vector, tuple) else (vector.x, vector.y, vector.z)
    return np.array([FREE if x is None else x for x in values])


def _passage(table: schema.PassageTable) -> GatePassage:
    return GatePassage(**table.model_dump())


def _stage(table: schema.StageTable, name: str) -> Stage:
    conditions = _conditions(table.conditions, f"{name}.conditions")
    return Stage(table.name, conditions, table.at, table.interval_offset, table.gate)


def _conditions(tables: list[schema.ConditionTable], name: str) -> tuple[Condition, ...]:
    return tuple(_condition(t, f"{name}[{i}]") for i, t in enumerate(tables))


def _condition(table: schema.ConditionTable, name: str) -> Condition:
    lower, upper = (x if table.equals is None else table.equals for x in (table.lower, table.upper))
    if lower is None and upper is None:
        raise SpecError(f"{name} needs lower, upper or equals")
    with within(f"{name}: "):
        return Condition(
            Quantity(table.quantity),
            np.array(table.direction),
            -inf if lower is None else lower,
            inf if upper is None else upper,
        )


def _document(problem: Problem) -> dict[str, Any]:
    """The problem as the tables of its file, defaults left out where they say nothing."""
    document: dict[str, Any] = {"name": problem.name}
    if problem.description:
        document["description"] = problem.description
    document["heading_deg"] = degrees(problem.heading)
    document["environment"] = _environment_table(problem.environment)
    for end in ("start", "goal"):
        state: EndState = getattr(problem, end)
        document[end] = {name: getattr(state, name).tolist() for name in DERIVATIVES[:3]}
    if problem.gates:
        document["gates"] = [_gate_table(gate) for gate in problem.gates]
    document["maneuver"] = _maneuver_table(problem.maneuver)
    document["limits"] = {
        name: bound.tolist()
        for name in ("lower", "upper", *DERIVATIVES[1:])
        if np.isfinite(bound := np.asarray(getattr(problem.limits, name))).all()
    }
    return document


def _environment_table(environment: Environment) -> dict[str, Any]:
    table = {"gravity": environment.gravity, "wind": environment.wind.tolist()}
    return table if environment.ground is None else table | {"ground": environment.ground}


def _gate_table(gate: Gate) -> dict[str, Any]:
    heading, elevation, tilt = (degrees(a) for a in gate.angles)
    return {
        "position": gate.position.tolist(),
        "heading_deg": heading,
        "elevation_deg": elevation,
        "tilt_deg": tilt,
        "width": gate.width,
        "height": gate.height,
        "name": gate.name,
    }


def _maneuver_table(maneuver: Maneuver) -> dict[str, Any]:
    match maneuver:
        case Flip():
            options = asdict(maneuver)
            return {"kind": "flip"} | {k: v for k, v in options.items() if v is not None}
        case HalfFlip():
            options = asdict(maneuver)
            return {"kind": "half-flip"} | {k: v for k, v in options.items() if v is not None}
        case CustomManeuver():
            return {
                "kind": "stages",
                "ordered": maneuver.ordered,
                "path_constraints": [_condition_table(c) for c in maneuver.path_constraints],
                "stages": [
                    {"name": s.name, "conditions": [_condition_table(c) for c in s.conditions]}
                    | ({} if s.at is None else {"at": s.at, "interval_offset": s.interval_offset})
                    | ({} if s.gate is None else {"gate": s.gate})
                    for s in maneuver.sequence
                ],
            }
        case Waypoints():
            options = {} if maneuver.duration is None else {"duration": maneuver.duration}
            waypoints = [_waypoint_table(w) for w in maneuver.waypoints]
            return {"kind": "waypoints"} | options | {"waypoints": waypoints}
        case Line():
            return {"kind": "line"} | asdict(maneuver)
    raise SpecError(f"a maneuver of the type {type(maneuver).__name__} has no place in a problem file")


def _waypoint_table(waypoint: Waypoint) -> dict[str, Any]:
    table: dict[str, Any] = {}
    for quantity in GIVEN:
        values = zip("xyz", getattr(waypoint, quantity.value).tolist(), strict=True)
        if given := {axis: value for axis, value in values if not np.isnan(value)}:
            table[quantity.value] = given
    if waypoint.up is not None:
        table["up"] = waypoint.up.tolist()
    options = {"thrust": waypoint.thrust, "time": waypoint.time, "gate": waypoint.gate}
    return table | {name: value for name, value in options.items() if value is not None}


def _condition_table(condition: Condition) -> dict[str, Any]:
    bounds = {"lower": condition.lower, "upper": condition.upper}
    return {"quantity": str(condition.quantity), "direction": condition.direction.tolist()} | {
        k: v for k, v in bounds.items() if np.isfinite(v)
    }
