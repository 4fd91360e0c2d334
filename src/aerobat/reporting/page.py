"""Blank pages and saved pages; matplotlib's drawing library without pyplot, its window manager."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.reporting.style import DPI, HEADLINE, MUTED, NORMAL, RC, SMALL, TITLE
from aerobat.storage import whole_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# What each format is told: no dates, so that the same data give the same file, and for PNG a fast deflate.
_OPTIONS: dict[str, dict[str, Any]] = {
    ".png": {"pil_kwargs": {"compress_level": 1}},
    ".pdf": {"metadata": {"CreationDate": None}},
    ".svg": {"metadata": {"Date": None}},
}


MARGIN = 0.3  # [in] at the left of a page
HEADING = 0.3  # [in] from axes to the title above them


@contextmanager
def house_style() -> Iterator[None]:
    """Whatever is drawn inside looks as `style` says, whatever the user's own matplotlib settings."""
    import matplotlib

    with matplotlib.rc_context(cast(Any, RC)):  # its stub lists every key
        yield


def blank_page(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI)
    FigureCanvasAgg(figure)
    return figure


def panel(figure: Figure, left: float, bottom: float, width: float, height: float, **options: Any) -> Axes:
    """Axes at a place given in inches from the page's lower left corner."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up), **options)


def size_of(axes: Axes) -> Array:
    """Width and height of axes [in], (2,)."""
    return np.asarray(cast("Figure", axes.figure).get_size_inches() * axes.get_position().size)


def headline(figure: Figure, title: str, facts: Sequence[str]) -> None:
    """The page's title, and lines of facts under it."""
    width, height = figure.get_size_inches()
    figure.text(MARGIN / width, 1.0 - 0.34 / height, title, size=HEADLINE, weight="bold", va="center")
    for k, fact in enumerate(facts):
        place = MARGIN / width, 1.0 - (0.62 + 0.19 * k) / height
        figure.text(*place, fact, size=NORMAL, color=MUTED, va="center")


def heading(axes: Axes, title: str, note: str = "") -> None:
    """A title above axes, and a note under it."""
    height = float(size_of(axes)[1])
    place: dict[str, Any] = {"transform": axes.transAxes, "va": "bottom"}
    axes.text(0.0, 1.0 + HEADING / height, title, size=TITLE, weight="bold", **place)
    axes.text(0.0, 1.0 + 0.1 / height, note, size=SMALL, color=MUTED, **place)


def legend(axes: Axes, above: float) -> None:
    """The names of what is drawn in a row above axes, at the right [in]; nothing when nothing has a name."""
    handles, names = axes.get_legend_handles_labels()
    if handles:
        place = (1.0, 1.0 + above / float(size_of(axes)[1]))
        axes.legend(
            handles, names, loc="lower right", bbox_to_anchor=place, ncols=len(handles), borderpad=0.0,
            borderaxespad=0.0, handlelength=1.3, handletextpad=0.4, columnspacing=1.1,
        )  # fmt: skip


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, PDF or SVG, whole or not at all.

    Raises SpecError for a name with another ending, or a place that cannot be written.
    """
    ending = Path(path).suffix.lower()
    if ending not in _OPTIONS:
        raise SpecError(
            f"cannot save a figure as '{path}'; give it a name that ends in {', '.join(_OPTIONS)}"
        )
    with whole_file(path) as temporary:
        _write(figure, temporary, ending)


def png(figure: Figure) -> bytes:
    """A figure as the bytes of a PNG file."""
    file = BytesIO()
    _write(figure, file, ".png")
    return file.getvalue()


def _write(figure: Figure, file: Path | BytesIO, ending: str) -> None:
    with house_style():
        figure.savefig(file, format=ending[1:], dpi=figure.dpi, **_OPTIONS[ending])
