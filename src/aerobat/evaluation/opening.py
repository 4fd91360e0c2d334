"""smallest_opening(): the opening of a gate that flights pass with a given probability."""

from __future__ import annotations

from math import ceil, isinf, log
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from aerobat.arrays import Array
from aerobat.declaration import by_value, unknown_name, validated
from aerobat.errors import SpecError
from aerobat.evaluation.score import Score
from aerobat.problem import Gate
from aerobat.simulation.outcome import length

Probability = Annotated[float, Field(gt=0.0, lt=1.0)]
Side = Literal["both", "width", "height"]


@by_value
class Opening:
    """An opening around a gate's centre, and the statistical confidence in it."""

    # of the upright box around it, infinite where too many flights miss the gate's plane
    width: float  # [m]
    height: float  # [m] likewise
    scale: float  # [-] scale of the gate's opening, or of the chosen side
    sample_scale: float  # [-] scale that the given fraction of these flights has passed: an estimate
    probability: float  # probability that a flight passes the opening
    confidence: float  # confidence in that probability, for any distribution of flights
    flights: int

    def __str__(self) -> str:
        """Return a one-line summary."""
        vouched = (
            f"passed with {100 * self.probability:.3g} % probability, says {100 * self.confidence:.3g} % "
            f"confidence from {self.flights} flights"
        )
        if isinf(self.scale):
            return f"no opening is {vouched}: too many do not get there as planned"
        size = f"{length(self.width)} by {length(self.height)}"
        return f"an opening of {size}, {self.scale:.3g} times the gate's, is {vouched}"


@validated
def smallest_opening(
    scores: Score,
    gate: Gate,
    probability: Probability = 0.99,
    confidence: Probability = 0.95,
    side: Side = "both",
) -> Opening:
    """Return the smallest opening around a gate's centre that a flight passes with a given probability.

    Each flight needs a scale of the gate's opening: the size that its body swept, divided by the gate's size.
    Flights that did not cross the plane as planned need an infinite scale. The r-th smallest of the scales of
    n flights is an upper bound of the p-quantile of all flights, whatever their distribution. The confidence
    of that bound is P(B(n, p) < r) with B binomial: an order statistic bounds a quantile (David and Nagaraja,
    Order Statistics, 2003, section 7.1). The smallest r that reaches the confidence is used.

    Args:
        scores: scores of independently drawn flights.
        gate: the gate; of several passages of this gate, each one counts.
        probability: probability with which a flight shall pass.
        confidence: confidence that the opening is large enough.
        side: `both` scales the gate's opening; `width` or `height` scales one side and keeps the other.

    Raises:
        SpecError: no passage is through this gate, or the flights are too few for this probability.
    """
    return opening_of(_needed_scales(scores, gate, side), gate, probability, confidence, side)


def opening_of(
    needed: Array, gate: Gate, probability: float, confidence: float, side: Side = "both"
) -> Opening:
    """Return the smallest opening for flights whose needed scales are known, as `smallest_opening` does.

    Args:
        needed: the scale of the gate that each flight needs, infinite where no scale is enough, (flights,).
        gate: the gate.
        probability: probability with which a flight shall pass.
        confidence: confidence that the opening is large enough.
        side: the scaled side.

    Raises SpecError where the flights are too few for such a probability.
    """
    scales = np.sort(needed)
    least = ceil(log(1.0 - confidence) / log(probability))
    if len(scales) < least:
        raise SpecError(
            f"to vouch for {100 * probability:g} % with {100 * confidence:g} % confidence takes the scores "
            f"of {least} flights or more, got {len(scales)}; score more"
        )
    scale = float(scales[_rank(len(scales), probability, confidence) - 1])
    width, height = gate.opening.size.tolist()
    return Opening(
        width=width * (1.0 if side == "height" else scale),
        height=height * (1.0 if side == "width" else scale),
        scale=scale,
        sample_scale=float(scales[ceil(probability * len(scales)) - 1]),
        probability=probability,
        confidence=confidence,
        flights=len(scales),
    )


def _rank(count: int, probability: float, confidence: float) -> int:
    """Return the rank, from 1, of the order statistic that bounds the quantile from above."""
    from scipy.stats import binom  # importing takes a quarter of a second

    return min(int(binom.ppf(confidence, count, probability)) + 1, count)


def _needed_scales(scores: Score, gate: Gate, side: Side) -> Array:
    """Return the scale of the opening that each flight needs, infinite where none is enough, (flights,)."""
    passages = [passage for passage in scores.passages if passage.gate == gate.name]
    if not passages:
        raise unknown_name("gate", gate.name, [passage.gate for passage in scores.passages])
    width, height = (
        np.max([np.nan_to_num(np.ravel(getattr(each, field)), nan=np.inf) for each in passages], axis=0)
        for field in ("needed_width", "needed_height")
    )
    own_width, own_height = gate.opening.size
    if side == "width":
        return np.where(height <= own_height, width / own_width, np.inf)
    if side == "height":
        return np.where(width <= own_width, height / own_height, np.inf)
    return np.asarray(np.maximum(width / own_width, height / own_height))
