"""Own vehicles and maneuvers as a newcomer writes them, with nothing but docs/files.md: flown or refused.

    uv run python benchmarks/own_files.py [--count N] [--seed S] [--folder FOLDER]

Every key of the page is drawn at random, sensible in size and careless in combination. Each case is planned,
proven and flown; a refusal counts as such only if it is one sentence. The table says what became of each.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from aerobat.control import Controller
from aerobat.errors import AerobatError, Infeasible, SpecError
from aerobat.evaluation import score
from aerobat.planning import plan
from aerobat.problem import load_problem
from aerobat.simulation import fly
from aerobat.vehicle import implausibilities, load_vehicle
from own_courses import course, crossing, figure, place_of_stage
from own_obstacles import obstacles, wall

Table = dict[str, Any]
Draw = Callable[["Pen"], Any]
MAX_SENTENCE = 400  # [characters] of a refusal, beside the file's name
QUANTITIES = {"position": 3.0, "velocity": 3.0, "acceleration": 6.0, "specific_thrust": 8.0}
KINDS = ("flip", "half-flip", "line", "stages", "waypoints", "figure", "course")


class Pen:
    """Random numbers in a writer's hand: two or three digits, never more."""

    def __init__(self, seed: int, case: int) -> None:
        self.rng = np.random.default_rng([seed, case])

    def number(self, low: float, high: float) -> float:
        """A number between two others."""
        return float(f"{self.rng.uniform(low, high):.3g}")

    def size(self, low: float, high: float) -> float:
        """A positive number of any order of magnitude between two others."""
        return float(f"{np.exp(self.rng.uniform(np.log(low), np.log(high))):.3g}")

    def vector(self, size: float) -> list[float]:
        """Three numbers of about that size."""
        return [self.number(-size, size) for _ in range(3)]

    def one_of(self, *choices: Any) -> Any:
        """One of some things."""
        return choices[int(self.rng.integers(len(choices)))]

    def chance(self, probability: float) -> bool:
        """True as often as said."""
        return bool(self.rng.uniform() < probability)

    def some(self, keys: Mapping[str, Draw], probability: float) -> Table:
        """A table with some of these keys."""
        return {key: draw(self) for key, draw in keys.items() if self.chance(probability)}


@dataclass(frozen=True)
class Case:
    """Two files' contents."""

    problem: Table
    vehicle: Table


def random_files(seed: int, case: int) -> Case:
    """The files of a case, the same whenever they are drawn."""
    pen = Pen(seed, case)
    found = Case(_problem(pen, pen.one_of(*KINDS), case), _vehicle(pen))
    if pen.chance(0.1):  # drawn last: earlier draws stay as they were
        tilt = pen.number(0.5, 2.5)
        ceiling = pen.one_of({"max_tilt": tilt}, {"max_tilt_deg": round(np.degrees(tilt), 1)})
        found.problem["limits"] = found.problem.get("limits", {}) | ceiling
    if pen.chance(0.1):
        angle = pen.number(0.05, 0.5)
        tilt = pen.one_of({"attitude": angle}, {"attitude_deg": round(np.degrees(angle), 1)})
        found.problem["tolerance"] = {"position": pen.size(0.02, 1.0)} | tilt
    if pen.chance(0.2):
        world = found.problem.get("environment", {})
        found.problem["environment"] = world | {"obstacles": obstacles(pen)}
    for gate in (*found.problem.get("gates", ()), found.problem.get("gate")):
        if gate and pen.chance(0.1):
            gate["wall"] = wall(pen)
    if pen.chance(0.15):
        start = found.problem.pop("heading", None)
        found.problem["heading"] = _heading(pen) | ({} if start is None else {"start": start})
    return found


def _heading(pen: Pen) -> Table:
    """What the body's x axis follows along the way."""
    point = {"mode": "towards", "point": [pen.number(-9.0, 9.0) for _ in range(3)]}
    spline = {"mode": "spline", "knots_deg": [[0.5, pen.number(-180, 180)], [1.0, pen.number(-180, 180)]]}
    mode = pen.one_of({"mode": "fixed"}, {"mode": "along-velocity"}, point, spline)
    return mode | pen.some({"tolerance_deg": lambda p: p.number(5.0, 170.0)}, 0.3)


