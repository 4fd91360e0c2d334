"""Maps as tables and pictures: every cell is there, letters mean what the legend says, all is legible."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from matplotlib.colors import to_hex
from rich.console import Console

import aerobat as ab
from aerobat.reporting.feasibility.figure import kinds_of
from aerobat.reporting.notebooks import html, png
from aerobat.reporting.plain_data import plain
from aerobat.reporting.style import RED
from aerobat.reporting.tables import table
from aerobat.studies.feasibility import Axis, Cell, Feasibility
from reporting_cases import require_legible

pytestmark = pytest.mark.filterwarnings("error")  # drawing warns of nothing
LIMITS = (("max_thrust",), ("limits.velocity", "max_thrust"), ("gate",), ("rotors",), ())


def made(rows: int, columns: int) -> ab.FeasibilityMap:
    """A map with cells of every kind, of one field where there is one row."""
    kinds = list(Feasibility)
    axes = (
        Axis("angle", tuple(map(float, range(rows))), "°"),
        Axis("speed", tuple(2.0 * np.arange(columns)), "m/s"),
    )
    axes = axes if rows > 1 else axes[1:]
    cells = []
    for number in range(rows * columns):
        kind = kinds[number * 7 % 11 % len(kinds)]
        is_planned = kind in (Feasibility.PLANNED, Feasibility.NOT_FLYABLE)
        place = divmod(number, columns)
        values = tuple(axis.values[i] for axis, i in zip(axes, place[-len(axes) :], strict=True))
        duration, reserve = (2.0 + 0.01 * number, 0.02) if is_planned else (None, None)
        cells.append(Cell(values, kind, duration, LIMITS[number % len(LIMITS)], reserve, f"why {number}"))
    return ab.FeasibilityMap(ab.load_problem("half-flip"), ab.load_vehicle("agile-quad"), axes, tuple(cells))


def shown(found: ab.FeasibilityMap, width: int = 200) -> str:
    console = Console(file=StringIO(), width=width)
    console.print(table(found))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize(
    ("rows", "columns"),
    [(10, 10), (3, 2), pytest.param(16, 24, marks=pytest.mark.slow), (1, 5), (1, 50), (2, 1)],
)
def test_a_page_is_legible_however_many_cells_there_are(rows: int, columns: int, monkeypatch) -> None:
    figure = ab.map_figure(made(rows, columns))
    if rows * columns > 6:
        require_legible(figure, monkeypatch)
    legend = [line for text in figure.axes[0].texts for line in text.get_text().splitlines()]
    for kind in kinds_of(made(rows, columns)).values():
        assert sum(text.startswith(f"{kind.letter}   {kind.name} ({kind.count})") for text in legend) == 1


def test_red_cells_are_those_whose_plan_is_not_flyable() -> None:
    found = made(10, 10)
    (image,) = ab.map_figure(found).axes[0].get_images()
    colours = [to_hex(colour) for colour in np.asarray(image.get_array()).reshape(-1, 4)]
    red = [colour == RED for colour in colours]
    assert red == [cell.feasibility is Feasibility.NOT_FLYABLE for cell in found.cells]
    assert any(red)


def test_the_picture_s_axes_have_their_units() -> None:
    grid, line = (ab.map_figure(made(*size)).axes[0] for size in ((4, 4), (1, 4)))
    assert (grid.get_ylabel(), grid.get_xlabel()) == ("angle [°]", "speed [m/s]")
    assert (line.get_ylabel(), line.get_xlabel()) == ("duration [s]", "speed [m/s]")


def test_a_map_without_any_plan_is_drawn_too() -> None:
    found = made(4, 4)
    cells = tuple(replace(c, feasibility=Feasibility.REFUSED, duration=None) for c in found.cells)
    assert "– " in shown(replace(found, cells=cells))
    assert png(replace(found, cells=cells)) is not None


def test_a_grid_has_a_duration_and_a_letter_in_each_cell_and_says_what_the_letters_mean() -> None:
    found = made(4, 5)
    kinds = kinds_of(found)
    lines = shown(found).splitlines()
    assert "duration [s] over angle [°] (down) and speed [m/s] (across)" in lines[0]
    for row in range(4):
        cells = found.cells[5 * row : 5 * row + 5]
        texts = [
            f"{'–' if c.duration is None else f'{c.duration:.2f}'} {kinds[c.feasibility, c.limits].letter}"
            for c in cells
        ]
        assert lines[2 + row].split() == [str(row), *" ".join(texts).split()]
    legend = lines[6:]
    assert sum(kind.count for kind in kinds.values()) == 20
    for kind in kinds.values():
        (line,) = (line for line in legend if line.startswith(f"{kind.letter}  "))
        assert kind.name in line
        assert (kind.first.sentence in line) == (not kind.first.is_planned)


def test_a_line_says_of_every_value_why_it_has_no_plan() -> None:
    text = shown(made(1, 12))
    for cell in made(1, 12).cells:
        assert (cell.sentence in text) == (not cell.is_planned)


def test_plain_data_has_every_cell_and_a_notebook_the_table() -> None:
    found = made(3, 4)
    report = plain(found)
    assert [cell["sentence"] for cell in report["cells"]] == [cell.sentence for cell in found.cells]
    assert report["over"] == {"angle": [0.0, 1.0, 2.0], "speed": [0.0, 2.0, 4.0, 6.0]}
    assert report["units"] == {"angle": "°", "speed": "m/s"}
    assert sum(report["counts"].values()) == 12
    assert "no plan" in html(found)
