"""Closed courses: they end in the state in which they begin, can be flown over and over, and name no ends."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.certification import Envelope, certify
from aerobat.declaration import from_table, to_table
from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.links.mission import Mission, MissionSettings
from aerobat.links.stream import SetpointStream
from aerobat.planning import least_duration
from aerobat.planning.heading.follow import _remedy as turn_remedy
from aerobat.planning.passages import gaps_at_ends
from aerobat.planning.polynomial.closed_forms import closed_forms
from aerobat.planning.recorder import Recorder
from aerobat.planning.refinement.closure import FRACTIONS, Closure
from aerobat.planning.refinement.refine import Refinement
from aerobat.planning.task import Task
from aerobat.reporting.facts import facts
from aerobat.trajectory import Trajectory
from random_flights import with_lags

QUAD = ab.load_vehicle("agile-quad")
GATE = ab.tilted_gate((5.0, 0.0, 2.0), np.pi / 2, width=1.2, height=1.2, name="red")
LAP = (
    ab.PassWaypoint((0.0, -3.0, 1.0), radius=0.3),
    ab.PassGate("red", crossing_point="free", margin=0.1),
    ab.PassWaypoint((0.0, 3.0, 1.5), radius=0.3),
    ab.PassWaypoint((-3.0, 0.0, 1.5), radius=0.3),
)
CLOSED = ab.Problem("closed", maneuver=ab.Course(LAP, closed=True), gates=(GATE,))
SHORT = replace(CLOSED, name="short", maneuver=ab.Course((LAP[1], LAP[3]), closed=True))

CART = {"kind": "sphere", "name": "cart", "position": [9, 9, 1], "radius": 0.2, "velocity": [0.1, 0, 0]}


@cache
def planned(lagging: bool = True, course: str = "short") -> ab.Plan:
    """A lap with rotor lag and a reserve, or at the limits of rotors without."""
    problem = {"short": SHORT, "closed": CLOSED}[course]
    if lagging:
        return ab.plan(problem, ab.FreeKnots(reserve=0.03), QUAD)
    return ab.plan(problem, ab.FreeKnots(), with_lags(QUAD, 0.0))


@cache
def flown() -> ab.Flight:
    """Its flight."""
    return ab.fly(planned())


@pytest.mark.parametrize(
    ("lagging", "course"),
    [
        (True, "short"),
        *(pytest.param(False, course, marks=pytest.mark.slow) for course in ("short", "closed")),
    ],
)
def test_a_closed_lap_ends_in_the_state_in_which_it_begins(lagging: bool, course: str) -> None:
    """Position to jerk, the whole attitude, body rates, and the thrusts of rotors."""
    plan = planned(lagging, course)
    assert plan.certified
    for derivative in range(4):
        ends = plan.trajectory.on_segments([0.0, 1.0], derivative)[[0, -1], [0, 1]]
        assert ends[0] == pytest.approx(ends[1], abs=1e-6)
    flat = reference(plan.trajectory, plan.vehicle, [0.0, plan.duration], environment=CLOSED.environment)
    assert so3.angle_between(*flat.setpoint.q_world_body) < 1e-6
    assert flat.setpoint.omega_body[0] == pytest.approx(flat.setpoint.omega_body[1], abs=1e-5)
    assert flat.rotor_thrusts[0] == pytest.approx(flat.rotor_thrusts[1], abs=1e-5)
    assert np.linalg.norm(flat.setpoint.flat.velocity[0]) > 3.0


@pytest.mark.slow
def test_the_turn_once_around_follows_from_its_slopes() -> None:
    """Central differences of the body's turn about its thrust axis, along random changes of a lap."""
    task = Task.of(SHORT, QUAD)
    limits = Refinement.of(task, Recorder(None)).limits
    closure = Closure(limits)
    path = planned().trajectory
    places = np.stack([path.on_segments(FRACTIONS, k) for k in range(6)], axis=2)
    rng, durations, step = np.random.default_rng(0), path.durations, 1e-5
    # a smooth closed change of the path, the same at both ends of the lap
    phase = 2.0 * np.pi * (path.knots[:-1, None] + durations[:, None] * FRACTIONS) / path.duration
    rate, amplitude = 2.0 * np.pi / path.duration, rng.normal(size=3)
    change = np.stack([rate**k * np.cos(phase + k * np.pi / 2)[..., None] * amplitude for k in range(6)], 2)
    ahead, behind = (closure.values(places + sign * step * change, durations)[0] for sign in (1.0, -1.0))
    slope = np.sum(closure.slopes(places, durations) * change)
    assert slope == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-3)