def _vehicle(pen: Pen) -> Table:
    count, mass = pen.one_of(4, 4, 4, 6, 8), pen.size(0.03, 6.0)
    arm = float(f"{0.16 * mass ** (1 / 3) * pen.number(0.7, 1.4):.3g}")
    moments = [mass * arm**2 * pen.number(0.15, 0.3) for _ in range(2)]
    moments.append(sum(moments) * pen.number(0.6, 0.95))
    rounded = [float(f"{moment:.3g}") for moment in moments]
    table: Table = {"mass": mass, "inertia": rounded}
    if pen.chance(0.3):
        skew = float(f"{0.05 * rounded[0] * pen.number(-1, 1):.3g}")
        table["inertia"] = [[rounded[0], skew, 0.0], [skew, rounded[1], 0.0], [0.0, 0.0, rounded[2]]]
    lateral = pen.number(0.05, 0.4) * mass
    table |= pen.some(
        {
            "name": lambda _: "mine",
            "description": lambda _: "drawn at random",
            "centre_of_mass": lambda p: [p.number(-0.15, 0.15) * arm, p.number(-0.15, 0.15) * arm, 0.0],
            "drag_body": lambda p: [lateral, lateral, lateral * p.number(0.2, 1.0)],
            "max_body_rate": lambda p: p.number(8.0, 35.0),
        },
        0.5,
    )
    table |= pen.some({"controller": _controller, "body": lambda p: _body(p, arm)}, 0.15)
    strength = pen.number(1.3, 6.0) * mass * 9.81 / count
    defaults = _thrusts(pen, strength, arm) | {"lag": pen.one_of(0.0, pen.size(0.01, 0.08))}
    defaults["radius"] = float(f"{0.5 * arm:.3g}")
    rotors = [_rotor(pen, 2 * np.pi * (i + 0.5) / count, arm, (-1) ** i) for i in range(count)]
    if pen.chance(0.1):
        rotors[0]["max_thrust"] = 0
    if pen.chance(0.2):
        return table | {"rotors": [defaults | rotor for rotor in rotors]}
    return table | {"rotor_defaults": defaults, "rotors": rotors}


def _controller(pen: Pen) -> Table:
    """Gains about those that suit every vehicle."""
    usual = vars(Controller())
    table: Table = {key: round(value * pen.number(0.8, 1.3), 4) for key, value in usual.items() if value > 1}
    small = {key: value for key, value in usual.items() if isinstance(value, float) and value <= 1}
    switches = dict.fromkeys((key for key, value in usual.items() if isinstance(value, bool)), True)
    return table | pen.some({key: lambda _, x=value: x for key, value in (small | switches).items()}, 0.5)


def _body(pen: Pen, arm: float) -> Table:
    """An ellipsoid that encloses the rotors, at whatever height they are."""
    height = float(f"{arm * pen.number(0.5, 0.9):.3g}")
    across = float(f"{3.0 * arm:.3g}")
    return {"semi_axes": [across, across, height], "centre": [0.0, 0.0, 0.0]}


def _rotor(pen: Pen, angle: float, arm: float, spin: int) -> Table:
    place = [arm * np.cos(angle), arm * np.sin(angle), pen.number(-0.1, 0.1) * arm]
    return {"position_body": [float(f"{x:.3g}") for x in place], "spin": spin}


def _thrusts(pen: Pen, strength: float, arm: float) -> Table:
    """The same rotor in three ways of saying so."""
    ratio = float(f"{arm * pen.number(0.05, 0.15):.3g}")
    rpm = pen.one_of(6000, 12000, 25000)
    k_f = strength / (rpm * 2 * np.pi / 60) ** 2
    idle = pen.one_of(0.0, 0.03)
    most = float(f"{strength:.4g}")
    plain = {"min_thrust": idle * most, "max_thrust": most, "torque_coefficient": ratio}
    speeds = {"k_f": k_f, "k_m": ratio * k_f, "min_rpm": rpm * idle, "max_rpm": rpm}
    rows = [[x, most * x * x, ratio * most * x * x] for x in (0.1, 0.4, 0.7, 1.0)]
    return pen.one_of(plain, speeds, {"thrust_curve": rows})


