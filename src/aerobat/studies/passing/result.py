"""The result of tightening a plan: its rounds, its proof and its cost in duration."""

from __future__ import annotations

from aerobat.declaration import by_value, in_notebooks
from aerobat.planning import Plan
from aerobat.planning.tube import Tube
from aerobat.studies.share import Share


@by_value
class Round:
    """One round: a plan with a reserve, and the share of training flights that pass."""

    reserve: float  # [-] of every limit's range
    plan: Plan
    share: Share

    def __str__(self) -> str:
        """Return one line with reserve, duration and share."""
        return f"reserve {self.reserve:.2f}: {self.plan.duration:.3f} s, {self.share} pass"


@in_notebooks
@by_value
class Passing:
    """A plan whose flights pass with the required probability, and the proof.

    `before` and `after` are of the same fresh flights, which the search has not used.
    """

    plan: Plan  # carries its tube
    plain: Plan  # as planned without tightening
    before: Share  # of the fresh flights with the plain plan
    after: Share  # of the fresh flights with the plan
    probability: float  # [-] required
    fresh: range  # numbers of the flights of the proof
    rounds: tuple[Round, ...]  # in the order in which they were tried, the plain plan first

    @property
    def tube(self) -> Tube:
        """The plan's tube."""
        assert self.plan.tube is not None, "a plan that passes carries its tube"
        return self.plan.tube

    @property
    def price(self) -> float:
        """The increase of duration over the plain plan [s]."""
        return self.plan.duration - self.plain.duration

    def __str__(self) -> str:
        """Return one line with shares and durations."""
        return (
            f"{self.plan.problem.name}: {self.after} of {self.after.of} fresh flights pass in "
            f"{self.plan.duration:.3f} s, {self.before} in {self.plain.duration:.3f} s without tightening"
        )
