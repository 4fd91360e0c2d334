"""The layout of pages, drawn by matplotlib without pyplot.

Pages of timelines leave sizes to matplotlib (`column`). Pages with pictures fix them in inches, as vehicles
and names are placed in a picture by its size on the page.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from aerobat.arrays import Array
from aerobat.reporting.style import HEADLINE, MUTED, NORMAL, RC, RED, SMALL, TITLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Place = tuple[float, float, float, float]  # [in] left, bottom, width, height

PAGE_WIDTH = 11.5  # [in]
MARGIN = 0.3  # [in] at the left of a page
HEAD = 0.57  # [in] the page's title
FACT = 0.19  # [in] each line of facts under it
HEADING = 0.3  # [in] from axes to the title above them
TITLES = 0.62  # [in] above timelines, for their title and the stages' names
AXIS = 0.5  # [in] below timelines, for the time axis
LABELS = 0.74  # [in] left of axes, for their scale and label
BESIDE = 0.24  # [in] right of axes
DPI = 140  # 1610 pixels across a page


class PageRow(NamedTuple):
    """A row of axes on a page."""

    height: float  # [in] of the axes
    widths: tuple[float, ...] = (1.0, 1.0)  # of the parts of the page that the axes have, relative
    above: float = TITLES  # [in] room above the axes
    below: float = AXIS  # [in] room below the axes
    left: float = LABELS  # [in] room at the left of the axes


def spread_out(wanted: Array, pitch: float, low: float, high: float) -> Array:
    """Return places (k,) at least `pitch` apart and nearest to the wanted ones (least squares), in order.

    The places lie between `low` and `high` if there is room. The method is isotonic regression by pooling
    neighbours.
    """
    order = np.argsort(wanted, kind="stable")
    steps = pitch * np.arange(len(wanted))
    pools: list[list[float]] = []
    for place in wanted[order] - steps:
        pools.append([float(place)])
        while len(pools) > 1 and np.mean(pools[-2]) >= np.mean(pools[-1]):
            last = pools.pop()
            pools[-1] += last
    level = np.array([np.mean(pool) for pool in pools for _ in pool])
    result = np.empty(len(wanted))
    result[order] = np.clip(level, low, max(low, high - steps[-1] if len(steps) else low)) + steps
    return result


def import_undocumented() -> None:
    """Import matplotlib without the docstrings of its setters, a third of the import's time.

    The function is for processes in which nobody reads these docstrings.
    """
    if "matplotlib.figure" in sys.modules:
        return
    from matplotlib import artist

    lister = artist.kwdoc  # lists the properties of a class for its docstrings
    artist.kwdoc = lambda artist: ""
    try:
        import matplotlib.backends.backend_agg
        import matplotlib.figure  # noqa: F401
    finally:
        artist.kwdoc = lister


@contextmanager
def house_style() -> Iterator[None]:
    """Draw with the settings of `style` in place of the user's own matplotlib settings."""
    import matplotlib

    with matplotlib.rc_context(cast(Any, RC)):  # its stub lists every key
        yield


