"""Draw the paper's figures anew, each from plans and flights that are made for it.

python -m aerobat.reporting.paper [NUMBER ...] [--out FOLDER]

Writes fig-N.png and fig-N.pdf of each to the folder, and figures.md, a page with all of them and with what
the paper's show and how ours compare. The same version draws the same bytes on the same machine.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from aerobat.errors import AerobatError
from aerobat.reporting.paper.figures import FIGURES, paper_figure, require_known
from aerobat.reporting.paper.files import require_own_page, write_figures


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the figures that the arguments name."""
    parser = ArgumentParser(
        "python -m aerobat.reporting.paper",
        description=__doc__,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("numbers", nargs="*", type=int, help="of 2, 3, 5, 6, 8, 9 and 10; default: all")
    parser.add_argument("--out", type=Path, default=Path("out") / "figures", help="default: out/figures")
    given = parser.parse_args(arguments)
    numbers = sorted(set(given.numbers)) or list(FIGURES)
    try:
        require_known(numbers)
        require_own_page(given.out)
        made = [paper_figure(number, partial(print, f"figure {number}:")) for number in numbers]
        write_figures(made, given.out)
    except AerobatError as error:
        print(f"aerobat: {error}", file=sys.stderr)
        sys.exit(2)
    for each in made:
        print(f"{each.caption.heading}: {each.caption.here}\n")
    print(f"written to {given.out}/")


if __name__ == "__main__":
    main()
