"""Scenes: what there is to see of plans and flights, and what is said where there is nothing."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.viewer.scene import MAX_FLIGHTS, MAX_POSES, MAX_ROWS, plan_fits, scene_of, shown_rows
from reporting_cases import simulated
from shared_plans import shared_plan
from viewer_cases import dispersed, flip


@lru_cache
def minute() -> ab.Flight:
    """A minute at a thousand rows a second."""
    fixed = np.full((13, 5, 3), np.nan)
    fixed[:, 0] = [(3.0 * np.cos(k), 3.0 * np.sin(k), 1.0 + 0.4 * np.sin(2.3 * k)) for k in range(13)]
    fixed[0, 1:] = fixed[-1, 1:] = 0.0
    return ab.fly(ab.minimum_effort(fixed, [5.0] * 12), "agile-quad", rate=1000.0)


def first(flight: ab.Flight, count: int) -> ab.Flight:
    """The first vehicles of a batch, be it none."""
    series = {
        s.name: flight.series[s.name][:count] if s.per_vehicle else flight.series[s.name]
        for s in flight.kinds
    }
    names, outcomes, sentences = flight.vehicles[:count], flight.outcomes[:count], flight.sentences[:count]
    return replace(flight, series=series, vehicles=names, outcomes=outcomes, sentences=sentences)


@given(rows=st.integers(2, 200_000), flights=st.integers(1, MAX_FLIGHTS))
def test_rows_that_are_shown_are_evenly_spaced_few_enough_and_hold_both_ends(rows, flights):
    shown = shown_rows(rows, flights)
    assert shown[0] == 0
    assert shown[-1] == rows - 1
    assert len(shown) <= MAX_ROWS + 1
    assert len(shown) * flights <= MAX_POSES + flights
    assert len({*np.diff(shown)[:-1].tolist()}) <= 1


def test_a_short_flight_is_shown_whole_as_it_was_flown_and_judged() -> None:
    flight, plan = flip()
    scene = scene_of(flight, plan)
    track = scene.tracks[0]
    np.testing.assert_array_equal(scene.times, flight.times)
    np.testing.assert_array_equal(track.position, flight.position)
    np.testing.assert_array_equal(track.thrusts, flight.thrusts)
    np.testing.assert_array_equal(scene.curves[0].values[0], flight.position_error)
    assert track.sentence == ab.score(flight, plan).sentence == scene.facts[0]
    assert scene.is_well
    assert scene.gates == plan.problem.gates
    assert [ghost.name for ghost in scene.ghosts] == [stage.name for stage in plan.stages]


def test_a_minute_at_a_thousand_rows_a_second_is_thinned_says_so_and_hides_no_error() -> None:
    flight = minute()
    scene = scene_of(flight)
    assert len(flight.times) > 60_000
    assert len(scene.times) <= MAX_ROWS + 1
    assert any("62.5 rows a second of 1000" in fact for fact in scene.facts)
    assert scene.curves[0].values.max() == flight.position_error.max()
    assert scene.curves[1].values.max() == np.rad2deg(flight.attitude_error.max())


def test_a_batch_tells_which_flights_failed_as_each_would_be_judged_alone() -> None:
    flight, plan = dispersed(), shared_plan("flip-roll")
    scene = scene_of(flight, plan)
    judged = [ab.score(flight[k], plan) for k in range(50)]
    assert [track.sentence for track in scene.tracks] == [score.sentence for score in judged]
    failed = [not score.outcome.is_success for score in judged]
    assert [track.failed for track in scene.tracks] == failed
    assert 0 < sum(failed) < 50
    assert scene.facts[0].startswith(f"{sum(failed)} of 50 flights failed")
    assert not scene.is_well


def test_a_vehicle_that_diverged_stays_where_it_ended() -> None:
    agile = ab.load_vehicle("agile-quad")
    heavy = replace(agile, mass=3.0 * agile.mass)
    flight = ab.fly(shared_plan("flip-roll"), [agile, heavy], rate=200.0)
    track = scene_of(flight, shared_plan("flip-roll")).tracks[1]
    assert track.failed
    assert track.end < flight.times[-1]
    after = scene_of(flight).times >= track.end
    np.testing.assert_array_equal(track.position[after], np.tile(flight[1].position[-1], (after.sum(), 1)))


def test_of_too_many_flights_the_first_are_shown_and_this_is_said() -> None:
    plan = shared_plan("line")
    batch = ab.fly(plan, ["agile-quad"] * (MAX_FLIGHTS + 3), rate=100.0, log_rate=10.0)
    scene = scene_of(batch, plan)
    assert len(scene.tracks) == MAX_FLIGHTS
    assert f"the first {MAX_FLIGHTS} of {MAX_FLIGHTS + 3} flights" in scene.facts


def test_a_plan_without_a_flight_shows_what_is_asked_of_its_vehicle() -> None:
    plan = shared_plan("half-flip")
    scene = scene_of(plan)
    asked = ab.reference(plan, times=scene.times)
    np.testing.assert_array_equal(scene.tracks[0].thrusts, asked.rotor_thrusts)
    assert [curve.name for curve in scene.curves] == ["speed", "body rate"]
    assert len(scene.ghosts) > len(plan.stages), "few stages are joined by others"


@pytest.mark.parametrize(
    ("shown", "sentence"),
    [
        (lambda: first(dispersed(), 0), "the batch holds no flights"),
        (lambda: replace(shared_plan("line"), vehicle=None), "vehicle is missing"),
        (lambda: ab.fly(shared_plan("line"), "agile-quad", rate=200.0), "hexarotor has 6"),
    ],
    ids=["an empty batch", "no vehicle", "another vehicle"],
)
def test_where_there_is_nothing_to_show_one_sentence_says_so(shown, sentence) -> None:
    vehicle = "hexarotor" if "hexarotor" in sentence else None
    with pytest.raises(ab.SpecError, match=sentence):
        scene_of(shown(), vehicle=vehicle)


def test_a_batch_without_flights_has_no_figure_and_notebooks_show_its_line() -> None:
    empty = first(dispersed(), 0)
    with pytest.raises(ab.SpecError, match="the batch holds no flights"):
        ab.draw(empty)
    assert empty._repr_png_() is None
    assert "0 flights" in empty._repr_html_()


def test_a_plan_fits_its_own_flights_alone() -> None:
    assert plan_fits(shared_plan("half-flip"), simulated("half-flip"))
    assert not plan_fits(shared_plan("flip-roll"), simulated("half-flip"))
    assert not plan_fits(shared_plan("half-flip"), simulated("line"))
