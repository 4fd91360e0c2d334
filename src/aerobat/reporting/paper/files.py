"""The paper's figures as files: vector and pixels of each, and a page that shows them with their captions."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from aerobat.errors import SpecError
from aerobat.reporting.paper.paper_figure import Caption, PaperFigure
from aerobat.storage import write_whole

PAGE = "figures.md"
INTRODUCTION = """# The paper's figures

Lusk and Tordesillas, *Trajectory Optimization for Multirotors*: its figures, each from plans and flights
made for it by `python -m aerobat.reporting.paper`. Under each stand what the paper's shows and how ours
compares. Figs. 1, 4 and 7 are photographs and a block diagram.

"""
SECTION = re.compile(r"^## Fig\. (\d+) ", re.MULTILINE)


def write_figures(figures: Sequence[PaperFigure], folder: Path) -> list[Path]:
    """Write fig-N.png and fig-N.pdf of each figure, and the page; figures on it that are not given stay.

    Each file appears whole or not at all. Raises SpecError where the place cannot be written, and where a
    page of that name is somebody else's.
    """
    page = folder / PAGE
    sections = _sections(page) | {each.caption.number: _section(each.caption) for each in figures}
    written = []
    for each in figures:
        for suffix, content in ((".png", each.png), (".pdf", each.pdf)):
            written.append(folder / f"{_stem(each.caption)}{suffix}")
            write_whole(written[-1], content)
    write_whole(page, INTRODUCTION + "\n".join(sections[number] for number in sorted(sections)))
    return [*written, page]


def require_own_page(folder: Path) -> None:
    """Raise SpecError where the folder's page is somebody else's."""
    _sections(folder / PAGE)


def _stem(caption: Caption) -> str:
    return f"fig-{caption.number}"


def _section(caption: Caption) -> str:
    stem = _stem(caption)
    return (
        f"## {caption.heading}\n\n![{caption.title}]({stem}.png)\n\n*The paper:* {caption.paper}\n\n"
        f"*Here:* {caption.here} ([vector]({stem}.pdf))\n"
    )


def _sections(page: Path) -> dict[int, str]:
    """The sections of a page that was written before, by their figures' numbers."""
    if not page.exists():
        return {}
    try:
        introduction, *rest = SECTION.split(page.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        introduction, rest = "", []
    if introduction.partition("\n")[0] != INTRODUCTION.partition("\n")[0]:
        maker = "`python -m aerobat.reporting.paper`"
        raise SpecError(f"{page} was not written by {maker}; give a folder of its own")
    numbers, texts = rest[::2], rest[1::2]
    return {
        int(number): f"## Fig. {number} {text.rstrip()}\n"
        for number, text in zip(numbers, texts, strict=True)
    }
