"""The kinds of cells of a map, each with a letter: whether there is a plan, and which limits bind."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from string import ascii_lowercase

from aerobat.studies.feasibility import Cell, Feasibility, FeasibilityMap

NOT_NAMED = "no limit named"


@dataclass(frozen=True)
class Kind:
    """Cells of one feasibility that the same limits bind."""

    letter: str
    feasibility: Feasibility
    limits: tuple[str, ...]
    count: int
    first: Cell

    @property
    def name(self) -> str:
        """The name of the kind in a few words: its feasibility and the limits that bind."""
        return f"{self.feasibility}: {', '.join(self.limits) or NOT_NAMED}"


def kinds_of(found: FeasibilityMap) -> dict[tuple[Feasibility, tuple[str, ...]], Kind]:
    """The kinds of a map's cells: the planned ones first, of each the most frequent first."""
    counts = Counter((cell.feasibility, cell.limits) for cell in found.cells)
    order = list(Feasibility)
    keys = sorted(counts, key=lambda key: (order.index(key[0]), -counts[key], key[1]))
    first: dict[tuple[Feasibility, tuple[str, ...]], Cell] = {}
    for cell in found.cells:
        first.setdefault((cell.feasibility, cell.limits), cell)
    return {key: Kind(_letter(i), *key, counts[key], first[key]) for i, key in enumerate(keys)}


def letter_of(cell: Cell, kinds: dict[tuple[Feasibility, tuple[str, ...]], Kind]) -> str:
    """The letter of a cell's kind."""
    return kinds[cell.feasibility, cell.limits].letter


def _letter(number: int) -> str:
    """a, b, ... z, and then a2, b2."""
    turn, place = divmod(number, len(ascii_lowercase))
    return ascii_lowercase[place] + (str(turn + 1) if turn else "")