def test_the_turn_once_around_is_found_whatever_the_durations_of_segments() -> None:
    """Segments that begin by rounding after the last one ends were refused for huge derivatives."""
    quad = replace(QUAD, drag_body=(0.2, 0.3, 0.2))
    closure = Closure(Refinement.of(Task.of(SHORT, quad), Recorder(None)).limits)
    still = np.zeros((12, len(FRACTIONS), 6, 3))
    for seed in range(5):
        durations = np.random.default_rng(seed).uniform(0.2, 0.6, 12)
        assert closure.values(still, durations) == pytest.approx(0.0, abs=1e-12)


def test_a_lap_of_figures_alone_has_starts_at_their_places() -> None:
    """Figures give ranges of positions: without a gate or a waypoint beside them, planning failed."""
    loops = ab.Course(
        (ab.PowerLoop((0.0, 0.0, 2.0)), ab.PowerLoop((5.0, 0.0, 2.0), heading=np.pi)), closed=True
    )
    _, start = next(closed_forms(Task.of(replace(SHORT, maneuver=loops), QUAD)))
    times = [0.0, start.trajectory.duration]
    assert np.ptp(start.trajectory.evaluate(times, 1), axis=0) == pytest.approx(0.0, abs=1e-2)
    x = start.trajectory.evaluate(np.linspace(*times, 200))[:, 0]
    assert x.min() < 0.5
    assert x.max() > 4.5


def test_a_turn_that_opens_a_lap_is_not_mended_by_a_reserve() -> None:
    """More reserve was advised to vehicles of unequal drag, whose laps no turn closes."""
    assert "equal drag_body" in turn_remedy(SHORT, replace(QUAD, drag_body=(0.2, 0.3, 0.2)))
    assert "--reserve" in turn_remedy(SHORT, QUAD)
    assert "--reserve" in turn_remedy(ab.load_problem("line"), replace(QUAD, drag_body=(0.2, 0.3, 0.2)))


@pytest.mark.slow
def test_a_lap_flown_twice_over_is_certified_as_one_path() -> None:
    """The seam is a knot like any other, and the second time around the rotors bear the same."""
    lap = planned().trajectory
    twice = Trajectory(np.tile(lap.durations, 2), np.tile(lap.coefficients, (2, 1, 1)), lap.heading)
    found = certify(twice, QUAD)
    assert found.certified, found.why
    assert found.margin == pytest.approx(planned().certificate.margin, abs=1e-4)


@pytest.mark.slow
def test_a_closed_lap_is_shorter_than_from_rest_and_longer_than_physics_allows() -> None:
    rest = ab.at_rest((-3.0, 0.0, 1.5))
    from_rest = ab.Problem("rest", rest, rest, ab.Course(LAP), (GATE,))
    slower, lap = ab.FreeKnots().plan(from_rest, with_lags(QUAD, 0.0)), planned(False, "closed")
    assert lap.duration < 0.95 * slower.duration
    assert 0.5 * lap.duration < least_duration(CLOSED, QUAD) < lap.duration


def test_a_flight_begins_in_the_laps_state_and_is_judged_and_timed_all_the_way_round() -> None:
    plan = planned()
    score = ab.score(flown(), plan)
    assert flown().states.velocity[0] == pytest.approx(plan.trajectory.evaluate(0.0, 1))
    assert score.outcome.is_success, score.sentence
    assert score.max_position_error_m < 1e-3
    assert [(p.gate, p.failure) for p in score.passages] == [("red", None)]
    assert [w.waypoint for w in score.waypoints] == ["waypoint"]
    assert plan.lap_times == (pytest.approx(plan.duration),)
    (lap,) = score.laps
    assert lap.end == lap.duration == pytest.approx(plan.duration, abs=1e-3)
    assert plan.laps == (pytest.approx(plan.duration),)
    (lap_1,) = (fact.words for fact in facts(score) if fact.label == "lap 1")
    assert lap_1 == f"{lap.duration:.3f} s, until {lap.end:.3f} s"
    assert ab.score_flights(plan)[0].laps[0].duration == pytest.approx(lap.duration, abs=1e-6)


