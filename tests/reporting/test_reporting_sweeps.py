"""A sweep's page and table say what its rows are, and red is what went wrong."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import aerobat as ab
from aerobat.reporting.facts import facts
from aerobat.reporting.notebooks import html, png
from aerobat.reporting.panels.crossings import Crossings, draw_opening
from aerobat.reporting.plain_data import plain
from aerobat.reporting.style import RED
from aerobat.reporting.sweeps.figure import crossings
from reporting_cases import require_legible
from shared_plans import shared_plan

pytestmark = pytest.mark.filterwarnings("error")  # drawing warns of nothing
RUNS = 60
ROUGH = ab.Dispersion(mass=0.1, rotor=0.08, start_position=0.3, start_velocity=0.4, start_attitude=0.4)


@cache
def rough() -> ab.Sweep:
    """Flights of which some fail."""
    return ab.sweep(shared_plan("half-flip"), ROUGH, RUNS, 3, workers=1)


@cache
def without_a_gate() -> ab.Sweep:
    return ab.sweep(shared_plan("line"), ROUGH, 5, 3, workers=1)


def lost(sweep: ab.Sweep) -> ab.Sweep:
    """The sweep as if none of its flights had come to the gate."""
    columns = dict(sweep.table)
    for name in [name for name in columns if name.startswith("gate_") and name != "gate_outcome"]:
        columns[name] = np.full(len(sweep), np.nan)
    columns["gate_outcome"] = np.full(len(sweep), "not_reached")
    columns["outcome"] = np.full(len(sweep), "diverged")
    return replace(sweep, table=columns)


def through_many_gates() -> ab.Sweep:
    """The sweep as if its flights passed the gate five times, farther off its centre every time."""
    columns = dict(rough().table)
    passage = {name: values for name, values in columns.items() if name.startswith("gate_")}
    for k in range(2, 6):
        columns |= {name.replace("gate", f"gate#{k}"): values for name, values in passage.items()}
        columns[f"gate#{k}_miss_m"] = k * columns["gate_miss_m"]
    return replace(rough(), table=columns)


@pytest.mark.parametrize(
    "make",
    [rough, pytest.param(without_a_gate, marks=pytest.mark.slow), lambda: lost(rough()), through_many_gates],
)
def test_a_page_is_legible_whatever_becomes_of_the_flights(make, monkeypatch) -> None:
    require_legible(ab.sweep_figure(make()), monkeypatch)


def test_a_lost_flight_leaves_the_scales_to_the_others() -> None:
    """Its error is told in words."""
    swept = rough()
    errors, largest = np.full_like(swept.position_error, 0.05), np.full(len(swept), 0.05)
    errors[0], largest[0] = 30.0, 30.0
    table = {**swept.table, "max_position_error_m": largest}
    figure = ab.sweep_figure(replace(swept, position_error=errors, table=table))
    errors_axes = next(axes for axes in figure.axes if axes.get_ylabel() == "position error [cm]")
    distances = next(axes for axes in figure.axes if axes.get_ylabel() == "flights within [%]")
    assert errors_axes.get_ylim()[1] < 100.0
    assert "cut off: up to 3e+03" in {text.get_text() for text in errors_axes.texts}
    assert distances.get_xlim()[1] < 100.0


def test_an_attitude_is_told_only_of_gates_that_ask_for_one() -> None:
    plan = rough().plan
    unasked = replace(rough(), plan=replace(plan, problem=replace(plan.problem, maneuver=ab.Line())))
    for swept, told in ((rough(), True), (unasked, False)):
        [(gate,)] = (fact.value for fact in facts(swept) if fact.key == "passages")
        assert ("attitude" in {fact.label for fact in gate.value}) is told


def test_the_distances_in_many_gates_are_those_in_the_worst_each_in_a_colour_of_its_own() -> None:
    swept = through_many_gates()
    (axes,) = (
        each for each in ab.sweep_figure(swept).axes if "distance from the gate's centre" in each.get_xlabel()
    )
    lines, names = axes.get_legend_handles_labels()
    assert names == ["largest error", "gate#4", "gate#5"]
    assert len({line.get_color() for line in lines}) == len(lines)
    assert axes.get_xlim()[1] == 100.0 * swept.quantile("gate#5_miss_m", 0.99)


def test_red_crossings_are_those_that_did_not_pass() -> None:
    wrong = int((rough().table["gate_outcome"] != "passed").sum())
    assert 0 < wrong < RUNS  # some of either kind
    assert crossings(rough())["gate"].wrong.sum() == wrong
    opening = ab.sweep_figure(rough()).axes[2]
    drawn = {to_hex(dots.get_facecolor()[0]): len(dots.get_offsets()) for dots in opening.collections}
    beyond = sum(int(t.get_text().split()[0]) for t in opening.texts if t.get_text().endswith("beyond"))
    crossed = np.isfinite(rough().table["gate_miss_m"])
    assert drawn[RED] + beyond == (crossed & (rough().table["gate_outcome"] != "passed")).sum()
    assert sum(drawn.values()) + beyond == crossed.sum()


def test_every_crossing_within_the_picture_is_drawn_also_where_it_is_wider_than_the_gate_needs() -> None:
    (gate,) = ab.load_problem("flip-roll").gates
    right, up = gate.opening.size[0] * np.array([0.0, 1.5, 9.0]), np.zeros(3)
    axes = Figure(figsize=(24.0, 3.0)).add_axes((0.0, 0.0, 1.0, 1.0))
    draw_opening(axes, Crossings(gate, right, up, np.zeros(3, dtype=bool), None))
    within = np.abs(right) <= axes.get_xlim()[1]
    assert within.tolist() == [True, True, False]
    assert sum(len(dots.get_offsets()) for dots in axes.collections) == 2
    assert [text.get_text() for text in axes.texts] == ["1 beyond"]


def test_flights_that_do_not_come_to_a_gate_are_worse_than_any_that_miss_it() -> None:
    none = lost(rough())
    assert none.quantile("gate_miss_m", 0.0) == np.inf
    assert none.within("gate_miss_m", 1e9).count == 0
    assert none.passed("gate").count == 0
    gate = plain(none)["passages"]["gate"]
    assert gate["miss_m"] == {"50%": None, "95%": None, "100%": None}
    with pytest.raises(ab.SpecError, match="no passage named 'gat'; did you mean 'gate'"):
        none.passed("gat")
    with pytest.raises(ab.SpecError, match="no column of numbers named 'outcome'"):
        none.quantile("outcome", 0.5)
    with pytest.raises(ab.SpecError, match=r"named 'gate_outcome'; (?!.*gate_outcome)(?=.*gate_miss_m)"):
        none.within("gate_outcome", 1.0)


def test_quantiles_and_shares_are_those_of_the_rows() -> None:
    errors = np.sort(rough().table["max_position_error_m"])
    assert rough().quantile("max_position_error_m", 0.5) == errors[RUNS // 2]
    assert rough().quantile("max_position_error_m", 1.0) == errors[-1]
    assert rough().within("max_position_error_m", errors[9]).count == 10
    assert sum(share.count for share in rough().outcomes.values()) == RUNS
    assert rough().success.count == sum(
        share.count for outcome, share in rough().outcomes.items() if outcome.is_success
    )


def test_errors_over_time_are_those_of_the_logged_flights() -> None:
    """RMS over ten ticks lies between the least and the largest of them, and ends with the flight."""
    swept = rough()
    logged = ab.fly(swept.plan, conditions=ROUGH, seed=3, flights=20, engine="compiled")
    ends = np.searchsorted(logged.times, swept.times)
    for errors, exact in (
        (swept.position_error, logged.position_error),
        (swept.attitude_error, logged.attitude_error),
    ):
        for begin, end, column in zip(ends, ends[1:], errors[:20, 1:].T, strict=False):
            within = exact[:, begin + 1 : end + 1]
            np.testing.assert_allclose(column, np.sqrt(np.mean(within**2, axis=1)), rtol=1e-5, atol=1e-7)


def test_a_sweep_is_a_data_frame_and_shows_itself_in_notebooks() -> None:
    table = ab.to_dataframe(rough())
    assert list(table.columns) == list(rough().table)
    assert len(table) == RUNS
    assert "went well" in html(rough())
    assert png(rough()) is not None