def _problem(pen: Pen, kind: str, case: int) -> Table:
    start, way = pen.vector(1.0), [pen.number(3.0, 9.0), pen.number(-2.0, 2.0), pen.number(-0.5, 0.5)]
    goal = [round(a + b, 3) for a, b in zip(start, way, strict=True)]
    above = {"flip": pen.number(3.0, 7.0), "half-flip": pen.number(0.0, 3.0)}.get(kind, 0.0)
    middle = [round((a + b) / 2, 3) for a, b in zip(start, goal, strict=True)]
    middle[2] += above
    gates = [_gate(pen, middle, kind)] if kind in ("flip", "half-flip") or pen.chance(0.4) else []
    table: Table = {"name": f"own-{case}-{kind}", "start": _end(pen, start), "goal": _end(pen, goal)}
    if pen.chance(0.1):
        table["goal"]["free_attitude"] = True
    if pen.chance(0.1):
        table["goal"].pop("velocity", None)
        table["goal"]["free_velocity"] = True
    table["maneuver"] = {"kind": kind} | _MANEUVERS[kind](pen, middle, gates)
    table |= {"gates": gates} if pen.chance(0.3) else {"gate": gates[0]} if gates else {}
    limits = pen.some(_LIMITS, 0.15)
    if pen.chance(0.2):
        corners = np.array([start, goal, middle])
        limits |= {
            "lower": (corners.min(axis=0) - 4.0).tolist(),
            "upper": (corners.max(axis=0) + 4.0).tolist(),
        }
    heading = pen.one_of({}, {"heading": pen.number(-3.0, 3.0)}, {"heading_deg": pen.number(-180, 180)})
    environment = pen.some(
        {
            "gravity": lambda p: p.one_of(9.81, 3.71, 1.62),
            "wind": lambda p: p.vector(2.0),
            "ground": lambda p: round(min(start[2], goal[2]) - p.number(0.3, 2.0), 2),
        },
        0.25,
    )
    table |= heading | ({"limits": limits} if limits else {})
    table |= {"environment": environment} if environment else {}
    return table | pen.some({"description": lambda _: "drawn at random"}, 0.3)


def _end(pen: Pen, position: list[float]) -> Table:
    moving = pen.some({"velocity": lambda p: p.vector(1.5), "acceleration": lambda p: p.vector(1.0)}, 0.15)
    return {"position": position} | moving


def _gate(pen: Pen, position: list[float], kind: str) -> Table:
    gate: Table = {"position": position}
    if pen.chance(0.2):
        gate |= {
            "normal": [1.0, 0.0, 0.0],
            "up": pen.one_of([0.0, 0.0, -1.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]),
        }
    else:
        tilt = {"flip": pen.one_of(180.0, 135.0), "half-flip": pen.number(-90.0, 90.0)}.get(kind, 0.0)
        gate |= pen.some(
            {"heading_deg": lambda p: p.number(-60, 60), "elevation_deg": lambda p: p.number(-20, 20)}, 0.5
        )
        gate["tilt_deg"] = tilt
    sides = pen.some({"width": lambda p: p.number(0.5, 2.0), "height": lambda p: p.number(0.3, 1.0)}, 0.3)
    low, high = pen.number(0.3, 0.6), pen.number(0.5, 1.0)
    corner: list[list[float]] = [[-high, -low], [high, -low], [0.0, high]]
    others = pen.one_of({"radius": high}, {"diameter": pen.number(0.8, 2.0)}, {"polygon": corner})
    gate |= others if pen.chance(0.25) else sides
    gate |= pen.some({"name": lambda _: "gate"}, 0.3)
    tolerance = pen.one_of(
        {}, {"attitude_tolerance": pen.number(0.02, 0.2)}, {"attitude_tolerance_deg": pen.number(1, 15)}
    )
    return gate | tolerance