def test_a_closed_flight_ends_with_its_last_lap_wherever_in_its_ball_a_stage_stands() -> None:
    """A flight is at a waypoint where it comes nearest, a plan anywhere within reach."""
    *earlier, last = planned().stages
    for offset in (-0.03, 0.03):
        plan = replace(planned(), stages=(*earlier, replace(last, time=last.time + offset)))
        (lap,) = ab.score(flown(), plan).laps
        assert lap.end == pytest.approx(plan.duration, abs=1e-3)


def test_several_closed_laps_are_timed_each_from_the_end_of_the_one_before() -> None:
    twice = replace(SHORT, maneuver=replace(SHORT.maneuver, laps=2))
    lap = planned()
    stages = [replace(s, time=s.time + k * lap.duration) for k in (0, 1) for s in lap.stages]
    path = lap.trajectory
    both = Trajectory(np.tile(path.durations, 2), np.tile(path.coefficients, (2, 1, 1)), path.heading)
    plan = replace(lap, problem=twice, trajectory=both, stages=tuple(stages))
    assert plan.lap_times == pytest.approx([lap.duration] * 2)


def test_a_path_that_does_not_close_is_refuted() -> None:
    lap = planned().trajectory
    cut = Trajectory(lap.durations[:-1], lap.coefficients[:-1], lap.heading)
    assert certify(cut, QUAD).certified
    found = certify(cut, QUAD, envelope=Envelope(closed=True))
    assert not found.certified
    assert found.discontinuities[0].time == cut.duration


@pytest.mark.parametrize("planner", ["miqp", "min-snap"])
def test_planners_that_need_ends_refuse_a_closed_course_and_name_the_one_that_does_not(planner: str) -> None:
    with pytest.raises(SpecError, match=rf"closed: the {planner} planner .* take free-knots"):
        ab.plan(CLOSED, planner, QUAD)


def test_a_plan_that_begins_in_flight_is_not_begun_from_rest() -> None:
    plan = planned()
    stream = SetpointStream(plan.trajectory, plan.vehicle, plan.problem.environment, np.zeros(3))
    with pytest.raises(SpecError, match=r"begins at .* m/s, a mission at rest"):
        Mission(plan, MissionSettings(), stream, lambda time, _: stream.goal(time))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"goal": {"position": [0, 0, 0]}},
            "goal stands beside maneuver.closed, which has none; drop either",
        ),
        ({"start": {"position": [0, 0, 0]}}, "start stands beside maneuver.closed, which has none"),
        ({"maneuver": {"last_lap": 1}}, "maneuver.last_lap stands beside closed, whose laps are all whole"),
        ({"maneuver": {"closed": False}}, "start.position is missing; add it"),
        (
            {"maneuver": {"elements": [{"kind": "gate", "gate": "red"}]}},
            "maneuver.closed needs 2 elements that say where; add some",
        ),
        (
            {
                "maneuver": {
                    "elements": [
                        {"kind": "gate", "gate": "red"},
                        {"kind": "hold", "position": [0, 0, 1], "time": 1},
                    ]
                }
            },
            "maneuver.closed: a hold rests, a closed course never does; drop either",
        ),
        (
            {"maneuver": {"elements": [{"kind": "course", "closed": True, "elements": []}]}},
            "maneuver.elements[0].elements must have 1 or more entries",
        ),
        (
            {
                "maneuver": {
                    "elements": [
                        {"kind": "waypoint", "position": [0, 0, 1]},
                        {
                            "kind": "course",
                            "closed": True,
                            "elements": [{"kind": "waypoint", "position": [1, 0, 1]}],
                        },
                    ]
                }
            },
            "maneuver.elements[1].closed is for whole courses, this one is an element; drop it",
        ),
        (
            {"gates": [to_table(GATE) | {"velocity": [0.1, 0, 0]}]},
            "maneuver.closed: 'red' moves, so that no two laps are alike; drop either",
        ),
        (
            {"environment": {"obstacles": [CART]}},
            "maneuver.closed: 'cart' moves, so that no two laps are alike",
        ),
    ],
)
def test_a_contradiction_is_refused_in_one_sentence(change, sentence: str) -> None:
    table = to_table(CLOSED)
    table |= {key: table[key] | value if key == "maneuver" else value for key, value in change.items()}
    with pytest.raises(SpecError) as refused:
        from_table(ab.Problem, table)
    assert str(refused.value).startswith(sentence)


