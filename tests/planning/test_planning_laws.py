"""Laws of every planner: its certificate is that of what it returns, in the world that it was planned for."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

import aerobat as ab
from aerobat.certification import Side, Verdict
from aerobat.environment import Environment
from aerobat.planning import (
    FreeKnots,
    MinSnap,
    Miqp,
    Plan,
    Planner,
    TimeOptimal,
    plan,
    planner,
    planner_options,
    registered_planners,
)
from aerobat.planning.certified_solve import Solution, certified_solve
from aerobat.planning.recorder import Recorder
from aerobat.planning.task import Task
from aerobat.problem import EndState, Limits, Problem, Waypoint, Waypoints, at_rest, load_problem
from aerobat.vehicle import load_vehicle

QUAD = load_vehicle("agile-quad")
PLANNERS: dict[str, Planner] = {
    "miqp": Miqp(intervals=12),
    "min-snap": MinSnap(),
    "free-knots": FreeKnots(segments=2),
    "time-optimal": TimeOptimal(segments=8, starts=1),
}
STEP = Problem(
    "step",
    at_rest((0.0, 0.0, 1.0)),
    at_rest((3.0, 0.0, 1.5)),
    Waypoints((Waypoint(position=np.array([1.5, 0.0, 1.0])),)),
)
WORLDS = {
    "elsewhere": replace(STEP, heading=np.pi / 2, environment=Environment(gravity=5.0, ground=0.9)),
    "limits": replace(STEP, limits=Limits(velocity=3.0, acceleration=12.0)),
}


WINDY = replace(STEP, environment=Environment(wind=(2.0, -1.0, 0.5)))
seen: dict[tuple[str, str], list[object]] = {}  # of the progress of every plan


@cache
def planned(name: str, world: str) -> Plan:
    told = seen.setdefault((name, world), [])
    return plan(WORLDS[world], PLANNERS[name], QUAD, told.append)


def test_every_registered_planner_is_held_to_these_laws() -> None:
    assert {name: type(p) for name, p in PLANNERS.items()}.items() <= registered_planners().items()
    assert set(registered_planners()) == set(PLANNERS)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("name", PLANNERS)
def test_a_plans_certificate_is_its_trajectorys_in_the_problems_environment(name: str, world: str) -> None:
    found, problem = planned(name, world), WORLDS[world]
    envelope = ab.Envelope(limits=problem.path_limits, **problem.ends)
    assert found.certificate == ab.certify(found.trajectory, QUAD, problem.environment, envelope)
    assert found.certified
    assert found.vehicle == QUAD
    assert found.planner == name
    assert found.attempts[-1].margin == pytest.approx(found.certificate.margin) or len(found.attempts) > 1


ELSEWHERE = {
    "position": {"position": (0.0, 0.01, 1.0)},
    "velocity": {"velocity": (0.0, 0.0, 0.1)},
    "acceleration": {"acceleration": (0.0, 0.0, 0.1)},
}


@pytest.mark.parametrize("quantity", ELSEWHERE)
@pytest.mark.parametrize("end", ["start", "goal"])
def test_a_plan_that_misses_what_an_end_asks_is_not_certified(end: str, quantity: str) -> None:
    found = planned("min-snap", "limits")
    asked = replace(getattr(STEP, end), **ELSEWHERE[quantity])
    missed = replace(found, problem=replace(found.problem, **{end: asked}))
    (violated,) = (f for f in missed.certificate.findings if f.verdict is Verdict.VIOLATED)
    assert (violated.end, violated.quantity) == (end, f"{quantity} error")
    assert missed.certificate.why.startswith(f"{end} {quantity} error ")
    assert not missed.certified


def test_a_goal_of_any_velocity_and_attitude_asks_for_its_place_alone() -> None:
    found = planned("min-snap", "limits")
    passing = EndState(STEP.goal.position, acceleration=(0.0, 0.0, 0.1), free_velocity=True)
    assert replace(found, problem=replace(found.problem, goal=passing)).certified


def test_a_solution_that_ignores_its_ends_is_no_plan_whichever_program_it_is_of() -> None:
    class Moved:
        """A path that ends a centimetre from the goal, flyable all along."""

        def solve(self) -> Solution[None]:
            ends = np.array([STEP.start.derivatives(5), STEP.goal.derivatives(5)])
            ends[1, 0, 1] += 0.01
            return Solution(None, 3.0, ab.minimum_effort(ends, [3.0]), "optimal", 1, 0.0)

        def tighten(self, solution: Solution[None], certificate: ab.Certificate | None) -> bool:
            return False

    judged = certified_solve(Moved(), Task.of(STEP, QUAD), recorder := Recorder(None))
    assert not judged.feasible
    assert recorder.attempts[-1].outcome.startswith("goal position error 0.01 m of 0 m at 3.000 s")


@pytest.mark.parametrize("name", PLANNERS)
def test_a_plan_for_another_gravity_is_certified_for_that_one_only(name: str) -> None:
    found = planned(name, "elsewhere")
    elsewhere = ab.certify(found.trajectory, QUAD)
    assert elsewhere != found.certificate
    assert elsewhere.margin != pytest.approx(found.certificate.margin, abs=0.1)


def test_a_flip_on_mars_is_certified_on_mars() -> None:
    mars = replace(load_problem("flip-roll"), environment=Environment(gravity=3.7))
    found = plan(mars, vehicle=QUAD)
    envelope = Task.of(mars, QUAD).envelope(found.stages)
    assert found.certificate == ab.certify(found.trajectory, QUAD, mars.environment, envelope)
    assert found.certified
    on_earth = ab.certify(found.trajectory, QUAD, envelope=ab.Envelope(limits=mars.path_limits))
    assert on_earth.margin != pytest.approx(found.certificate.margin, abs=0.1)


@pytest.mark.parametrize("name", PLANNERS)
def test_a_trajectory_knows_the_heading_it_was_planned_for(name: str) -> None:
    found = planned(name, "elsewhere")
    assert found.trajectory.heading == pytest.approx(np.pi / 2)
    ahead = ab.reference(found.trajectory, QUAD, times=[0.0]).setpoint.q_world_body[0]
    np.testing.assert_allclose(ahead, [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], atol=1e-6)


def test_a_plan_is_as_fast_in_coordinates_of_a_map_as_near_their_origin() -> None:
    """In those of UTM, high derivatives were lost in rounding: 9 % slower, after a rescue."""
    here = load_problem("line")
    there = np.array([465_000.0, 5_250_000.0, 400.0])
    ends = {name: replace(end, position=end.position + there) for name, end in here.ends.items()}
    near, far = (ab.plan(each, Miqp(reserve=0.15), "agile-quad") for each in (here, replace(here, **ends)))
    assert far.duration == pytest.approx(near.duration, abs=1e-6)
    assert not far.rescue


@pytest.mark.parametrize(
    "name",
    [
        "min-snap",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("miqp", "free-knots", "time-optimal")),
    ],
)
def test_a_plan_in_wind_asks_other_thrusts_than_in_calm_air(name: str) -> None:
    draggy = replace(QUAD, drag_body=np.array([0.1, 0.1, 0.05]))
    found = plan(WINDY, PLANNERS[name], draggy)
    assert found.certified
    envelope = ab.Envelope(limits=WINDY.path_limits, **WINDY.ends)
    assert found.certificate == ab.certify(found.trajectory, draggy, WINDY.environment, envelope)
    calm = ab.certify(found.trajectory, draggy)
    assert calm.margin != pytest.approx(found.certificate.margin, abs=1e-4)


@pytest.mark.parametrize("name", PLANNERS)
def test_no_certified_path_goes_below_the_ground(name: str) -> None:
    found = planned(name, "elsewhere")
    least = found.trajectory.component_range(0)[0][2]
    assert least >= WORLDS["elsewhere"].environment.ground - 1e-9
    (bound,) = (f for f in found.certificate.findings if f.quantity == "position z" and f.side is Side.MIN)
    assert bound.limit == WORLDS["elsewhere"].environment.ground
    assert bound.verdict is Verdict.HOLDS


@pytest.mark.slow
def test_the_certificate_returned_is_that_of_the_last_round_of_tightening() -> None:
    """Both ends run towards the floor: each round of bounds leaves a smaller excess between nodes."""
    start = EndState((0.0, 0.0, 1.0), (0.0, 0.0, -4.0))
    goal = EndState((8.0, 0.0, 1.0), (0.0, 0.0, 4.0))
    middle = ab.Stage("mid", (ab.Condition(ab.Quantity.POSITION, (1.0, 0.0, 0.0), 4.0, 4.0),), at=0.5)
    limits = Limits(lower=(-20.0, -20.0, 0.0), upper=(20.0, 20.0, 20.0))
    floor = Problem("floor", start, goal, ab.CustomManeuver((middle,)), limits=limits)
    found = plan(floor, vehicle=QUAD)
    envelope = ab.Envelope(limits=limits, **floor.ends)
    assert found.certificate == ab.certify(found.trajectory, QUAD, floor.environment, envelope)
    assert found.certified


def test_a_plan_comes_with_the_certificate_that_decided_it_whatever_was_kept_clear() -> None:
    plan = ab.plan("line", Miqp(reserve=0.1, clearance=0.1))
    assert plan.evidence is not None
    assert "certificate" in vars(plan.evidence)  # worked out already


def test_what_cannot_be_certified_is_no_plan() -> None:
    """A ground that is left at 4 m/s downwards, one centimetre above it."""
    falling = EndState((0.0, 0.0, 0.01), (0.0, 0.0, -4.0))
    problem = Problem("crash", falling, at_rest((3.0, 0.0, 1.0)), environment=Environment(ground=0.0))
    with pytest.raises(ab.Infeasible) as refused:
        plan(problem, Miqp(search=ab.BisectionSearch(0.02, 0.3, growth=1.6), rescue=False), QUAD)
    assert not any(attempt.feasible for attempt in refused.value.attempts)


@pytest.mark.slow
def test_whatever_input_places_the_stages_the_refined_path_jumps_in_nothing() -> None:
    found = plan(load_problem("flip-roll"), Miqp(order=3), QUAD)
    assert found.certified
    assert found.order == 3
    assert max(found.trajectory.jumps(k).max() for k in range(4)) < 1e-6


@pytest.mark.slow
def test_jerk_inputs_as_they_are_keep_the_rotors_limits_and_their_certificate_says_what_jumps() -> None:
    found = plan(load_problem("flip-roll"), Miqp(order=3, search=ab.BisectionSearch()), QUAD)
    assert not found.certified
    assert found.certificate.margin > 0.0
    assert "body rate jumps" in str(found)


@pytest.mark.parametrize("name", PLANNERS)
def test_progress_sees_every_attempt_as_it_is_kept(name: str) -> None:
    found = planned(name, "elsewhere")
    assert found.attempts
    assert found.attempts == tuple(seen[name, "elsewhere"])


def test_the_same_request_is_planned_to_an_equal_plan_whatever_the_clock_says() -> None:
    found, again = (plan(STEP, MinSnap(), QUAD) for _ in range(2))
    assert found == again
    assert hash(found) == hash(again)
    slower = tuple(replace(attempt, solve_time=attempt.solve_time + 1.0) for attempt in found.attempts)
    assert replace(found, attempts=slower) == found


def test_a_planner_is_known_by_its_name() -> None:
    assert plan(STEP, "min-snap", QUAD).trajectory.durations == pytest.approx(
        plan(STEP, MinSnap(), QUAD).trajectory.durations
    )
    with pytest.raises(ab.SpecError, match=r"no planner named 'min_snap'; did you mean 'min-snap'"):
        plan(STEP, "min_snap", QUAD)


def test_a_users_planner_is_one_registered_class_and_gets_its_certificate() -> None:
    @planner("straight")
    @dataclass(frozen=True)
    class Straight:
        """A straight line at the closed form's pace."""

        pace: float = ab.option(3.0, "Its duration, s.")

        def plan(self, problem, vehicle=None, progress=None) -> Plan:
            ends = np.array([problem.start.derivatives(5), problem.goal.derivatives(5)])
            return Plan(problem, ab.minimum_effort(ends, [self.pace]), "straight")

    assert registered_planners()["straight"] is Straight
    found = plan(STEP, "straight", QUAD)
    envelope = ab.Envelope(**STEP.ends)
    assert found.certificate == ab.certify(found.trajectory, QUAD, STEP.environment, envelope)
    assert found.certified
    assert str(found)
    (pace,) = planner_options(Straight)
    assert (pace.name, pace.flag, pace.type, pace.default, pace.help) == (
        "pace", "--pace", float, 3.0, "Its duration, s."
    )  # fmt: skip
    with pytest.raises(ab.SpecError, match="there are two planners named 'miqp'"):
        planner("miqp")(Straight)


