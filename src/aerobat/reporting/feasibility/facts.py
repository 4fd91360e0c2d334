"""Facts of feasibility maps and of the smallest values that a problem needs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from aerobat.reporting.facts import NONE, Columns, Fact, Facts, facts, line, picture, record
from aerobat.reporting.feasibility.figure import Kind, kinds_of, letter_of, map_figure
from aerobat.studies.feasibility import Cell, Feasibility, FeasibilityMap, Requirement

WIDE = 14  # values across, above which cells have only letters


@facts.register
def _(found: FeasibilityMap) -> Iterator[Fact]:
    """Yield a row for each cell. The table of a map over two fields is a grid of letters, with a legend."""
    title = f"{found.problem.name} · {found.vehicle.name}"
    is_grid = len(found.axes) > 1
    if is_grid:
        down, across = found.axes
        title += f" · duration [s] over {down.label} (down) and {across.label} (across)"
    yield Fact("table", Columns(found.table))
    yield line("", title)
    yield from record(problem=found.problem.name, vehicle=found.vehicle.name)
    yield from record(over={axis.name: axis.values for axis in found.axes})
    yield from record(units={axis.name: axis.unit for axis in found.axes})
    yield from record(counts={feasibility.value: count for feasibility, count in found.counts.items()})
    yield Fact("cells", [_cell(found, cell) for cell in found.cells], "" if is_grid else "cells")
    if is_grid:
        yield Fact("", _grid(found), "grid")
        yield from (line("", _legend(found, kind)) for kind in kinds_of(found).values())


picture.register(FeasibilityMap, map_figure)


def requirements(problem: str, vehicle: str, found: Iterable[Requirement]) -> Facts:
    """Return the facts of the smallest values that a problem needs.

    Args:
        problem: The name of the problem.
        vehicle: The name of the vehicle.
        found: The requirements, one for each quantity.
    """
    each = (Fact(one.quantity, one, one.quantity) for one in found)
    return Facts(
        (
            Fact("problem", problem, text=f"{problem} · {vehicle}"),
            Fact("vehicle", vehicle),
            Fact("requirements", Facts(each)),
        )
    )


@facts.register
def _(found: Requirement) -> Iterator[Fact]:
    """Yield the smallest value; it is None where no value suffices, and where no limit is needed."""
    refused = found.shown(found.refused)
    least = f"none will do, {refused} neither"
    if found.value is not None:
        least = found.shown(found.value) + _sizes(found)
    yield Fact("unit", found.unit)
    yield Fact("least", found.value, "least", least)
    if found.plan is not None:
        proof = "" if found.plan.certificate is None else f", {found.plan.certificate.why}"
        yield Fact("duration_s", found.plan.duration, "planned", f"{found.plan.duration:.3f} s{proof}")
    beside = found.refusal if found.plan is None else f"at {refused} {found.feasibility}: {found.refusal}"
    yield Fact("refused", found.refused, "refused" if found.plan is None else "beside it", beside)
    yield from record(feasibility=found.feasibility.value, refusal=found.refusal, trials=found.trials)


def _sizes(found: Requirement) -> str:
    """Return the openings of a plan's gates as text, for quantities that reduce them."""
    if found.quantity not in ("gate", "gate-height") or found.plan is None:
        return ""
    sizes = (
        "{} {:.3g} x {:.3g} m".format(gate.name, *gate.opening.size) for gate in found.plan.problem.gates
    )
    return f" ({', '.join(sizes)})"


def _cell(found: FeasibilityMap, cell: Cell) -> Facts:
    """Return the facts of a cell; duration and reserve are None where there is no plan."""
    limits = ", ".join(cell.limits)
    said = limits if cell.is_planned else f"{limits}: {cell.sentence}".removeprefix(": ")
    reserve = NONE if cell.reserve is None else f"{100 * cell.reserve:.2g} %"
    values = (
        Fact(axis.name, value, axis.label, f"{value:g}")
        for axis, value in zip(found.axes, cell.values, strict=True)
    )
    return Facts(
        (
            *values,
            Fact("feasibility", cell.feasibility.value, "feasibility", style=_style(cell)),
            Fact("duration_s", cell.duration, "duration", unit="s", form=".3f"),
            Fact("limits", cell.limits),
            Fact("reserve", cell.reserve, "reserve", reserve),
            Fact("sentence", cell.sentence, "limits", said),
        )
    )


def _grid(found: FeasibilityMap) -> list[Facts]:
    """Return the rows of a grid: the durations and letters of its cells."""
    down, across = found.axes
    kinds, width = kinds_of(found), len(across.values)
    rows = []
    for i, value in enumerate(down.values):
        cells = found.cells[i * width : (i + 1) * width]
        row = [Fact("", value, down.label, f"{value:g}")]
        for column, cell in zip(across.values, cells, strict=True):
            letter = letter_of(cell, kinds)
            duration = NONE if cell.duration is None else f"{cell.duration:.2f}"
            text = letter if width > WIDE else f"{duration} {letter}"
            row.append(Fact("", 0.0, f"{column:g}", text, style=_style(cell)))
        rows.append(Facts(row))
    return rows


def _style(cell: Cell) -> str:
    """Return the style of a cell: faint without a plan, red for a plan that is not flyable."""
    if cell.feasibility is Feasibility.NOT_FLYABLE:
        return "red"
    return "" if cell.is_planned else "dim"


def _legend(found: FeasibilityMap, kind: Kind) -> str:
    """Return the meaning of a kind's letter, its number of cells, and why the first cell has no plan."""
    cells = "1 cell" if kind.count == 1 else f"{kind.count} cells"
    where = ", ".join(
        f"{axis.name} {value:g}" for axis, value in zip(found.axes, kind.first.values, strict=True)
    )
    sentence = "" if kind.first.is_planned else f"; at {where}: {kind.first.sentence}"
    return f"{kind.letter}  {kind.name} ({cells}){sentence}"