def test_a_closed_course_is_written_read_and_read_aloud() -> None:
    assert from_table(ab.Problem, to_table(CLOSED)) == CLOSED
    assert {"start", "goal"}.isdisjoint(to_table(CLOSED))
    assert (
        str(CLOSED) == "closed: a closed lap of by a waypoint, through the red gate, by a waypoint, 2 times"
    )
    assert ab.load_problem("lap-7").maneuver.elements == ab.load_problem("race-7").maneuver.elements


@pytest.mark.slow
def test_the_published_course_is_a_fast_lap() -> None:
    """The best known lap takes 6.138 s."""
    assert ab.plan(ab.load_problem("lap-7"), ab.FreeKnots(), with_lags(QUAD, 0.0)).duration < 1.01 * 6.138


@pytest.mark.parametrize(("clearance", "kept"), [(0.0, 0.0), (0.01, 0.01), (0.1, 0.03)])
def test_a_path_keeps_inside_balls_what_it_keeps_from_obstacles_or_a_tenth_of_their_radius(
    clearance: float, kept: float
) -> None:
    lap = ab.load_problem("lap-7")
    task = Task.of(lap, QUAD, clearance=clearance)
    asked = lap.stages(QUAD.max_specific_thrust).stages
    for inside, stage in zip(task.stages.stages, asked, strict=True):
        assert inside.ball is not None
        assert stage.ball is not None
        assert inside.ball.radius == pytest.approx(stage.ball.radius - kept)


STANDING = replace(SHORT, environment=ab.Environment(obstacles=(ab.Sphere((1.0, 0.0, 4.5), 0.4),)))


def test_a_closed_course_has_no_ends_that_obstacles_could_reach() -> None:
    assert gaps_at_ends(STANDING, QUAD) == ([], [])
    assert Task.of(STANDING, QUAD, clearance=0.1).clearance == 0.1


@pytest.mark.slow
def test_a_closed_course_around_an_obstacle_is_certified_clear_of_it() -> None:
    found = ab.plan(STANDING, ab.FreeKnots(reserve=0.03), QUAD)
    assert found.certified
    assert any("clearance" in finding.name for finding in found.certificate.findings)


def test_laps_whose_stages_come_in_any_order_end_with_the_latest_of_them() -> None:
    x = np.eye(3)[0]
    stages = tuple(
        ab.Stage(f"at {place:g} m", (ab.Condition("position", x, place, place),), lap=lap)
        for place, lap in ((1.0, 1), (2.0, 1), (4.0, 2), (3.0, 2))
    )
    ends = ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((5.0, 0.0, 0.0))
    plan = ab.plan(ab.Problem("straight", *ends, ab.CustomManeuver(stages, ordered=False)), ab.Miqp(), None)
    times = {stage.name: stage.time for stage in plan.stages}
    assert plan.laps == (times["at 2 m"], times["at 4 m"])


def test_a_closed_course_without_time_is_not_sent_to_a_planner_that_refuses_it() -> None:
    with pytest.raises(ab.Infeasible, match=r"allow more with --time-limit$") as refused:
        ab.plan(SHORT, ab.FreeKnots(time_limit=0.0), "agile-quad")
    assert "miqp" not in str(refused.value)
