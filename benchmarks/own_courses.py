"""Draws of figures and courses for `own_files`: tables of `[maneuver]`, about a place between the gates."""

from __future__ import annotations

from typing import Any

Table = dict[str, Any]
LOOPS = ("power-loop", "split-s", "immelmann", "matty-flip")
FIGURES = (*LOOPS, "barrel-roll", "corkscrew", "knife-edge-pass", "inverted-pass")


def figure(pen: Any, middle: list[float], gates: list[Table]) -> Table:
    """A figure at a place, or in the gate."""
    kind = pen.one_of(*FIGURES)
    table: Table = {"kind": kind, "position": middle}
    if gates and pen.chance(0.5):
        table = {"kind": kind, "gate": gates[0].get("name", "gate")}
    heading = pen.one_of({}, {"heading": pen.number(-1.0, 1.0)}, {"heading_deg": pen.number(-60, 60)})
    width = pen.one_of({}, {"tolerance": pen.number(0.1, 0.4)}, {"tolerance_deg": pen.number(8, 25)})
    table |= heading | width
    table |= pen.some({"speed": lambda p: p.number(2.0, 5.0), "mirrored": lambda p: p.chance(0.5)}, 0.4)
    if kind in LOOPS or kind == "corkscrew":
        table |= pen.some({"radius": lambda p: p.number(0.6, 2.0)}, 0.5)
    if kind == "corkscrew":
        table |= pen.some({"lead": lambda p: p.number(2.0, 4.0)}, 0.5)
    if kind in ("barrel-roll", "corkscrew"):
        table |= pen.some({"count": lambda p: p.one_of(1, 2)}, 0.5)
    return table


def course(pen: Any, middle: list[float], gates: list[Table]) -> Table:
    """Up to three elements, in one lap or two; a few are closed, which start and goal contradict."""
    elements = [_element(pen, middle, gates) for _ in range(pen.one_of(1, 2, 3))]
    laps = {"laps": 2} | pen.some({"last_lap": lambda _: 1}, 0.5) if pen.chance(0.5) else {}
    if not laps and len(elements) == 3:
        laps = {"closed": True}
    return {"elements": elements} | laps


def _element(pen: Any, middle: list[float], gates: list[Table]) -> Table:
    place = [round(x + y, 3) for x, y in zip(middle, pen.vector(2.0), strict=True)]
    kind = pen.one_of("figure", "waypoint", "hold", *(("gate", "gate") if gates else ()))
    if kind == "figure":
        return figure(pen, place, [])
    if kind == "waypoint":
        return {"kind": kind, "position": place, "radius": pen.number(0.1, 0.5)}
    if kind == "hold":
        return {"kind": kind, "position": place, "time": pen.number(0.2, 1.0)}
    passing = pen.some({"speed": lambda p: p.number(0.0, 4.0), "upright": lambda p: p.chance(0.5)}, 0.4)
    passing |= pen.some({"min_thrust": lambda p: p.number(1.0, 6.0)}, 0.2)
    return {"kind": kind, "gate": gates[0].get("name", "gate")} | crossing(pen) | passing


def crossing(pen: Any) -> Table:
    """Where a gate's opening is crossed."""
    if not pen.chance(0.3):
        return {}
    return {"crossing_point": "free"} | pen.some({"margin": lambda p: p.number(0.0, 0.1)}, 0.5)


def place_of_stage(pen: Any, middle: list[float]) -> Table:
    """A stage's ball, or its rest, or its lap."""
    return pen.one_of(
        {"ball": {"centre": middle, "radius": pen.number(0.1, 0.5)}},
        {"conditions": [_along(axis, x) for axis, x in enumerate(middle)], "hold": pen.number(0.2, 1.0)},
        {"lap": 2},
    )


def _along(axis: int, x: float) -> Table:
    direction = [0.0, 0.0, 0.0]
    direction[axis] = 1.0
    return {"quantity": "position", "direction": direction, "equals": x}
