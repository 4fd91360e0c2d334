"""The paper's figures that can be drawn, by their numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType

from aerobat.errors import SpecError
from aerobat.reporting.paper.gates import figure_6
from aerobat.reporting.paper.intervals import figure_2
from aerobat.reporting.paper.maneuvers import figure_5
from aerobat.reporting.paper.paper_figure import PaperFigure
from aerobat.reporting.paper.stage_attitudes import figure_3
from aerobat.reporting.paper.time_search import figure_8, figure_9, figure_10

Begin = Callable[[str], None]  # called with what is planned or flown next

FIGURES: Mapping[int, Callable[[Begin], PaperFigure]] = MappingProxyType(
    {2: figure_2, 3: figure_3, 5: figure_5, 6: figure_6, 8: figure_8, 9: figure_9, 10: figure_10}
)


def paper_figure(number: int, begin: Begin = lambda name: None) -> PaperFigure:
    """Plan, fly and draw what one of the paper's figures shows.

    Args:
        number: Of the figure, in the paper.
        begin: Called with a few words on what is planned or flown next.

    Raises:
        SpecError: There is no such figure here, which the sentence says.
    """
    require_known([number])
    return FIGURES[number](begin)


def require_known(numbers: Iterable[int]) -> None:
    """Raise SpecError for a number that no figure has, and say which ones there are."""
    for number in numbers:
        if number not in FIGURES:
            *first, last = map(str, FIGURES)
            raise SpecError(
                f"there is no figure {number} to draw; give some of {', '.join(first)} and {last}"
            )
