"""The paper's figures, drawn from flights of its experiments."""

from aerobat.reporting.paper.figures import FIGURES, paper_figure
from aerobat.reporting.paper.paper_figure import PaperFigure

__all__ = ["FIGURES", "PaperFigure", "paper_figure"]