def blank_page(height: float, title: str, facts: Sequence[str], warnings: Sequence[str] = ()) -> Figure:
    """Return a page with its title and lines under it.

    Args:
        height: The height that remains below them [in].
        title: The title.
        facts: The lines under the title.
        warnings: More lines, in red.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    lines = [*((fact, MUTED) for fact in facts), *((warning, RED) for warning in warnings)]
    figure = Figure(figsize=(PAGE_WIDTH, height + HEAD + FACT * len(lines)), dpi=DPI)
    FigureCanvasAgg(figure)
    top = figure.get_size_inches()[1]
    write(figure, MARGIN, top - 0.34, title, size=HEADLINE, weight="bold", va="center")
    for k, (line, colour) in enumerate(lines):
        write(figure, MARGIN, top - 0.62 - FACT * k, line, size=NORMAL, color=colour, va="center")
    return figure


def page_of_rows(
    rows: Sequence[PageRow], title: str, facts: Sequence[str], warnings: Sequence[str] = ()
) -> tuple[Figure, list[list[Axes]]]:
    """Return a page of `blank_page` and the axes of its rows, from the top downward."""
    bottom = sum(row.above + row.height + row.below for row in rows)
    figure = blank_page(bottom, title, facts, warnings)
    found = []
    for row in rows:
        bottom -= row.above + row.height
        parts = PAGE_WIDTH * np.array(row.widths) / sum(row.widths)
        begins = np.cumsum(parts) - parts + row.left
        sizes = parts - row.left - BESIDE
        cells = zip(begins, sizes, strict=True)
        found.append([panel(figure, begin, bottom, width, row.height) for begin, width in cells])
        bottom -= row.below
    return figure, found


def write(figure: Figure, x: float, y: float, text: str, **options: Any) -> None:
    """Write text at a place on the page [in]."""
    across, up = figure.get_size_inches()
    figure.text(x / across, y / up, text, **options)


def panel(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Return axes at a place given in inches from the page's lower left corner."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))


def column(figure: Figure, height: float, rows: Sequence[float]) -> list[Axes]:
    """Return axes one above the other, whose sizes matplotlib finds so that their texts have room.

    Args:
        figure: A figure of `blank_page`.
        height: The height that remains below the page's lines [in].
        rows: The heights of the axes, relative to each other.
    """
    part = height / float(figure.get_size_inches()[1])
    figure.set_layout_engine("constrained", rect=(0.04, 0.0, 0.95, part), h_pad=0.1, hspace=0.0)
    return list(figure.subplots(len(rows), height_ratios=rows, squeeze=False)[:, 0])


def size_of(axes: Axes) -> Array:
    """Return the width and height of axes [in], (2,)."""
    return np.asarray(cast("Figure", axes.figure).get_size_inches() * axes.get_position().size)


def set_scale(axes: Axes, centre: Array, per_inch: float) -> None:
    """Show `per_inch` units of data an inch along both axes, about a centre (2,)."""
    half = size_of(axes) * per_inch / 2
    (left, bottom), (right, top) = centre - half, centre + half
    axes.set(xlim=(left, right), ylim=(bottom, top))


def write_by(
    axes: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], **options: Any
) -> None:
    """Write text at a place of axes, from (0, 0) to (1, 1), moved to the right and up by an offset [in]."""
    points = (72.0 * offset[0], 72.0 * offset[1])
    axes.annotate(text, place, points, xycoords="axes fraction", textcoords="offset points", **options)


def heading(axes: Axes, title: str, note: str = "") -> None:
    """Write a title above axes, and a note under it."""
    write_by(axes, title, (0.0, 1.0), (0.0, HEADING), size=TITLE, weight="bold", va="bottom")
    write_by(axes, note, (0.0, 1.0), (0.0, 0.1), size=SMALL, color=MUTED, va="bottom")


def legend(axes: Axes, above: float) -> None:
    """Write the labels of axes in a row `above` [in] them, at the right; nothing where there are none."""
    handles, names = axes.get_legend_handles_labels()
    if handles:
        place = (1.0, 1.0 + above / float(size_of(axes)[1]))
        axes.legend(
            handles, names, loc="lower right", bbox_to_anchor=place, ncols=len(handles), borderpad=0.0,
            borderaxespad=0.0, handlelength=1.3, handletextpad=0.4, columnspacing=1.1,
        )  # fmt: skip


def png(figure: Figure) -> bytes:
    """Return a figure as PNG, the same bytes for the same data, compressed for speed."""
    file = BytesIO()
    with house_style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing", UserWarning)  # a box stands for it
        figure.savefig(file, format="png", dpi=figure.dpi, pil_kwargs={"compress_level": 1})
    return file.getvalue()
