"""The paper's figures, each drawn from plans and flights that are made for it.

python examples/paper_figures.py [FOLDER] [NUMBER ...]

Writes fig-N.png and fig-N.pdf of each figure to the folder, and figures.md, a page with all of them, what the
paper's show and how ours compare. The same version draws the same bytes on the same machine.
"""

from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from aerobat.storage import write_whole
from paper.gates import figure_6
from paper.intervals import figure_2
from paper.maneuvers import figure_5
from paper.paper_figure import Caption, PaperFigure
from paper.stage_attitudes import figure_3
from paper.time_search import figure_8, figure_9, figure_10

FIGURES: Mapping[int, Callable[[Callable[[str], None]], PaperFigure]] = {
    2: figure_2,
    3: figure_3,
    5: figure_5,
    6: figure_6,
    8: figure_8,
    9: figure_9,
    10: figure_10,
}
INTRODUCTION = """# The paper's figures

This page reproduces the figures of Lusk and Tordesillas, *Trajectory Optimization for Multirotors*. The
command `python examples/paper_figures.py` plans and simulates the flights, and draws the figures. The text
under each figure describes the paper's figure and compares it with ours. Figs. 1, 4 and 7 of the paper are
photographs and a block diagram.

"""


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the figures that the arguments name."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("figures"), metavar="FOLDER")
    parser.add_argument("numbers", nargs="*", type=int, metavar="NUMBER")
    given = parser.parse_args(arguments)
    if unknown := set(given.numbers) - set(FIGURES):
        parser.error(
            f"there is no figure {min(unknown)} to draw; give some of {', '.join(map(str, FIGURES))}"
        )
    numbers = sorted(set(given.numbers)) or FIGURES
    made = [FIGURES[number](partial(print, f"figure {number}:")) for number in numbers]
    write_figures(made, given.folder)
    for each in made:
        print(f"{each.caption.heading}: {each.caption.here}\n")
    print(f"written to {given.folder}/")


def write_figures(figures: Iterable[PaperFigure], folder: Path) -> None:
    """Write fig-N.png and fig-N.pdf of each figure, and the page, each file whole or not at all."""
    sections = []
    for each in figures:
        write_whole(folder / f"fig-{each.caption.number}.png", each.png)
        write_whole(folder / f"fig-{each.caption.number}.pdf", each.pdf)
        sections.append(_section(each.caption))
    write_whole(folder / "figures.md", INTRODUCTION + "\n".join(sections))


def _section(caption: Caption) -> str:
    stem = f"fig-{caption.number}"
    return (
        f"## {caption.heading}\n\n![{caption.title}]({stem}.png)\n\n*The paper:* {caption.paper}\n\n"
        f"*Here:* {caption.here} ([vector]({stem}.pdf))\n"
    )


if __name__ == "__main__":
    main()
