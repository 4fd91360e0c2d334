"""A figure of the paper: its picture, what the paper's shows, and how ours compares."""

from __future__ import annotations

import io
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING

from aerobat.reporting.page import house_style, png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE = 168  # letters to a line under a page's title
COLOURS = 256  # of a PNG file: a page has few, and takes a third of the room so


@dataclass(frozen=True)
class Caption:
    """The words that come with a figure."""

    number: int  # in the paper
    title: str
    paper: str  # what the paper's figure shows
    here: str  # what is drawn, and its numbers beside the paper's

    @property
    def heading(self) -> str:
        """The title with the figure's number."""
        return f"Fig. {self.number} · {self.title}"

    @property
    def lines(self) -> list[str]:
        """Both parts in lines that fit a page."""
        return [*wrap(f"Paper: {self.paper}", LINE), *wrap(f"Here: {self.here}", LINE)]


@dataclass(frozen=True, eq=False)
class PaperFigure:
    """A figure of the paper, drawn anew."""

    caption: Caption
    figure: Figure

    @property
    def pdf(self) -> bytes:
        """The bytes of its PDF file, without a date: the same for the same data."""
        file = io.BytesIO()
        with house_style():
            self.figure.savefig(file, format="pdf", metadata={"CreationDate": None})
        return file.getvalue()

    @property
    def png(self) -> bytes:
        """The bytes of its PNG file, the same for the same data."""
        from PIL import Image

        packed = io.BytesIO()
        drawn = Image.open(io.BytesIO(png(self.figure))).convert("RGB")
        drawn.quantize(COLOURS, dither=Image.Dither.NONE).save(packed, format="png", optimize=True)
        return packed.getvalue()
