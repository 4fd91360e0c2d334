"""The figure of a feasibility map: durations as colours or as a line, and letters for limits that bind."""

from __future__ import annotations

from dataclasses import dataclass
from string import ascii_lowercase
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.reporting.page import blank_page, column, house_style, write_by
from aerobat.reporting.style import BAND, BLUE, FAINT, HAIR, INK, MUTED, PAPER, RED, SMALL
from aerobat.studies.feasibility.feasibility_map import Cell, FeasibilityMap
from aerobat.studies.feasibility.probe import Feasibility

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FILLS = {  # of cells without a plan that flies
    Feasibility.NOT_FLYABLE: RED,
    Feasibility.NO_PLAN: FAINT,
    Feasibility.REFUSED: HAIR,
    Feasibility.NO_ANSWER: PAPER,
}
WIDTH = 9.6  # [in] about the width of a grid
ROW = 0.2  # [in] height of a line of the legend


@validated
def map_figure(found: FeasibilityMap) -> Figure:
    """Draw for which values there is a plan, how long it takes, and which limits bind.

    A map over two fields is a grid, with the first field upward; a map over one field is a line. Cells
    without a plan are grey, and plans that are not flyable are red.
    """
    kinds = kinds_of(found)
    durations = np.array([c.duration if c.is_planned else np.nan for c in found.cells], dtype=float)
    texts = [f"{kind.letter}   {kind.name} ({kind.count})" for kind in kinds.values()]
    legend = [line for text in texts for line in wrap(text, 150)]  # letters fit the page
    height = _height(found) + 0.95 + ROW * len(legend)
    counts = ", ".join(f"{count} {feasibility}" for feasibility, count in found.counts.items())
    with house_style():
        title = f"{found.problem.name} · feasible region for {found.vehicle.name}"
        figure = blank_page(height, title, [f"cells: {counts}"])
        (axes,) = column(figure, height, [1.0])
        if len(found.axes) == 1:
            _draw_line(axes, found, kinds, durations)
        else:
            _draw_grid(figure, axes, found, kinds, durations)
        style = {"size": SMALL, "color": MUTED, "va": "top", "linespacing": 1.9}
        write_by(axes, "\n".join(legend), (0.0, 0.0), (0.0, -0.55), **style)
    return figure


def _height(found: FeasibilityMap) -> float:
    """Return about the height of the axes [in], which follows from the number of a grid's rows."""
    rows = len(found.axes[0].values) if len(found.axes) > 1 else 1
    return float(np.clip(0.5 * rows, 2.6, 6.5))