def test_the_command_lines_options_follow_from_the_fields() -> None:
    flags = {name: [o.flag for o in planner_options(cls)] for name, cls in registered_planners().items()}
    assert flags == {
        "miqp": [
            "--order",
            "--intervals",
            "--backend",
            "--time-limit",
            "--reserve",
            "--clearance",
            "--no-rescue",
        ],
        "min-snap": ["--order", "--stop-after", "--time-limit"],
        "free-knots": ["--segments", "--reserve", "--clearance", "--time-limit"],
        "time-optimal": ["--segments", "--reserve", "--clearance", "--starts", "--time-limit"],
    }


@pytest.mark.parametrize(
    "name",
    [
        "miqp",
        "min-snap",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("free-knots", "time-optimal")),
    ],
)
def test_a_gate_that_a_stage_names_is_crossed_in_its_direction(name: str) -> None:
    """Also where the way on leads back, and standing still in it would be shortest."""
    gate = ab.tilted_gate((2.0, 0.0, 1.0), width=3.0, height=3.0, name="far")
    maneuver = ab.CustomManeuver((ab.Stage("turn", gate="far"),))
    problem = Problem("there and back", at_rest((0, 0, 1)), at_rest((0, 0, 1.5)), maneuver, (gate,))
    others = {"free-knots": FreeKnots()}
    found = plan(problem, others.get(name, PLANNERS[name]), QUAD)
    assert found.certified
    (stage,) = found.stages
    assert found.trajectory.evaluate(stage.time, 1) @ gate.normal >= 1.0 - 1e-6
    if name == "miqp":  # which plans anew where its own flight turns back in the gate
        assert found.flies