_LIMITS: Mapping[str, Draw] = {
    "velocity": lambda p: p.one_of(p.number(3.0, 12.0), [10.0, 10.0, p.number(3.0, 8.0)]),
    "acceleration": lambda p: p.number(10.0, 40.0),
    "jerk": lambda p: p.number(60.0, 400.0),
    "snap": lambda p: p.number(1000.0, 8000.0),
    "crackle": lambda p: p.size(2e4, 4e5),
}


def _passage(pen: Pen) -> Table:
    keys: Mapping[str, Draw] = {
        "perpendicular": lambda p: p.chance(0.5),
        "speed": lambda p: p.number(0.0, 4.0),
        "at": _at,
        "centred": lambda p: p.chance(0.5),
        "upright": lambda p: p.chance(0.5),
    }
    found = pen.some(keys, 0.2) | crossing(pen)
    return {"passage": found} if found else {}


def _at(pen: Pen) -> Any:
    begin = pen.number(0.2, 0.6)
    return pen.one_of("free", begin, [begin, round(begin + 0.25, 3)])


def _flip(pen: Pen, middle: list[float], gates: list[Table]) -> Table:
    keys: Mapping[str, Draw] = {
        "min_lateral_thrust": lambda p: p.number(0.5, 6.0),
        "min_inverted_thrust": lambda p: p.number(0.5, 6.0),
        "signed": lambda p: p.chance(0.7),
        "ordered": lambda p: p.chance(0.7),
        "mirrored": lambda p: p.chance(0.5),
        "count": lambda p: p.one_of(1, 2),
    }
    axis = gates[0].get("heading_deg", 0.0) + pen.one_of(0.0, 90.0, -90.0, 180.0)
    return {"axis_deg": axis} | pen.some(keys, 0.2) | _passage(pen)


def _half_flip(pen: Pen, middle: list[float], gates: list[Table]) -> Table:
    return pen.some({"min_lateral_thrust": lambda p: p.number(0.5, 4.0)}, 0.3) | _passage(pen)


def _line(pen: Pen, middle: list[float], gates: list[Table]) -> Table:
    return _passage(pen)


def _stages(pen: Pen, middle: list[float], gates: list[Table]) -> Table:
    stages = [_stage(pen, i, gates) for i in range(pen.one_of(1, 2, 3))]
    if pen.chance(0.2):
        stages.append({"name": "place"} | place_of_stage(pen, middle))
    upright = {"quantity": "specific_thrust", "direction": [0.0, 0.0, 1.0], "lower": 0.0}
    always = {"path_constraints": [upright]} if pen.chance(0.3) else {}
    return {"stages": stages} | always | pen.some({"ordered": lambda p: p.chance(0.5)}, 0.3)


def _stage(pen: Pen, i: int, gates: list[Table]) -> Table:
    stage: Table = {"name": f"stage {i + 1}"}
    stage |= pen.some(
        {"conditions": lambda p: [_condition(p)], "at": _at, "interval_offset": lambda p: p.one_of(0, 1)}, 0.4
    )
    if gates and pen.chance(0.5):
        stage["gate"] = gates[0].get("name", "gate")
        keys = {"min_upright_thrust": lambda p: p.number(1.0, 6.0), "min_speed": lambda p: p.number(0.0, 3.0)}
        return stage | pen.some(keys, 0.5) | crossing(pen)
    if pen.chance(0.5):
        attitude = {
            "up": [pen.number(-1, 1), pen.number(-1, 1), pen.number(0, 1)],
            "min_thrust": pen.number(2.0, 10.0),
        }
        width = pen.one_of({}, {"tolerance": pen.number(0.05, 0.4)}, {"tolerance_deg": pen.number(3, 25)})
        stage["attitude"] = attitude | width
    return stage


def _condition(pen: Pen) -> Table:
    quantity = pen.one_of(*QUANTITIES)
    value = pen.number(-1.0, 1.0) * QUANTITIES[quantity]
    bounds = pen.one_of(
        {"lower": value}, {"upper": value}, {"lower": value, "upper": value + 2.0}, {"equals": value}
    )
    return {
        "quantity": quantity,
        "direction": pen.one_of([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]),
    } | bounds


