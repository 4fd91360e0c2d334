"""Public functions, methods and classes, each with the arguments of a call that is right."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import aerobat as ab
from aerobat.studies.compare import Entry
from places import CASES


@dataclass(frozen=True)
class Door:
    """Something public that is called, and the arguments of a call that succeeds."""

    name: str
    call: Callable[..., Any]
    right: dict[str, Any]


class NoPlan(ab.Planner):
    """A planner that finds nothing, at once."""

    def plan(self, problem: ab.Problem, vehicle: ab.Vehicle | None = None, progress: Any = None) -> ab.Plan:
        """Refuse."""
        raise ab.Infeasible("there is nothing to be found")


@cache
def plan() -> ab.Plan:
    """A plan of a fifth of a second, on a straight line."""
    trajectory = ab.Trajectory.from_inputs(np.zeros((4, 3)), np.full((2, 3), 100.0), 0.1)
    line = ab.Problem("short", ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((0.0, 0.0, 0.1)))
    return ab.Plan(line, trajectory, "none", vehicle=ab.load_vehicle("agile-quad"))


@cache
def cruise() -> ab.Plan:
    """Half a second along x through a gate."""
    trajectory = ab.Trajectory([0.5], [[[0.0, 0.0, 1.0], [4.0, 0.0, 0.0]]])
    ends = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((2.0, 0.0, 1.0))
    problem = ab.Problem("cruise", *ends, gates=(ab.tilted_gate((1.0, 0.0, 1.0)),))
    return ab.Plan(problem, trajectory, "none", vehicle=ab.load_vehicle("agile-quad"))


@cache
def flight() -> ab.Flight:
    """Its flight."""
    return ab.fly(plan(), rate=100.0, engine="floats")


def ignored(*attempt: object) -> None:
    pass


def ignored_counts(done: int, well: int) -> None:
    pass


def ignored_change(words: str, helps: bool) -> None:
    pass


def ignored_trial(quantity: str, value: float, planned: bool) -> None:
    pass


PASSING: dict[str, Any] = {
    "problem": "line",
    "planner": ab.Miqp(order=4),
    "vehicle": "agile-quad",
    "probability": 0.1,
    "conditions": ab.Dispersion(mass=0.01),
    "seed": 1,
    "flights": 2,
}
MAP: dict[str, Any] = {
    "problem": "line",
    "over": {"vehicle.thrust_to_weight": [0.5]},
    "vehicle": "agile-quad",
    "planner": NoPlan(),
    "time_limit": 1.0,
    "workers": 1,
}
NEED: dict[str, Any] = {
    "problem": "line",
    "vehicle": "agile-quad",
    "of": ["ceiling"],
    "planner": "min-snap",
    "tolerance": 0.5,
    "time_limit": 5.0,
    "workers": 1,
}
RESULTS = (
    "Assessment",
    "ErrorCauses",
    "ErrorShare",
    "FeasibilityMap",
    "Inspection",
    "Loss",
    "Estimates",
    "Export",
    "Gradient",
    "LiveView",
    "Opening",
    "Passage",
    "Passing",
    "Score",
    "Sensitivity",
    "Share",
    "Sweep",
    "Recoveries",
    "Remedy",
    "Requirement",
    "Reference",
    "Replay",
    "Tuning",
    "Why",
)  # made by no user
NOT_CALLED = (
    "AerobatError",
    "BackendMissing",
    "Infeasible",
    "SpecError",
    "Maneuver",
    "Planner",
    "ControlLaw",
    "Obstacle",
)
ENUMS = ("ContinuityRule", "Outcome", "Quantity", "TimeScaling")


def doors(folder: Path) -> Iterator[Door]:
    """All that is public and called; files go to the folder."""
    for name in ab.__all__:
        public = getattr(ab, name)
        if name in RESULTS or name in NOT_CALLED or name in ENUMS:
            continue
        if inspect.isclass(public):
            yield Door(name, public, _content(instance(public)))
        else:
            call = _closed if name == "view_live" else public
            yield Door(name, call, _arguments(name, folder))
    yield from _flights()
    yield from _methods(folder)


@functools.wraps(ab.view_live)
def _closed(*args: Any, **kwargs: Any) -> None:
    """Serve a page, and no longer."""
    ab.view_live(*args, **kwargs).close()


def _arguments(name: str, folder: Path) -> dict[str, Any]:
    """The arguments of a public function."""
    return _calls(folder)[name]


@cache
def _calls(folder: Path) -> dict[str, dict[str, Any]]:
    """The arguments of all public functions."""
    agile = ab.load_vehicle("agile-quad")
    here = {"environment": ab.Environment()}
    saved = _files(folder)
    return {
        "at_rest": {"position": (0.0, 0.0, 1.0)},
        "certify": {"trajectory": plan().trajectory, "vehicle": agile, **here, "envelope": ab.Envelope()},
        "compare": {
            "problem": plan().problem,
            "vehicle": agile,
            "planners": [("x", NoPlan())],
            "progress": ignored,
        },
        "comparison_figure": {"comparison": instance(ab.Comparison)},
        "dispersion_names": {},
        "draw": {"flight": flight(), "plan": plan(), "vehicle": agile},
        "error_causes": _causes(),
        "estimate": {
            "log": instance(ab.SensorLog),
            "ekf": ab.Ekf(),
            **here,
            "start_velocity": (0.0, 0.0, 0.1),
            "max_gap": 0.2,
        },
        "export": {"plan": plan(), "path": folder / "exported.csv", "to": "csv", "rate": 50.0},
        "fly": {
            "plan": plan(),
            "vehicle": agile,
            **here,
            "config": ab.FlightConfig(rate=100.0, engine="floats"),
        },
        "implausibilities": {"vehicle": agile},
        "feasibility_map": {**MAP, "progress": ignored_counts},
        "inspect_flight": _inspected(),
        "map_figure": {"found": instance(ab.FeasibilityMap)},
        "min_requirements": {**NEED, "progress": ignored_trial},
        "inspection_figure": {"inspection": instance(ab.Inspection)},
        "import_plugin": {"path": saved["plugin"]},
        "load_dispersion": {"name_or_path": "lab"},
        "load_flight": {"path": saved["flight"]},
        "load_plan": {"path": saved["plan"]},
        "load_problem": {"name": "line"},
        "load_trajectory": {"path": saved["trajectory"]},
        "import_vehicle": {"path": CASES / "robots" / "iris.sdf"},
        "load_vehicle": {"name_or_path": "agile-quad"},
        "controller": {"name": "x"},
        "maneuver": {"kind": "x"},
        "mesh_parts": {"path": saved["mesh"], "scale": 0.5},
        "minimum_effort": {
            "fixed": np.zeros((2, 3, 3)),
            "durations": [1.0],
            "rule": ab.ContinuityRule.HIGHEST,
            "heading": 0.1,
        },
        "obstacle": {"kind": "x"},
        "occupied_boxes": {"values": np.ones((2, 2, 2)), "cell": 0.5, "origin": (0.0, 0.0, 1.0)},
        "option": {"default": 1, "help": "x", "off": "no-x", "command_default": 2},
        "plan": {"problem": plan().problem, "planner": NoPlan(), "vehicle": agile, "progress": ignored},
        "plan_to_pass": {**PASSING, "fresh": 2, "progress": ignored, "tried": ignored},
        "planner": {"name": "x"},
        "prepare": {"plan": plan(), "vehicle": agile, **here, "config": ab.FlightConfig()},
        "problem_names": {},
        "read_csv": {"path": saved["csv"], "rate": 100.0},
        "read_flight_log": {"path": saved["log"], "plan": plan(), "vehicle": "agile-quad"},
        "read_plan": {"path": saved["plan"], "rate": 100.0},
        "read_table": {"path": saved["table"]},
        "read_trajectory": {"path": saved["trajectory"], "rate": 100.0},
        "recoveries": {
            "plan": plan(),
            "vehicle": agile,
            **here,
            "times": [0.0, 0.1],
            "ground": -5.0,
            "reaction": 0.02,
        },
        "reference": {
            "trajectory": plan().trajectory,
            "vehicle": agile,
            "times": [0.1],
            "rate": None,
            **here,
        },
        "registered_maneuvers": {},
        "registered_planners": {},
        "save_trajectory": {"trajectory": plan().trajectory, "path": folder / "saved.npz"},
        "score": {"flight": flight(), "goal": plan(), "vehicle": agile},
        "score_flights": {
            "plan": plan(),
            "vehicles": [agile],
            "problem": plan().problem,
            **here,
            "config": ab.FlightConfig(rate=100.0, engine="floats"),
        },
        "sensitivity": {
            "plan": plan(),
            "of": "mass",
            "vehicle": agile,
            **here,
            "config": ab.FlightConfig(rate=100.0, engine="floats"),
        },
        "steadied": {
            "plan": plan(),
            "planner": ab.Miqp(reserve=0.1),
            "conditions": "lab",
            "seed": 1,
            "controller": "full",
            "progress": ignored,
        },
        "sweep": {
            "plan": plan(),
            "conditions": ab.load_dispersion("none"),
            "runs": 1,
            "seed": 1,
            "vehicle": agile,
            "controller": ab.Controller(),
            "engine": "floats",
            "batch": 1,
            "workers": 1,
            "executor": None,
            "keep": folder / "kept",
            "progress": ignored_counts,
        },
        "sweep_figure": {"sweep": instance(ab.Sweep)},
        "tilted_gate": {
            "position": (0.0, 0.0, 1.0),
            "heading": 0.1,
            "elevation": 0.1,
            "tilt": 0.1,
            "width": 1.0,
            "height": 1.0,
            "name": "a gate",
        },
        "smallest_opening": _wide_enough(),
        "to_dataframe": {"result": plan()},
        "view": {"shown": flight(), "plan": plan(), "vehicle": agile},
        "view_live": {
            "shown": plan(),
            "planner": ab.Miqp(),
            "vehicle": agile,
            "conditions": ab.Dispersion(),
            "port": 0,
            "browser": False,
        },
        "why": {
            "problem": plan().problem,
            "planner": ab.MinSnap(),
            "vehicle": agile,
            "progress": ignored_change,
        },
        "with_second_opinion": {"plan": plan(), "progress": ignored},
        "tune": _tuned(),
        "vehicle_names": {},
        "write_columns": {
            "plan": plan(),
            "path": folder / "saved.csv",
            "columns": ("position",),
            "rate": 100.0,
        },
        "write_csv": {"trajectory": plan().trajectory, "path": folder / "saved.csv", "rate": 100.0},
        "write_dispersion": {"dispersion": ab.load_dispersion("lab"), "path": folder / "saved.toml"},
        "write_replay": {
            "shown": flight(),
            "path": folder / "saved.html",
            "plan": plan(),
            "vehicle": agile,
        },
        "write_problem": {"problem": plan().problem, "path": folder / "saved.toml"},
        "write_video": {
            "shown": flight(),
            "path": folder / "saved.gif",
            "plan": plan(),
            "vehicle": agile,
            "speed": 5.0,
            "progress": None,
        },
        "write_table": {"table": {"a": [1.0]}, "path": folder / "saved-table.csv"},
        "write_vehicle": {"vehicle": agile, "path": folder / "saved.toml"},
    }


@cache
def _tuned() -> dict[str, Any]:
    """The arguments of a search that tries the vehicle's own gains alone."""
    return {
        "plan": plan(),
        "conditions": ab.Dispersion(),
        "flights": 2,
        "seed": 0,
        "vehicle": ab.load_vehicle("agile-quad"),
        "gains": ["position_gain"],
        "evaluations": 1,
        "time_limit": None,
        "progress": None,
    }


