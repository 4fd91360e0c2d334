"""Scores compared number by number, and starts that are scattered about the origin."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from aerobat import so3
from aerobat.evaluation import Score
from aerobat.states import BodyState
from aerobat.vehicle import load_vehicle

EXACT = ("floats", "compiled", "jax")  # in float64
QUAD = load_vehicle("agile-quad")


def numbers(score: Score) -> dict[str, float]:
    """All numbers of a score, by name."""
    found = {name: value for name, value in asdict(score).items() if isinstance(value, float)}
    for passage in score.passages:
        found |= {
            f"{passage.gate} {key}": value
            for key, value in asdict(passage).items()
            if not isinstance(value, str)
        }
    return found


def assert_same(a: Score, b: Score, tolerance: float) -> None:
    assert (a.outcome, a.sentence) == (b.outcome, b.sentence)
    edges = ([passage.closest_edge for passage in score.passages] for score in (a, b))
    assert next(edges) == next(edges)
    assert numbers(a) == pytest.approx(numbers(b), abs=tolerance, rel=tolerance, nan_ok=True)


def near(count: int, spread: float) -> BodyState:
    """Starts about the origin."""
    rng = np.random.default_rng(2)
    position, velocity, turn, omega = spread * rng.normal(size=(4, count, 3))
    return BodyState(position, velocity, so3.exp(turn), omega)