def _waypoints(pen: Pen, middle: list[float], gates: list[Table]) -> Table:
    found = []
    for i in range(pen.one_of(1, 2, 3)):
        place = [round(x + y, 3) for x, y in zip(middle, pen.vector(1.5), strict=True)]
        point: Table = {"position": pen.one_of(place, {"x": place[0], "z": place[2]})}
        keys: Mapping[str, Draw] = {
            "velocity": lambda p: p.one_of({"x": p.number(1.0, 4.0)}, p.vector(3.0)),
            "acceleration": lambda p: {"y": p.number(-3.0, 3.0)},
            "up": lambda p: [p.number(-1, 1), p.number(-1, 1), 0.5],
            "time": lambda p, i=i: p.number(0.8, 1.2) * (i + 1),  # type: ignore[misc]
        }
        point |= pen.some(keys, 0.2)
        if "up" in point:
            point |= pen.some({"thrust": lambda p: p.number(5.0, 15.0)}, 0.5)
        if gates and i == 0 and pen.chance(0.5):
            point = {"gate": gates[0].get("name", "gate")} | crossing(pen)
        elif isinstance(point.get("position"), list):
            point |= pen.some({"radius": lambda p: p.number(0.1, 0.5)}, 0.3)
        found.append(point)
    return {"waypoints": found} | pen.some({"duration": lambda p: p.number(2.5, 6.0)}, 0.2)


_MANEUVERS: Mapping[str, Callable[[Pen, list[float], list[Table]], Table]] = {
    "flip": _flip,
    "half-flip": _half_flip,
    "line": _line,
    "stages": _stages,
    "waypoints": _waypoints,
    "figure": figure,
    "course": course,
}


@dataclass(frozen=True)
class Verdict:
    """What became of a case, and in which words."""

    kind: str  # flown, told poor, refused, or DEFECT
    sentence: str


def verdict(case: Case, folder: Path) -> Verdict:
    """Write a case's files, plan, prove and fly it."""
    for name, table in (("problem", case.problem), ("vehicle", case.vehicle)):
        (folder / f"{name}.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return _flown(folder)
    except AerobatError as error:
        sentence = str(error).replace(str(folder), "").strip()
        kind = (
            "no plan"
            if isinstance(error, Infeasible)
            else "refused"
            if isinstance(error, SpecError)
            else "DEFECT"
        )
        readable = sentence.isprintable() and len(sentence) <= MAX_SENTENCE
        return Verdict(kind if readable else "DEFECT", sentence)
    except Exception as error:
        return Verdict("DEFECT", f"{type(error).__name__}: {error}")


def _flown(folder: Path) -> Verdict:
    vehicle = load_vehicle(folder / "vehicle.toml")
    told = "".join(f" (told: {doubt})" for doubt in implausibilities(vehicle))
    found = plan(load_problem(folder / "problem.toml"), vehicle=vehicle)
    flight = score(fly(found), found, found.vehicle)
    well = (
        found.certificate is not None
        and found.certificate.certified
        and found.flies
        and flight.outcome.is_success
    )
    proof = (
        "" if found.certificate and found.certificate.certified else f"; not certified: {found.certificate}"
    )
    return Verdict(
        "flown" if well else "told poor", f"{found.duration:.3g} s; {flight.sentence}{proof}{told}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--count", type=int, default=40, help="cases (40)")
    parser.add_argument("--seed", type=int, default=0, help="their seed (0)")
    parser.add_argument("--first", type=int, default=0, help="the first case (0)")
    parser.add_argument("--folder", type=Path, help="where their files are kept")
    options = parser.parse_args()
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as scratch:
        for k in range(options.first, options.first + options.count):
            folder = Path(options.folder or scratch) / str(k)
            folder.mkdir(parents=True)
            case, begin = random_files(options.seed, k), time.process_time()
            found = verdict(case, folder)
            tally[found.kind] += 1
            name = case.problem["name"]
            print(
                f"{name:18} {time.process_time() - begin:5.1f} s  {found.kind:9}  {found.sentence}",
                flush=True,
            )
    print(", ".join(f"{count} {kind}" for kind, count in tally.most_common()))


if __name__ == "__main__":
    main()
