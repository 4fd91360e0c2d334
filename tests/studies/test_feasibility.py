"""A map's cells are what plans of their own are; the least that is needed is planned, and less is refused."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import provenance
from aerobat.errors import Reason
from aerobat.reporting.feasibility.facts import requirements
from aerobat.reporting.plain_data import plain
from aerobat.studies.feasibility import Feasibility
from aerobat.studies.feasibility.feasibility_map import Cell
from aerobat.studies.share import Share
from interrupted import Interrupted
from shared_plans import shared_plan
from suites import examples

ANGLES, SPEEDS = (0.0, 70.0), (5.0, 20.0)
NEAR_ITS_LIMIT = 10.0  # [m/s], which takes long to plan for


@cache
def half_flips(
    workers: int = 1, angles: tuple[float, ...] = ANGLES, speeds: tuple[float, ...] = SPEEDS
) -> ab.FeasibilityMap:
    return ab.feasibility_map("half-flip", {"angle": angles, "speed": speeds}, workers=workers)


def upright() -> Cell:
    """A cell that takes long to plan, by itself."""
    return half_flips(angles=(0.0,), speeds=(NEAR_ITS_LIMIT,)).cells[0]


def half_flip(angle: float, speed: float) -> ab.Problem:
    """The problem of a cell, made by hand."""
    problem = ab.load_problem("half-flip")
    gates = (problem.gates[0].tilted(radians(angle)),)
    return replace(problem, gates=gates, maneuver=ab.HalfFlip(passage=ab.GatePassage(speed=speed)))


@pytest.mark.slow
def test_of_plans_that_are_flown_a_cell_counts_what_passes_under_its_own_conditions() -> None:
    spreads, reserves, options = (0.0, 0.3), (0.0, 0.2), {"vehicle": "agile-quad", "workers": 1}
    weak = ab.Dispersion(name="weak", start_position=0.02)
    over = {"conditions.mass": spreads, "planner.reserve": reserves}
    planner = ab.Miqp(flies=False)
    found = ab.feasibility_map("line", over, planner=planner, conditions=weak, flights=20, seed=3, **options)
    for cell in found.cells:
        spread, reserve = cell.values
        plan = ab.plan("line", replace(planner, reserve=reserve), "agile-quad")
        scores = ab.score_flights(plan, conditions=replace(weak, mass=spread), seed=3, flights=20)
        assert cell.duration == plan.duration
        assert cell.passed is not None
        assert (cell.passed.count, cell.passed.of) == (scores.succeeded.sum(), 20)
    assert found.cells[0].passed.count > found.cells[-1].passed.count
    with pytest.raises(ab.SpecError, match="conditions is not given; give it first"):
        ab.feasibility_map("line", over, **options)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angle", "speed"),
    [
        (70.0, 5.0),
        *(
            pytest.param(*cell, marks=pytest.mark.slow)
            for cell in ((0.0, 5.0), (70.0, 20.0), (0.0, 20.0), (0.0, NEAR_ITS_LIMIT))
        ),
    ],
)
def test_a_cell_is_the_plan_of_its_problem(angle: float, speed: float) -> None:
    cells = (upright(),) if speed == NEAR_ITS_LIMIT else half_flips().cells
    (cell,) = (each for each in cells if each.values == (angle, speed))
    try:
        plan = ab.plan(half_flip(*cell.values), vehicle="agile-quad")
    except ab.Infeasible:
        assert cell.feasibility is Feasibility.REFUSED
        assert cell.duration is None
        return
    assert cell.is_planned == (plan.certified and plan.flies)
    assert cell.duration == plan.duration
    assert plan.certificate is not None
    assert cell.sentence == plan.certificate.why
    assert cell.reserve is not None
    kept = cell.reserve * ab.load_vehicle("agile-quad").max_thrusts[0]  # whose least thrust is 0
    assert kept == pytest.approx(plan.certificate.margin)


@pytest.mark.slow
def test_a_limit_that_binds_makes_the_plan_longer_and_one_that_does_not_changes_nothing() -> None:
    slow, fast = ab.feasibility_map("line", {"limits.velocity": [1.0, 50.0]}, workers=1).cells
    freed = ab.plan(replace(ab.load_problem("line"), limits=ab.Limits()), vehicle="agile-quad").duration
    assert "limits.velocity" in slow.limits
    assert slow.duration is not None
    assert freed < 0.9 * slow.duration
    assert "max_thrust" in fast.limits
    assert "limits.velocity" not in fast.limits
    assert freed == pytest.approx(fast.duration, rel=0.01)


@pytest.mark.slow
def test_a_limit_that_binds_in_a_gate_is_named_and_saves_no_time() -> None:
    """Plans are local optima: without the limit one may be longer, but by no more than those differ."""
    cell = upright()
    freed = replace(half_flip(0.0, NEAR_ITS_LIMIT), limits=ab.Limits())
    assert "limits.velocity" in cell.limits
    assert cell.duration is not None
    assert ab.plan(freed, vehicle="agile-quad").duration < 1.01 * cell.duration


@pytest.mark.process
def test_processes_change_no_cell() -> None:
    assert half_flips(workers=2) == half_flips()


def test_an_executor_that_is_handed_in_plans() -> None:
    over = {"goal.position.x": [1.0]}
    with ThreadPoolExecutor(1) as executor:
        found = ab.feasibility_map("line", over, executor=executor)
    assert found == ab.feasibility_map("line", over, workers=1)


def test_an_interrupted_map_goes_on_where_it_stopped(tmp_path: Path) -> None:
    over = {"goal.position.x": [1.0, 2.0], "vehicle.mass": [0.85, 3.0]}  # the last too heavy to hover
    kept = tmp_path / "kept"

    def interrupt(done: int, planned: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ab.feasibility_map("line", over, planner="min-snap", workers=1, keep=kept, progress=interrupt)
    whole = ab.feasibility_map("line", over, planner="min-snap", workers=1)
    assert ab.feasibility_map("line", over, planner="min-snap", keep=kept, executor=Interrupted(1)) == whole
    # all is kept by now: nothing is planned any more, and the kept cells count as progress
    told: list[tuple[int, int]] = []
    again = ab.feasibility_map(
        "line",
        over,
        planner="min-snap",
        keep=kept,
        executor=Interrupted(0),
        progress=lambda done, planned: told.append((done, planned)),
    )
    assert again == whole
    assert told == [(1, 1), (2, 1), (3, 2), (4, 2)]
    with pytest.raises(ab.SpecError, match=r"keeps cells of another map \(planner\); remove it"):
        ab.feasibility_map("line", over, planner="free-knots", workers=1, keep=kept)
    for file in kept.glob("*.npz"):
        file.write_bytes(b"PK")
    with pytest.raises(KeyboardInterrupt):  # what is damaged is planned again
        ab.feasibility_map("line", over, planner="min-snap", keep=kept, executor=Interrupted(0))


@pytest.mark.parametrize("library", ["numpy", "scipy"])
def test_a_map_does_not_go_on_under_another_version_of_a_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    kept, over = tmp_path / "kept", {"goal.position.x": [1.0]}
    ab.feasibility_map("line", over, planner="min-snap", workers=1, keep=kept)
    installed = provenance.version
    monkeypatch.setattr(provenance, "version", lambda name: "0.1" if name == library else installed(name))
    with pytest.raises(ab.SpecError, match=r"keeps cells of another map \(versions\); remove it"):
        ab.feasibility_map("line", over, planner="min-snap", workers=1, keep=kept)


@given(
    st.sampled_from(Feasibility),
    st.tuples(*[st.none() | st.floats(0, 10)] * 2),
    st.lists(st.text(), max_size=3),
    st.text(),
    st.none() | st.builds(Share, st.integers(0, 9), st.just(9)),
)
def test_a_cell_that_is_kept_is_the_same(
    feasibility: Feasibility,
    numbers: tuple[float | None, float | None],
    limits: list[str],
    sentence: str,
    passed: Share | None,
) -> None:
    cell = Cell((1.0, 2.0), feasibility, numbers[0], tuple(limits), numbers[1], sentence, passed)
    assert Cell.of(cell.values, cell.arrays) == cell


@pytest.mark.slow
def test_a_map_counts_its_cells_and_has_a_row_for_each() -> None:
    found = half_flips()
    assert sum(found.counts.values()) == len(found.cells) == 4
    assert found.counts[Feasibility.REFUSED] == 2
    assert str(found) == "half-flip on agile-quad over angle and speed: 2 planned, 2 refused at sight"
    table = found.table
    np.testing.assert_array_equal(table["angle"], np.repeat(ANGLES, len(SPEEDS)))
    np.testing.assert_array_equal(table["speed"], np.tile(SPEEDS, 2))
    np.testing.assert_array_equal(np.isnan(table["duration_s"]), table["feasibility"] != "planned")
    frame = ab.to_dataframe(found)
    assert list(frame.columns) == list(table)


class Refusing(ab.Planner):
    """Tries once and finds nothing."""

    def plan(self, problem: ab.Problem, vehicle: ab.Vehicle | None = None, progress: Any = None) -> ab.Plan:
        raise ab.Infeasible(Reason("rotor 3 is beyond its limit", ("max_thrust",)), ["one attempt"])


def test_what_the_planner_does_not_find_is_no_plan_and_names_its_limit() -> None:
    (cell,) = ab.feasibility_map("line", {"vehicle.mass": [0.9]}, planner=Refusing(), workers=1).cells
    assert (cell.feasibility, cell.limits) == (Feasibility.NO_PLAN, ("max_thrust",))
    assert cell.sentence == "rotor 3 is beyond its limit"


def test_without_time_there_is_no_answer() -> None:
    over = {"vehicle.mass": [0.9]}
    (cell,) = ab.feasibility_map("line", over, planner=Refusing(), time_limit=0.0, workers=1).cells
    assert cell.feasibility is Feasibility.NO_ANSWER


def test_what_contradicts_something_else_is_refused_in_its_cell_alone() -> None:
    over = {"limits.upper.z": [3.0, 4.0], "vehicle.thrust_to_weight": [0.9, 4.0]}
    cells = ab.feasibility_map("half-flip", over, workers=1).cells
    assert [cell.is_planned for cell in cells] == [False, False, False, True]
    assert "gates[0].position: its z component, 3.5 m, lies outside the limits" in cells[0].sentence
    assert "rotors cannot lift agile-quad" in cells[2].sentence
    assert cells[2].limits == ("max_thrust",)


@cache
def line() -> ab.Plan:
    """A plan that is certified and flies."""
    return shared_plan("line")


@dataclass(frozen=True)
class Threshold(ab.Planner):
    """Has the plan of a line where a number of the scenario is large enough."""

    number: Callable[[ab.Problem, ab.Vehicle], float]
    least: float

    def plan(self, problem: ab.Problem, vehicle: ab.Vehicle | None = None, progress: Any = None) -> ab.Plan:
        assert vehicle is not None
        if self.number(problem, vehicle) < self.least:
            raise ab.Infeasible("it is too little", ["one attempt"])
        return line()


def ceiling(problem: ab.Problem, vehicle: ab.Vehicle) -> float:
    return float(problem.limits.upper[2])


def width(problem: ab.Problem, vehicle: ab.Vehicle) -> float:
    return problem.gates[0].width / ab.load_problem("half-flip").gates[0].width


def strength(problem: ab.Problem, vehicle: ab.Vehicle) -> float:
    return vehicle.thrust_to_weight


@examples(4)
@given(
    case=st.sampled_from(
        [
            ("thrust-to-weight", strength, "line", 1.05, 15.0),
            ("ceiling", ceiling, "line", 1.0, 30.0),
            ("gate", width, "half-flip", 0.6, 6.0),
        ]
    ),
    part=st.floats(0.0, 1.0),
    tolerance=st.floats(0.02, 0.2),
)
def test_bisection_comes_to_the_threshold_from_either_side(
    case: tuple[str, Any, str, float, float], part: float, tolerance: float
) -> None:
    """A ceiling's height counts from the line, which is at zero."""
    quantity, number, problem, low, high = case
    least = low + part * (high - low)
    (found,) = ab.min_requirements(
        problem,
        of=[quantity],
        planner=Threshold(number, least),
        tolerance=tolerance,
        workers=1,
    )
    assert found.value is not None
    assert found.refused < least * (1 + 1e-9)
    assert least * (1 - 1e-9) <= found.value
    assert found.value - found.refused <= tolerance * max(found.value, 1.0) * (1 + 1e-9)
    assert found.plan == line()
    assert found.refusal == "it is too little"


