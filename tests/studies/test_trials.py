"""Flights are added until their share is proven or refuted; a proof errs no more often than is said."""

from dataclasses import dataclass

import numpy as np
import pytest

import aerobat as ab
from aerobat.environment import load_dispersion
from aerobat.simulation import Outcome
from aerobat.studies import flights as trials
from aerobat.studies.flights import LOOKS, FlightTask, fly_trials
from aerobat.studies.share import Trials
from aerobat.studies.sweep import Share
from shared_plans import shared_plan

LAB = load_dispersion("lab")


@dataclass
class Drawn:
    """Flights of which each succeeds with one probability."""

    outcomes: list[Outcome]


@pytest.fixture
def task() -> FlightTask:
    plan = shared_plan("line")
    return FlightTask(plan, plan.vehicle, LAB, 0, plan.vehicle.controller)


def drawn(monkeypatch, task: FlightTask, probability: float, seed: int) -> Trials:
    """Trials of a plan whose flights succeed with a probability, without flying."""
    rng = np.random.default_rng(seed)

    def flights_drawn(pool, tasks, flights: range) -> list[Drawn]:
        well = rng.uniform(size=len(flights)) < probability
        return [Drawn([Outcome.COMPLETE if each else Outcome.OFF_PATH for each in well])]

    monkeypatch.setattr(trials, "fly_scores", flights_drawn)
    return fly_trials(task)


def test_trials_count_the_flights_of_a_sweep_and_end_once_they_decide(task) -> None:
    told = []
    found = fly_trials(task, lambda done, well: told.append((done, well)))
    swept = ab.sweep(task.plan, "lab", runs=found.share.of, workers=1)
    assert (found.share, found.seed) == (swept.success, 0)
    assert found.proven
    assert not found.refuted
    assert told[-1] == (found.share.of, found.share.count)
    assert [done for done, _ in told] == list(LOOKS[: len(told)])


@pytest.mark.parametrize(("probability", "most"), [(0.95, 0.06), (0.94, 0.01), (0.9, 0.001)])
def test_a_plan_that_too_few_flights_survive_is_rarely_called_proven(
    monkeypatch, task, probability: float, most: float
) -> None:
    """95 of 100 at a glance pass three plans of ten of which 93 % of all flights succeed."""
    wrong = [drawn(monkeypatch, task, probability, seed).proven for seed in range(300)]
    assert np.mean(wrong) <= most + 2.0 * np.sqrt(most / 300)


def test_a_plan_that_nearly_all_flights_survive_is_proven_with_few_flights(monkeypatch, task) -> None:
    found = [drawn(monkeypatch, task, 0.99, seed) for seed in range(100)]
    assert all(each.proven for each in found)
    assert np.mean([each.share.of for each in found]) < 250


def test_a_share_between_is_left_open_after_the_last_look(monkeypatch, task) -> None:
    opened = [drawn(monkeypatch, task, 0.955, seed) for seed in range(20)]
    assert any(not (each.proven or each.refuted) for each in opened)
    assert all(each.share.of == LOOKS[-1] for each in opened if not (each.proven or each.refuted))


@pytest.mark.parametrize(("count", "of"), [(95, 100), (96, 100), (99, 100), (771, 800)])
def test_as_many_as_needed_of_those_flown_are_no_proof_yet(count: int, of: int) -> None:
    found = Trials(LAB, 0, Share(count, of))
    assert not found.proven
    assert not found.refuted
