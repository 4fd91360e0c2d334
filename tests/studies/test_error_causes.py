"""Causes of error: none costs nothing, each leaves the draws of the others, all together cost the most."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import binom

import aerobat as ab
from aerobat.simulation.conditions.draw import Draws
from aerobat.studies.error_causes import Cost, ErrorCauses, Trial
from aerobat.studies.error_causes.cause import together

NOTHING = ab.Cause("nothing", {})
ROTORS = ab.Cause("rotors", {"vehicle_known": False})
JERK = ab.Cause("jerk", {"planner.order": 3})
HAND_OFF = ab.Cause("hand-off", {"conditions.motion_capture.hand_off.translation": 0.05})
GAINS = ab.Cause("gains", {"controller.attitude_frequency": 15.0, "controller.position_gain": 10.0})
CAUSES = (ROTORS, HAND_OFF, JERK, GAINS)
PLANNER = ab.Miqp(order=4, reserve=0.1, search=ab.BisectionSearch())
TUNED = ab.Controller(disturbance_filter=0.0)  # an observer would answer for slow gains
LAB = ab.load_dispersion("lab")
SEEING = replace(LAB, imu=None, motion_capture=None)  # the controller sees the truth: less to compile
TRIAL = Trial(PLANNER, LAB, TUNED)
FLIGHTS = 40


def half_flip() -> ab.Problem:
    limits = ab.Limits(velocity=10.0, acceleration=90.0, jerk=120.0)
    return replace(ab.load_problem("half-flip"), limits=limits)


@cache
def measured(*causes: ab.Cause, seed: int = 7, conditions: ab.Dispersion = SEEING) -> ErrorCauses:
    options = {"conditions": conditions, "flights": FLIGHTS, "seed": seed}
    return ab.error_causes(half_flip(), "hexarotor", causes, planner=PLANNER, controller=TUNED, **options)


def test_a_cause_that_changes_nothing_costs_exactly_nothing() -> None:
    study = measured(NOTHING)
    assert study.of("nothing").scores == study.none.scores
    assert study.cost("nothing") == Cost(0.0, 0.0, 0.0)
    assert study.cost("all together") == Cost(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("causes", "conditions"), [((GAINS,), SEEING), pytest.param(CAUSES, LAB, marks=pytest.mark.slow)]
)
def test_all_together_are_worse_than_none_and_each_alone_costs_something(
    causes: tuple[ab.Cause, ...], conditions: ab.Dispersion
) -> None:
    study = measured(*causes, conditions=conditions)
    assert [result.cause for result in study.results] == ["none", *(c.name for c in causes), "all together"]
    assert study.cost("all together").low > 0.0
    costly = [cause.name for cause in causes if study.cost(cause.name).low > 0.0]
    assert len(costly) >= len(causes) - 2  # of rotors, and of one more, that flights may not show
    assert np.median(study.together.position_error) > np.median(study.none.position_error)


def test_shares_are_those_of_the_flights_that_pass_and_grow_with_the_opening() -> None:
    study = measured(GAINS)
    gate = half_flip().gates[0]
    for result in study.results:
        assert result.cleared == result.cleared_opening(gate.width, gate.height)
        shares = [
            result.cleared_opening(scale, 0.6 * scale).fraction for scale in (0.01, 0.5, 0.7, 1.0, 100.0)
        ]
        assert shares == sorted(shares)
        assert shares[0] == 0.0
        assert shares[-1] == np.isfinite(result.gate_error).mean()


@pytest.mark.slow
def test_the_same_seed_gives_the_same_table_and_another_seed_another() -> None:
    first, again = (measured.__wrapped__(NOTHING, conditions=LAB) for _ in range(2))
    for result, other in zip(again.results, first.results, strict=True):
        assert (result.trial, result.plan.trajectory) == (other.trial, other.plan.trajectory)
        assert result.scores == other.scores
    assert measured(NOTHING, seed=8, conditions=LAB).none.scores != again.none.scores


def test_a_cause_leaves_the_draws_of_the_others() -> None:
    dispersed = HAND_OFF.applied(TRIAL).conditions
    plain, changed = (Draws(each, 6, 7, range(5)).columns for each in (TRIAL.conditions, dispersed))
    assert np.allclose(changed["hand_off_translation"], 10.0 * plain["hand_off_translation"])
    others = set(plain) - {"hand_off_translation"}
    assert all(np.array_equal(changed[name], plain[name]) for name in others)


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_causes_are_independent_in_whatever_order_they_are_switched_on(order: tuple[int, ...]) -> None:
    causes = [CAUSES[k] for k in order]
    trial = TRIAL
    for cause in causes:
        trial = cause.applied(trial)
    assert trial == together(CAUSES[:3], "all").applied(TRIAL)


@given(arrays(float, st.integers(6, 60), elements=st.floats(-1e3, 1e3)), st.floats(-1e2, 1e2))
def test_a_cost_is_that_of_the_pairs_and_its_interval_holds_it(errors: np.ndarray, more: float) -> None:
    cost = Cost.of(errors, errors + more, 0.95)
    assert cost.low <= cost.median <= cost.high
    assert np.allclose([cost.low, cost.high], more, atol=1e-9)


@pytest.mark.parametrize("count", [6, 25, 100])
def test_an_interval_of_a_cost_holds_the_median_as_often_as_it_says(count: int) -> None:
    # of the differences 0, 1, ... it leaves out as many at either end as the sign test allows
    cost = Cost.of(np.zeros(count), np.arange(count, dtype=float), 0.95)
    below = int(cost.low)
    assert cost.high == count - 1 - below
    assert 2.0 * binom.cdf(below, count, 0.5) <= 0.05 < 2.0 * binom.cdf(below + 1, count, 0.5)


def test_flights_that_never_cross_in_either_trial_cost_nothing_and_few_flights_vouch_for_nothing() -> None:
    never = np.full(10, np.inf)
    assert Cost.of(never, never, 0.95) == Cost(0.0, 0.0, 0.0)
    assert Cost.of(np.zeros(10), never, 0.95).median == np.inf
    assert Cost.of(np.zeros(5), np.ones(5), 0.95) == Cost(1.0, -np.inf, np.inf)


@pytest.mark.parametrize(
    ("causes", "complaint"),
    [
        (
            [ab.Cause("a", {"planner.order": 3}), ab.Cause("b", {"planner.order": 5})],
            "both change planner.order",
        ),
        ([ab.Cause("a", {"controller": ab.Controller()}), GAINS], "'a' and 'gains' both change controller"),
        ([ab.Cause("a", {}), ab.Cause("a", {})], "two named 'a'"),
        ([ab.Cause("none", {})], "two named 'none'"),
        ([ab.Cause("a", {"planner.ordre": 3})], "did you mean 'order'"),
        ([ab.Cause("a", {"conditions.battery.sag.x": 3})], "conditions.battery.sag is 0.3, it has no fields"),
        ([ab.Cause("a", {"planner.order": 9})], "planner.order must be"),
        ([ab.Cause("a", {"controller.position_gain": -1.0})], "controller.position_gain must be"),
    ],
)
def test_causes_that_do_not_fit_are_refused_in_a_sentence(causes: list[ab.Cause], complaint: str) -> None:
    with pytest.raises(ab.SpecError, match=complaint):
        ab.error_causes(half_flip(), "hexarotor", causes, planner=PLANNER, flights=1)


def test_a_problem_without_a_gate_is_refused() -> None:
    with pytest.raises(ab.SpecError, match="no gate to judge flights by"):
        ab.error_causes("line", "agile-quad", [NOTHING])


def test_an_unknown_cause_is_named_beside_the_known_ones() -> None:
    with pytest.raises(ab.SpecError, match="did you mean 'nothing'"):
        measured(NOTHING).cost("nothin")