def test_where_only_no_ceiling_suffices_that_is_the_answer() -> None:
    unbounded = Threshold(ceiling, np.inf)
    (found,) = ab.min_requirements("line", of=["ceiling"], planner=unbounded, workers=1)
    assert found.value == np.inf
    assert found.plan == line()
    assert str(found).startswith("ceiling: no limit, planned in")
    report = plain(requirements("line", "agile-quad", [found]))
    assert report["requirements"]["ceiling"]["least"] is None


def test_what_no_strength_suffices_for_is_infeasible_and_says_so() -> None:
    with pytest.raises(ab.Infeasible, match=r"thrust-to-weight: none will do, 25.06 neither"):
        ab.min_requirements("line", of=["thrust-to-weight"], planner=Refusing(), workers=1)


@pytest.mark.slow
@pytest.mark.process
def test_the_smallest_gate_and_the_lowest_ceiling_have_plans_and_less_is_refused() -> None:
    tried: list[tuple[str, float, bool]] = []
    found = ab.min_requirements(
        "half-flip",
        of=["gate", "ceiling"],
        tolerance=0.05,
        workers=2,
        progress=lambda *trial: tried.append(trial),
    )
    problem = ab.load_problem("half-flip")
    gate, lowest = found
    for each in found:
        assert each.plan is not None
        assert each.plan.certified
        assert each.plan.flies
        mine = [trial for trial in tried if trial[0] == each.quantity]
        assert len(mine) == each.trials
        assert (each.quantity, each.value, True) in mine
        assert (each.quantity, each.refused, False) in mine
    assert gate.plan is not None
    assert gate.value is not None
    assert gate.plan.problem.gates[0].width == gate.value * problem.gates[0].width
    smaller = replace(
        problem.gates[0],
        width=gate.refused * problem.gates[0].width,
        height=gate.refused * problem.gates[0].height,
    )
    problem = replace(problem, gates=(smaller,))
    if gate.feasibility is Feasibility.REFUSED:
        with pytest.raises(ab.SpecError, match="widen the opening"):
            ab.plan(problem, vehicle="agile-quad")
    else:
        assert not ab.plan(problem, vehicle="agile-quad").flies
    assert lowest.plan is not None
    assert lowest.value is not None
    assert lowest.plan.trajectory.component_range(0)[1][2] <= lowest.value + 1e-9
    assert lowest.refused < lowest.value <= 1.05 * lowest.refused


@pytest.mark.parametrize(
    ("problem", "of", "said"),
    [
        ("line", ["gate"], "'line' has no gate that could be smaller"),
        ("line", ["weight"], "no quantity named 'weight'"),
        ("line", ["celing"], "did you mean 'ceiling'?"),
        ("line", ["ceiling", "ceiling"], "ceiling is named twice"),
        ("line", [], "of must name one quantity or more"),
    ],
)
def test_quantities_that_are_none_are_refused(problem: str, of: list[str], said: str) -> None:
    with pytest.raises(ab.SpecError) as refused:
        ab.min_requirements(problem, of=of, workers=1)
    assert said in str(refused.value)
