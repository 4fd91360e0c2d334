"""Planners side by side: the rows say what the plans are, and table and picture say what the rows say."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from rich.console import Console

import aerobat as ab
from aerobat.reporting.plain_data import plain
from aerobat.reporting.tables import table
from aerobat.studies.compare import Comparison, Entry
from reporting_cases import drawn_gates, require_legible, simulated, with_moving_gates
from shared_plans import shared_plan

pytestmark = pytest.mark.filterwarnings("error")  # drawing warns of nothing
KEYS = [
    "planner", "segments", "duration_s", "ratio",
    "certified", "min_margin_n", "max_position_error_m", "planning_s", "note",
]  # fmt: skip
REASON = "the planner hops needs HopLib, which is not installed; pip install 'hoplib[fast]'"
NOTE = "begun again from free-knots's 3.000 s; 3.200 s alone"
NONE = Entry("free-knots", None, None, None, 0.25, REASON)


@lru_cache
def section_v():
    """A plan, one stopped early, one that takes the time-optimal one's part, and a planner without any."""
    problem, vehicle = ab.load_problem("section-v"), ab.load_vehicle("section-v")
    planners = (("miqp", ab.Miqp()), ("min-snap", ab.MinSnap(stop_after=6)), ("time-optimal", ab.MinSnap()))
    made = ab.compare(problem, vehicle, planners).entries
    return Comparison(problem, vehicle, (*made[:2], NONE, replace(made[2], note=NOTE)))


def flip():
    plan, flight, vehicle = shared_plan("flip-roll"), simulated("flip-roll"), ab.load_vehicle("agile-quad")
    entry = Entry("miqp", plan, flight, ab.score(flight, plan.problem, vehicle), 0.1, "through the gate")
    return Comparison(plan.problem, vehicle, (entry, NONE))


def printed(comparison):
    console = Console(width=80)
    with console.capture() as capture:
        console.print(table(comparison))
    return capture.get()


def test_rows_hold_what_the_plans_and_flights_are():
    comparison = section_v()
    rows = plain(comparison)["planners"]
    assert [list(row) for row in rows] == [KEYS] * 4
    for row, entry in zip(rows, comparison.entries, strict=True):
        told = row["planner"], row["planning_s"], row["note"]
        assert told == (entry.planner, entry.planning_time, entry.note)
        if entry.plan is None:
            continue
        assert row["segments"] == entry.plan.trajectory.segments
        assert row["duration_s"] == entry.plan.trajectory.duration
        assert row["ratio"] == pytest.approx(entry.plan.trajectory.duration / 3.1)
        error = entry.flight.states.position - entry.flight.setpoint.flat.position
        assert row["max_position_error_m"] == pytest.approx(np.linalg.norm(error, axis=1).max())
    assert [row["certified"] for row in rows] == [True, False, None, True]
    assert rows[1]["min_margin_n"] == pytest.approx(-11.54, abs=0.01)  # rotor 1 is reference for -11.74 N
    assert rows[3]["min_margin_n"] == pytest.approx(0.063, abs=0.001)


def test_a_planner_without_a_plan_has_none_for_what_there_is_not():
    row = plain(section_v())["planners"][2]
    assert row.pop("note") == ""
    assert {key for key, value in row.items() if value is not None} == {"planner", "planning_s"}


def test_there_is_no_ratio_without_a_time_optimal_plan():
    assert [row["ratio"] for row in plain(flip())["planners"]] == [None, None]


def test_the_table_fits_a_terminal_and_tells_notes_and_why_there_is_no_plan():
    text = printed(section_v())
    assert max(map(len, text.splitlines())) <= 80
    assert "3.100 s" in text
    assert " ".join(REASON.split()) in " ".join(text.split())  # its brackets are no markup
    assert NOTE in " ".join(text.split())


@pytest.mark.parametrize("comparison", [section_v, flip])
def test_no_text_lies_over_another_or_beyond_the_page(comparison, monkeypatch):
    require_legible(ab.comparison_figure(comparison()), monkeypatch)


def test_many_planners_fit_the_page(monkeypatch):
    comparison = section_v()
    more = tuple(replace(entry, planner="free-knots") for entry in comparison.entries[:2])
    many = replace(comparison, entries=(*comparison.entries, *more))
    require_legible(ab.comparison_figure(many), monkeypatch)


def test_every_plan_has_its_path_and_its_thrusts_between_the_limits_on_one_time_axis():
    comparison = section_v()
    plans = [entry.plan for entry in comparison.entries if entry.plan is not None]
    paths, *rows = [axes for axes in ab.comparison_figure(comparison).axes if axes.axison]
    assert len(rows) == len(plans)
    assert len({(axes.get_xlim(), axes.get_ylim()) for axes in rows}) == 1
    for axes, line, plan in zip(rows, paths.get_lines(), plans, strict=False):
        times = np.linspace(0.0, plan.duration, len(line.get_xdata()))
        drawn = np.column_stack(line.get_data())
        np.testing.assert_allclose(drawn, plan.trajectory.evaluate(times)[:, [0, 2]], atol=1e-9)
        rotors = axes.get_lines()[:4]
        assert {rotor.get_color() for rotor in rotors} == {line.get_color()}
        reference = ab.reference(
            plan.trajectory,
            comparison.vehicle,
            times=rotors[0].get_xdata(),
            environment=plan.problem.environment,
        )
        drawn = np.column_stack([rotor.get_ydata() for rotor in rotors])
        np.testing.assert_allclose(drawn, reference.rotor_thrusts, atol=1e-9)
        dashed = [one.get_ydata()[0] for one in axes.get_lines() if one.get_linestyle() == "--"]
        assert dashed == [-0.2, 18.0]
    assert len({line.get_color() for line in paths.get_lines()[: len(plans)]}) == len(plans)


def test_the_gate_is_in_the_picture_of_the_paths():
    paths = ab.comparison_figure(flip()).axes[0]
    gate = max((c for c in paths.collections if isinstance(c, PolyCollection)), key=lambda c: c.get_zorder())
    assert len(gate.get_paths()) == 16  # four bars of four faces


def test_a_gate_that_moves_is_drawn_where_each_plan_passes_it():
    still = flip()
    plan = with_moving_gates(still.entries[0].plan)
    late = replace(plan, stages=tuple(replace(stage, time=stage.time + 0.2) for stage in plan.stages))

    def frames(*plans):
        entries = tuple(replace(still.entries[0], plan=each) for each in plans)
        return drawn_gates(ab.comparison_figure(Comparison(plans[0].problem, still.vehicle, entries)).axes[0])

    np.testing.assert_allclose(frames(plan), drawn_gates(ab.comparison_figure(still).axes[0]), atol=1e-9)
    assert len(frames(plan, late)[0]) == 2 * len(frames(plan)[0])