def _flights() -> Iterator[Door]:
    """A flight with each of its settings given by name."""
    settings = _content(ab.FlightConfig(rate=100.0, engine="floats"))
    fixed = {name: settings[name] for name in ("rate", "engine")}
    for name, value in settings.items():
        yield Door(f"fly({name}=)", _flown, fixed | {name: value})


def _flown(**changes: Any) -> ab.Flight:
    return ab.fly(plan(), **changes)


def _methods(folder: Path) -> Iterator[Door]:
    """The methods of values that take arguments."""
    problem, agile, trajectory = (
        ab.load_problem("half-flip"),
        ab.load_vehicle("agile-quad"),
        plan().trajectory,
    )
    gate = problem.gates[0]
    calls: list[tuple[str, Callable[..., Any], dict[str, Any]]] = [
        ("Limits.of", problem.limits.of, {"derivative": 1}),
        ("Limits.without", problem.limits.without, {"derivative": 1}),
        ("EndState.derivatives", problem.start.derivatives, {"order": 3}),
        ("Problem.stages", problem.stages, {"max_specific_thrust": 30.0}),
        ("Problem.gate", problem.gate, {"name": "gate"}),
        ("Gate.tilted", gate.tilted, {"tilt": 0.1}),
        ("Maneuver.with_gate_tilt", problem.maneuver.with_gate_tilt, {"gates": [gate], "tilt": 0.1}),
        ("Vehicle.require_hover", agile.require_hover, {"gravity": 9.81}),
        ("Trajectory.evaluate", trajectory.evaluate, {"t": 0.1, "derivative": 1}),
        ("Trajectory.flat", trajectory.flat, {"t": 0.1}),
        ("Trajectory.on_segments", trajectory.on_segments, {"s": [0.1], "derivative": 1}),
        ("Trajectory.sample", trajectory.sample, {"rate": 100.0}),
        ("Trajectory.jumps", trajectory.jumps, {"derivative": 1}),
        ("Trajectory.effort", trajectory.effort, {"derivative": 1}),
        ("Trajectory.peak", trajectory.peak, {"derivative": 1}),
        ("Trajectory.component_range", trajectory.component_range, {"derivative": 1}),
        ("Trajectory.specific_thrust_range", trajectory.specific_thrust_range, {"gravity": 9.81}),
        (
            "Trajectory.from_inputs",
            ab.Trajectory.from_inputs,
            {"initial": np.zeros((3, 3)), "inputs": np.ones((2, 3)), "dt": 0.1, "heading": 0.1},
        ),
        ("Plan.save", plan().save, {"path": folder / "saved.plan"}),
        ("Flight.save", flight().save, {"path": folder / "saved.npz"}),
        ("Flight[]", ab.fly(plan(), [agile, agile], rate=100.0).__getitem__, {"vehicle": 1}),
        ("Sweep.quantile", instance(ab.Sweep).quantile, {"column": "max_position_error_m", "level": 0.5}),
        ("Sweep.within", instance(ab.Sweep).within, {"column": "max_position_error_m", "limit": 0.1}),
        ("Score[]", ab.score_flights(plan(), [agile, agile], rate=100.0).__getitem__, {"k": 1}),
        (
            "Miqp.plan",
            ab.Miqp(rescue=False).plan,
            {"problem": _hopeless(), "vehicle": agile, "progress": ignored},
        ),
        ("MinSnap.plan", ab.MinSnap().plan, {"problem": _hopeless(), "vehicle": agile, "progress": ignored}),
    ]
    for name, method, right in calls:
        yield Door(name, method, right)


