"""Words of a sweep that its table and its figure share."""

from __future__ import annotations

from math import isfinite

from aerobat.errors import SpecError
from aerobat.evaluation import Opening
from aerobat.simulation import Outcome
from aerobat.studies.sweep import Sweep


def success_sentence(sweep: Sweep) -> str:
    """Return a sentence with the share of flights that went well, its interval and the seed."""
    return f"{sweep.success} of the flights went well, at 95 % confidence; seed {sweep.seed}"


def known_opening(sweep: Sweep, passage: str) -> Opening | None:
    """The smallest opening that 99 % pass; None where the flights are too few to say, or too many miss."""
    try:
        found = sweep.smallest_opening(passage)
    except SpecError:
        return None
    return found if isfinite(found.scale) else None


def outcome_name(outcome: Outcome) -> str:
    """An outcome in two or three words."""
    return outcome.name.lower().replace("_", " ")
