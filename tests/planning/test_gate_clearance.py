"""Room for the body in gates: paths that hit a frame are mended, by all planners; slopes of room."""

from dataclasses import dataclass, replace
from math import radians

import pytest

from aerobat.certification import Finding, Side, Verdict
from aerobat.planning import FreeKnots, Miqp, Planner, TimeOptimal, plan
from aerobat.planning.gate_clearance import MAX_ATTEMPTS, bodies_in_gates, cleared
from aerobat.planning.result import FLYING_RESERVE
from aerobat.planning.task import Task
from aerobat.problem import Course, PassGate, Problem, at_rest, load_problem, tilted_gate
from aerobat.vehicle import load_vehicle
from places import CASES

QUAD = load_vehicle("agile-quad")
COURSE = load_problem(str(CASES / "frame-course.toml"))


@pytest.mark.parametrize(
    "planner",
    [
        *(
            pytest.param(each, marks=pytest.mark.slow)
            for each in (Miqp(), FreeKnots(), TimeOptimal(starts=2))
        ),
    ],
    ids=lambda planner: type(planner).__name__,
)
def test_gates_crossed_anywhere_in_their_openings_are_passed_clear_of_their_frames(planner: Planner) -> None:
    """The crossing point stayed where it was, at the edge of the opening, and left no room: 23 cm into it."""
    found = plan(COURSE, planner, QUAD)
    assert found.certified
    assert found.flies, found.flyability


@pytest.mark.slow
def test_a_path_with_room_in_a_gate_settles_though_steps_miss_what_stages_ask_by_rounding() -> None:
    assert plan(load_problem(str(CASES / "settled-course.toml")), Miqp(), QUAD).flies


@pytest.mark.slow
def test_a_path_that_cannot_leave_the_body_its_room_in_a_gate_is_given_up_at_once() -> None:
    """x500's flip in roll took 3.77 s, after 18 s of rounds that could not make room."""
    found = plan(load_problem("flip-roll"), Miqp(reserve=FLYING_RESERVE), load_vehicle("x500"))
    assert found.duration < 1.01 * 3.672
    assert len(found.attempts) < 80
    assert found.flies


@pytest.mark.slow
@pytest.mark.parametrize("tilt_deg", [20.0, 45.0])
def test_a_wide_body_that_turns_in_a_low_gate_passes_it_without_a_detour(tilt_deg: float) -> None:
    """Room in the attitude of the crossing alone let x500 pitch into the frame; a detour took 4.91 s."""
    half_flip = load_problem("half-flip")
    gates = tuple(gate.tilted(radians(tilt_deg)) for gate in half_flip.gates)
    found = plan(replace(half_flip, gates=gates), Miqp(reserve=FLYING_RESERVE), load_vehicle("x500"))
    assert found.duration < 3.5
    assert found.flies
    assert not found.rescue


@pytest.mark.parametrize("shape", [{"radius": 0.6}, {"polygon": ((0.8, -0.6), (0.0, 1.0), (-0.8, -0.6))}])
def test_openings_of_any_shape_may_have_room_for_the_body(shape: dict[str, object]) -> None:
    """Where such a gate is crossed anywhere more than three conditions say where."""
    gates = [tilted_gate((2.0 * k, 0.0, 1.0), name=f"{k}") for k in (1, 2)]
    shaped = tuple(replace(gate, width=None, height=None, **shape) for gate in gates)
    course = Course(tuple(PassGate(gate.name, crossing_point="free") for gate in gates))
    problem = Problem("shapes", at_rest((0.0, 0.0, 1.0)), at_rest((6.0, 0.0, 1.0)), course, shaped)
    assert [body.stage for body in bodies_in_gates(Task.of(problem, QUAD))] == [0, 1]


@dataclass(frozen=True)
class Attempted:
    """A path after so many attempts at a more direct one."""

    attempts: int

    @property
    def frames(self) -> tuple[Finding, ...]:
        """Clear after the last attempt that is made, and nearer to it with each."""
        gap = float(self.attempts - MAX_ATTEMPTS)
        verdict = Verdict.HOLDS if gap >= 0.0 else Verdict.VIOLATED
        return (Finding("clearance", "m", Side.MIN, gap, gap, 0.0, 0.0, verdict, gate="gate"),)


@pytest.mark.parametrize("last", [0, 1, MAX_ATTEMPTS])
def test_of_all_attempts_at_a_more_direct_path_the_clearest_is_kept(last: int) -> None:
    """The last attempt was made, and its path dropped."""

    def again(path: Attempted) -> Attempted | None:
        return Attempted(path.attempts + 1) if path.attempts < last else None

    assert cleared(Attempted(0), again) == Attempted(last)