def _causes() -> dict[str, Any]:
    """A study of two flights a trial."""
    return {
        "problem": cruise().problem,
        "vehicle": "agile-quad",
        "causes": [ab.Cause("late", {"conditions.control_rate": 200.0})],
        "planner": ab.MinSnap(),
        "conditions": ab.Dispersion(mass=0.01, control_rate=100.0),
        "controller": ab.Controller(),
        "flights": 2,
        "seed": 1,
        "begin": ignored,
    }


def _inspected() -> dict[str, Any]:
    """A flight and its plan."""
    return {
        "flight": flight(),
        "plan": plan(),
        "vehicle": ab.load_vehicle("agile-quad"),
        "controller": ab.Controller(),
    }


@cache
def _hopeless() -> ab.Problem:
    """A problem that every planner refuses at once."""
    up = ab.Condition("specific_thrust", (0.0, 0.0, 1.0), lower=1e3)
    return dataclasses.replace(plan().problem, maneuver=ab.CustomManeuver((ab.Stage("up", (up,)),)))


@cache
def _files(folder: Path) -> dict[str, Path]:
    """A file of each kind."""
    files = {name: folder / f"a.{name}" for name in ("plan", "csv")}
    files |= {name: folder / f"{name}.npz" for name in ("flight", "trajectory")}
    files["table"] = folder / "table.csv"
    ab.write_table({"a": [1.0]}, files["table"])
    files["log"] = folder / "log.csv"
    row = {"x": 0.0, "y": 0.0, "z": 0.0, "qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
    row |= {f"f{k}": 2.0 for k in range(4)}
    ab.write_table({"t": [0.0, 0.1, 0.2], **{name: [value] * 3 for name, value in row.items()}}, files["log"])
    files["mesh"] = folder / "mesh.obj"
    files["mesh"].write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    files["plugin"] = folder / "plugin.py"
    files["plugin"].write_text("")
    plan().save(files["plan"])
    flight().save(files["flight"])
    ab.write_csv(plan(), files["csv"])
    ab.save_trajectory(plan(), files["trajectory"])
    return files


@cache
def instance(cls: type) -> Any:
    """A value of a public class."""
    made = {
        ab.Assessment: lambda: ab.plan("line", vehicle="agile-quad").assessment,
        ab.Attitude: lambda: ab.Attitude((0.0, 0.0, 1.0), 5.0, 0.1),
        ab.Ball: lambda: ab.Ball((0.0, 0.0, 1.0), 0.3),
        ab.Battery: lambda: ab.load_dispersion("lab").battery,
        ab.BarrelRoll: lambda: ab.BarrelRoll((0.0, 0.0, 1.0)),
        ab.Box: lambda: ab.Box((0.0, 0.0, 1.0), (1.0, 2.0, 3.0), tilt=0.1),
        ab.Capsule: lambda: ab.Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.2),
        ab.BodyState: lambda: ab.BodyState(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(3)),
        ab.Cause: lambda: ab.Cause("jerk", {"planner.order": 3}),
        ab.Certificate: lambda: ab.certify(plan()),
        ab.Comparison: _comparison,
        ab.Condition: lambda: ab.Condition("velocity", (1.0, 0.0, 0.0), upper=1.0),
        ab.Corkscrew: lambda: ab.Corkscrew((0.0, 0.0, 1.0)),
        ab.Course: lambda: ab.Course((ab.PassWaypoint((0.0, 0.0, 1.0)),)),
        ab.CustomManeuver: lambda: ab.CustomManeuver((ab.Stage("a"),)),
        ab.Cylinder: lambda: ab.Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.2),
        ab.Dispersion: lambda: ab.load_dispersion("lab"),
        ab.Ellipsoid: lambda: ab.Ellipsoid((0.2, 0.2, 0.05), (0.0, 0.0, 0.01)),
        ab.EndState: lambda: ab.at_rest((0.0, 0.0, 1.0)),
        ab.ErrorCauses: lambda: ab.error_causes(**_causes()),
        ab.ErrorShare: lambda: ab.inspect_flight(**_inspected()).shares[0],
        ab.Estimates: lambda: ab.estimate(_log()),
        ab.FeasibilityMap: lambda: ab.feasibility_map(**MAP),
        ab.FlatState: lambda: plan().trajectory.flat(0.1),
        ab.Flight: flight,
        ab.Gate: lambda: ab.tilted_gate((0.0, 0.0, 1.0)),
        ab.Grid: lambda: ab.Grid(((0, 0, 0, 1, 2, 3),), 0.1),
        ab.HalfSpace: lambda: ab.HalfSpace((0.0, 0.0, 3.0), (0.0, 0.0, -1.0)),
        ab.Hold: lambda: ab.Hold((0.0, 0.0, 1.0), 0.5),
        ab.Immelmann: lambda: ab.Immelmann((0.0, 0.0, 1.0)),
        ab.Inspection: lambda: ab.inspect_flight(**_inspected()),
        ab.InvertedPass: lambda: ab.InvertedPass((0.0, 0.0, 1.0)),
        ab.KnifeEdgePass: lambda: ab.KnifeEdgePass((0.0, 0.0, 1.0)),
        ab.MattyFlip: lambda: ab.MattyFlip((0.0, 0.0, 3.0)),
        ab.Mesh: lambda: ab.Mesh((np.eye(4)[:, :3],), (0.0, 0.0, 1.0)),
        ab.Outage: lambda: ab.Outage(0.1, 0.5),
        ab.Opening: lambda: ab.smallest_opening(**_wide_enough()),
        ab.PassWaypoint: lambda: ab.PassWaypoint((0.0, 0.0, 1.0)),
        ab.Passing: lambda: ab.plan_to_pass(**PASSING),
        ab.Plan: plan,
        ab.Polytope: lambda: ab.Polytope(np.eye(4)[:, :3]),
        ab.PowerLoop: lambda: ab.PowerLoop((0.0, 0.0, 1.0)),
        ab.Problem: lambda: ab.load_problem("half-flip"),
        ab.Remedy: lambda: ab.Remedy(("without reserve",), plan()),
        ab.Requirement: lambda: ab.min_requirements(**NEED)[0],
        ab.Rotor: lambda: ab.load_vehicle("agile-quad").rotors[0],
        ab.SensorLog: _log,
        ab.Setpoint: lambda: flight().setpoint,
        ab.Sphere: lambda: ab.Sphere((0.0, 0.0, 1.0), 0.5),
        ab.SplitS: lambda: ab.SplitS((0.0, 0.0, 4.0)),
        ab.Stage: lambda: ab.Stage("a"),
        ab.Trajectory: lambda: plan().trajectory,
        ab.Tuning: lambda: ab.tune(**_tuned()),
        ab.Vehicle: lambda: ab.load_vehicle("agile-quad"),
        ab.Waypoint: lambda: ab.Waypoint((0.0, 0.0, 1.0)),
        ab.Waypoints: lambda: ab.Waypoints((ab.Waypoint((0.0, 0.0, 1.0)),)),
        ab.Why: lambda: ab.Why("short", "it is too little", (), (instance(ab.Remedy),), ("without reserve",)),
        ab.Wrench: lambda: flight().setpoint.wrench,
        ab.Recoveries: lambda: ab.recoveries(plan(), times=[0.0, 0.1], ground=-5.0),
        ab.Reference: lambda: ab.reference(plan(), times=[0.0, 0.1]),
        ab.Share: lambda: instance(ab.Sweep).success,
        ab.Sweep: lambda: ab.sweep(plan(), "none", 1, engine="floats", workers=1),
        ab.Score: lambda: ab.score_flights(plan(), ["agile-quad"] * 2, rate=100.0),
        ab.Sensitivity: lambda: ab.sensitivity(plan(), "mass", rate=100.0),
        ab.Gradient: lambda: instance(ab.Sensitivity).mean_square_position_error,
        ab.Passage: _passage,
        ab.Replay: lambda: ab.view(plan()),
        ab.Loss: lambda: ab.Loss(0.001, 0.01, 0.02, 0.02, "straight lines between rows"),
        ab.Export: lambda: ab.Export("csv", (Path("plan.csv"),), instance(ab.Loss)),
    }
    return made.get(cls, cls)()


@cache
def _log() -> ab.SensorLog:
    """A tenth of a second at rest."""
    times, force = np.arange(1.0, 11.0) / 100.0, np.tile([0.0, 0.0, 9.81], (10, 1))
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    return ab.SensorLog(times, np.zeros((10, 3)), force, np.array([0.0, 0.05]), np.zeros((2, 3)), upright)


def _wide_enough() -> dict[str, Any]:
    """The arguments of smallest_opening."""
    flights = ab.score_flights(cruise(), ["agile-quad"] * 2)
    odds = {"probability": 0.5, "confidence": 0.5, "side": "width"}
    return {"scores": flights, "gate": cruise().problem.gates[0], **odds}


def _passage() -> ab.Passage:
    """One that is not known."""
    problem = ab.load_problem("half-flip")
    return ab.score(flight(), problem).passages[0]


def _comparison() -> ab.Comparison:
    entry = Entry("none", plan(), None, None, 0.0, "planned")
    return ab.Comparison(plan().problem, ab.load_vehicle("agile-quad"), (entry,))


def _content(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}


VALUES = [
    public
    for public in (getattr(ab, name) for name in ab.__all__)
    if dataclasses.is_dataclass(public) and isinstance(public, type) and not inspect.isabstract(public)
]