def _draw_grid(figure: Figure, axes: Axes, found: FeasibilityMap, kinds: Kinds, durations: Array) -> None:
    """Draw the cells of a map over two fields, and the scale of durations beside them."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgba

    rows, columns = (len(axis.values) for axis in found.axes)
    known = durations[np.isfinite(durations)]
    shortest, longest = (known.min(), known.max()) if len(known) else (0.0, 0.0)
    shades = LinearSegmentedColormap.from_list("durations", [BAND, BLUE])
    scale = ScalarMappable(Normalize(shortest, longest), shades)
    colours = scale.to_rgba(durations)
    for number, cell in enumerate(found.cells):
        if not cell.is_planned:
            colours[number] = to_rgba(FILLS[cell.feasibility])
    axes.imshow(colours.reshape(rows, columns, 4), origin="lower", aspect="auto", interpolation="nearest")
    for axis, set_ticks, set_label, size in (
        (found.axes[0], axes.set_yticks, axes.set_ylabel, _height(found) / ROW),
        (found.axes[1], axes.set_xticks, axes.set_xlabel, WIDTH / 0.37),
    ):
        step = max(1, int(np.ceil(len(axis.values) / size)))
        places = np.arange(0, len(axis.values), step)
        set_ticks(places, [f"{axis.values[i]:g}" for i in places])
        set_label(axis.label)
    axes.grid(visible=False)
    _write_cells(axes, found, kinds, np.asarray(scale.norm(durations)))
    if longest > shortest:
        bar = figure.colorbar(scale, ax=axes, label="duration [s]", aspect=20, pad=0.02)
        bar.ax.grid(visible=False)


def _write_cells(axes: Axes, found: FeasibilityMap, kinds: Kinds, parts: Array) -> None:
    """Write into each cell of a grid what it has room for; `parts` are durations on their scale, 0 to 1."""
    columns = len(found.axes[1].values)
    width, height = WIDTH / columns, _height(found) / len(found.axes[0].values)
    for number, (cell, part) in enumerate(zip(found.cells, parts, strict=True)):
        row, column = divmod(number, columns)
        is_dark = cell.is_planned and part > 0.55  # of the scale: from there letters are white
        text = _cell_text(cell, letter_of(cell, kinds), width, height)
        axes.text(column, row, text, size=SMALL, ha="center", va="center", color=PAPER if is_dark else INK)


def _cell_text(cell: Cell, letter: str, width: float, height: float) -> str:
    """Return the text that a cell of this size [in] holds: duration and letter, the letter, or nothing."""
    if width >= 0.42 and height >= 0.2 and cell.duration is not None:
        return f"{cell.duration:.2f} {letter}"
    return letter if width >= 0.12 and height >= 0.14 else ""


def _draw_line(axes: Axes, found: FeasibilityMap, kinds: Kinds, durations: Array) -> None:
    """Draw durations over the values of one field, letters above them, and bands where there is no plan."""
    (axis,) = found.axes
    places = np.arange(len(axis.values))
    axes.plot(places, durations, color=BLUE, marker="o", markersize=4)
    axes.set_xlim(-0.5, len(places) - 0.5)
    known = durations[np.isfinite(durations)]
    top = 1.15 * float(known.max()) if len(known) else 1.0
    axes.set_ylim(0.0, top)
    for place, cell in zip(places, found.cells, strict=True):
        if not cell.is_planned:
            axes.axvspan(place - 0.5, place + 0.5, color=FILLS[cell.feasibility], linewidth=0.0)
        if len(places) <= 60:  # so many letters stand side by side
            axes.text(float(place), 0.97 * top, letter_of(cell, kinds), size=SMALL, ha="center", va="top")
    step = max(1, len(places) // 20)
    axes.set_xticks(places[::step], [f"{value:g}" for value in axis.values[::step]])
    axes.set(xlabel=axis.label, ylabel="duration [s]")


@dataclass(frozen=True)
class Kind:
    """Cells of one feasibility that the same limits bind."""

    letter: str
    count: int
    first: Cell

    @property
    def name(self) -> str:
        """The name of the kind in a few words: its feasibility and the limits that bind."""
        return f"{self.first.feasibility}: {', '.join(self.first.limits) or 'no limit named'}"


Kinds = dict[tuple[Feasibility, tuple[str, ...]], Kind]  # by feasibility and limits


def kinds_of(found: FeasibilityMap) -> Kinds:
    """Return the kinds of a map's cells, in the order of feasibility, of each the most frequent first."""
    alike: dict[tuple[Feasibility, tuple[str, ...]], list[Cell]] = {}
    for cell in found.cells:
        alike.setdefault((cell.feasibility, cell.limits), []).append(cell)
    order = list(Feasibility)
    keys = sorted(alike, key=lambda key: (order.index(key[0]), -len(alike[key]), key[1]))
    return {key: Kind(_letter(i), len(alike[key]), alike[key][0]) for i, key in enumerate(keys)}


def letter_of(cell: Cell, kinds: Kinds) -> str:
    """Return the letter of a cell's kind."""
    return kinds[cell.feasibility, cell.limits].letter


def _letter(number: int) -> str:
    """Return the letter of a number from 0: a, b, ... z, a2, b2 and so on."""
    turn, place = divmod(number, len(ascii_lowercase))
    return ascii_lowercase[place] + (str(turn + 1) if turn else "")
