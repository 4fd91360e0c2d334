"""Maps of what is feasible, and what a problem needs: as tables for people, as plain data for machines."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import Any

from rich.table import Table
from rich.text import Text

from aerobat.reporting.feasibility.legend import kinds_of, letter_of
from aerobat.reporting.tables import Fact, facts_table
from aerobat.studies.feasibility import Cell, Feasibility, FeasibilityMap, Requirement

NONE = "–"  # in place of a number that there is not
WIDE = 14  # values across: of more, letters alone fit


def map_table(found: FeasibilityMap) -> Table:
    """The durations of the plans and the limits that bind: of two fields a grid, of one a row a value."""
    return _line(found) if len(found.axes) == 1 else _grid(found)


def map_report(found: FeasibilityMap) -> dict[str, Any]:
    """The same as plain data, a table a cell; None where there is no plan."""
    return {
        "problem": found.problem.name,
        "vehicle": found.vehicle.name,
        "over": {axis.name: list(axis.values) for axis in found.axes},
        "units": {axis.name: axis.unit for axis in found.axes},
        "counts": {feasibility.value: count for feasibility, count in found.counts.items()},
        "cells": [
            dict(zip((axis.name for axis in found.axes), cell.values, strict=True))
            | {
                "feasibility": cell.feasibility.value,
                "duration_s": cell.duration,
                "limits": list(cell.limits),
                "reserve": cell.reserve,
                "sentence": cell.sentence,
            }
            for cell in found.cells
        ],
    }


def _grid(found: FeasibilityMap) -> Table:
    down, across = found.axes
    kinds = kinds_of(found)
    title = f"{_title(found)} · duration [s] over {down.label} (down) and {across.label} (across)"
    table = Table(box=None, pad_edge=False)
    table.add_column(down.label, style="bold", no_wrap=True)
    for value in across.values:
        table.add_column(f"{value:g}", justify="right", no_wrap=True)
    width = len(across.values)
    for i, value in enumerate(down.values):
        row = found.cells[i * width : (i + 1) * width]
        texts = (_text(cell, letter_of(cell, kinds), width > WIDE) for cell in row)
        table.add_row(f"{value:g}", *texts)
    page = Table.grid()  # the legend may be wider than the cells
    for part in (Text(title, style="italic"), table, Text("\n".join(_legend(found)), style="italic")):
        page.add_row(part)
    return page


def _line(found: FeasibilityMap) -> Table:
    (axis,) = found.axes
    names = (axis.label, "", "duration", "reserve", "limits")
    table = Table(*names, title=Text(_title(found)), title_justify="left", box=None, pad_edge=False)
    for cell in found.cells:
        duration = NONE if cell.duration is None else f"{cell.duration:.3f} s"
        reserve = NONE if cell.reserve is None else f"{100 * cell.reserve:.2g} %"
        limits = ", ".join(cell.limits)
        said = limits if cell.is_planned else f"{limits}: {cell.sentence}".removeprefix(": ")
        table.add_row(f"{cell.values[0]:g}", _coloured(cell, cell.feasibility), duration, reserve, said)
    return table


def _title(found: FeasibilityMap) -> str:
    return f"{found.problem.name} · {found.vehicle.name}"


def _text(cell: Cell, letter: str, is_narrow: bool) -> Text:
    duration = NONE if cell.duration is None else f"{cell.duration:.2f}"
    return _coloured(cell, letter if is_narrow else f"{duration} {letter}")


def _coloured(cell: Cell, text: str) -> Text:
    """Text, faint where there is no plan, red where one is not as it should be."""
    if cell.feasibility is Feasibility.NOT_FLYABLE:
        return Text(text, style="red")
    return Text(text, style="" if cell.is_planned else "dim")


def _legend(found: FeasibilityMap) -> Iterable[str]:
    """What the letters stand for, each with its number of cells; of refusals the first one's sentence."""
    for kind in kinds_of(found).values():
        cells = "1 cell" if kind.count == 1 else f"{kind.count} cells"
        where = ", ".join(
            f"{axis.name} {value:g}" for axis, value in zip(found.axes, kind.first.values, strict=True)
        )
        sentence = "" if kind.first.is_planned else f"; at {where}: {kind.first.sentence}"
        yield f"{kind.letter}  {kind.name} ({cells}){sentence}"


def requirements_table(problem: str, vehicle: str, found: Iterable[Requirement]) -> Table:
    """The least that a problem needs of each quantity.

    Args:
        problem: Its name.
        vehicle: The name of what flies it.
        found: The answers.
    """
    return facts_table(f"{problem} · {vehicle}", {each.quantity: _facts(each) for each in found})


def requirements_report(problem: str, vehicle: str, found: Iterable[Requirement]) -> dict[str, Any]:
    """The same as plain data; None for a quantity of which none will do, and for no limit.

    Args:
        problem: Its name.
        vehicle: The name of what flies it.
        found: The answers.
    """
    return {
        "problem": problem,
        "vehicle": vehicle,
        "requirements": [
            {
                "quantity": each.quantity,
                "unit": each.unit,
                "least": None if each.value is None else _finite(each.value),
                "duration_s": None if each.plan is None else each.plan.duration,
                "refused": _finite(each.refused),
                "feasibility": each.feasibility.value,
                "refusal": each.refusal,
                "trials": each.trials,
            }
            for each in found
        ],
    }


def _finite(value: float) -> float | None:
    return value if isfinite(value) else None


def _facts(found: Requirement) -> Iterable[Fact]:
    if found.value is None or found.plan is None:
        yield "least", f"none will do, {found.shown(found.refused)} neither"
        yield "refused", found.refusal
        return
    yield "least", found.shown(found.value) + _sizes(found)
    proof = "" if found.plan.certificate is None else f", {found.plan.certificate.why}"
    yield "planned", f"{found.plan.duration:.3f} s{proof}"
    yield "beside it", f"at {found.shown(found.refused)} {found.feasibility}: {found.refusal}"


def _sizes(found: Requirement) -> str:
    """The openings of the gates of a plan, where those were made smaller."""
    if found.quantity != "gate" or found.plan is None:
        return ""
    sizes = (
        "{} {:.3g} x {:.3g} m".format(gate.name, *gate.opening.size) for gate in found.plan.problem.gates
    )
    return f" ({', '.join(sizes)})"
