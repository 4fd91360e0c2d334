"""`aerobat figures`: the paper's figures, drawn anew from real runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.interrupts import end_interrupts
from aerobat.cli.options import output
from aerobat.cli.progress import FiguresProgress, showing
from aerobat.cli.terminal import print_json
from aerobat.reporting.paper.figures import FIGURES, paper_figure, require_known
from aerobat.reporting.paper.files import require_own_page, write_figures
from aerobat.reporting.plain_data import to_json


@dataclass(frozen=True, kw_only=True)
class FiguresOptions:
    """Options of the paper's figures: where they go."""

    out: Annotated[Path, Parameter(group=output)] = Path("out") / "figures"
    """The folder to write to; figures of these numbers in it are replaced."""

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print captions and files as JSON on standard output, and nothing else."""


def figures(
    *numbers: int, options: Annotated[FiguresOptions, Parameter(name="*")] = FiguresOptions()
) -> None:
    """Draw the paper's figures anew, each from plans and flights that are made for it.

    Writes fig-N.png and fig-N.pdf of each to the output folder, and figures.md, a page with all of them and
    with what the paper's show and how ours compare. Nothing is kept from earlier runs; the same version
    draws the same bytes on the same machine.

    Parameters
    ----------
    numbers
        Of 2, 3, 5, 6, 8, 9 and 10. Default: all of them.
    """
    drawn = sorted(set(numbers)) or list(FIGURES)
    require_known(drawn)
    require_own_page(options.out)
    made = []
    with showing(FiguresProgress(len(drawn))) as progress:
        for number in drawn:
            progress.figure(number)
            made.append(paper_figure(number, progress.begin))
    end_interrupts()
    written = write_figures(made, options.out)
    if options.json:
        facts = [
            {"figure": each.caption.number, "paper": each.caption.paper, "here": each.caption.here}
            for each in made
        ]
        print_json(to_json({"figures": facts, "files": list(map(str, written))}))
        return
    for each in made:
        print(f"{each.caption.heading}: {each.caption.here}\n")
    print(f"written to {options.out}/")
