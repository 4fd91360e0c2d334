"""The search for the smallest feasible scale of time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.planning import BisectionSearch, GridSearch


def above(threshold: float, tried: list[float]):
    """An attempt that is feasible from `threshold` on."""

    def attempt(scale: float) -> float | None:
        tried.append(scale)
        return scale if scale >= threshold else None

    return attempt


@given(st.floats(0.021, 0.99), st.floats(1.05, 2.0), st.sampled_from([0.1, 0.01, 0.001]))
def test_bisection_ends_within_its_tolerance_above_the_threshold(
    threshold: float, growth: float, tolerance: float
) -> None:
    found = BisectionSearch(0.02, 1.0, growth, tolerance).smallest(above(threshold, []))
    assert found is not None
    assert threshold <= found <= threshold * (1 + tolerance) * (1 + 1e-9)


@given(st.floats(0.0, 4.5))
def test_the_papers_grid_takes_the_first_feasible_of_its_50_steps(threshold: float) -> None:
    tried: list[float] = []
    found = GridSearch().smallest(above(threshold, tried))
    steps = np.linspace(0.1, 4.0, 50)
    feasible = steps[steps >= threshold]
    assert found == (feasible[0] if len(feasible) else None)
    np.testing.assert_allclose(tried, steps[: len(tried)])


def test_a_search_that_finds_nothing_has_tried_up_to_its_end() -> None:
    tried: list[float] = []
    assert BisectionSearch(0.1, 0.5).smallest(above(9.0, tried)) is None
    assert tried[-1] == 0.5


def test_climbing_finds_the_fast_island_when_slow_is_infeasible_again() -> None:
    found = BisectionSearch(0.02, 2.0, tolerance=0.001).smallest(lambda s: s if 0.1 <= s <= 0.15 else None)
    assert found == pytest.approx(0.1, rel=0.001)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: GridSearch(0.0), "GridSearch.first must be positive"),
        (lambda: GridSearch(2.0, 1.0), r"GridSearch.last must be first \(2 s\) or more, got 1"),
        (lambda: GridSearch(count=0), "GridSearch.count must be 1 or more"),
        (lambda: GridSearch(np.nan), "GridSearch.first must be a finite number"),
        (lambda: BisectionSearch(-1.0), "BisectionSearch.first must be positive"),
        (lambda: BisectionSearch(growth=1.0), "BisectionSearch.growth must be greater than 1"),
        (lambda: BisectionSearch(tolerance=0.0), "BisectionSearch.tolerance must be positive"),
        (lambda: BisectionSearch(last=np.inf), "BisectionSearch.last must be a finite number"),
        (lambda: BisectionSearch(2.0), r"BisectionSearch.last must be first \(2 s\) or more, got 1"),
    ],
)
def test_a_search_that_cannot_be_is_refused(wrong, sentence) -> None:
    with pytest.raises(SpecError, match=f"^{sentence}"):
        wrong()
