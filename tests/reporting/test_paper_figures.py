"""The paper's figures: drawn from runs, legible, the same each time, with its numbers beside ours."""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from paper import gates
from paper.flights import maneuver_flights, printed_plan
from paper.hardware import hardware_causes
from paper.paper_figure import PaperFigure
from paper.time_search import PAPER_TIMES, time_search
from paper_figures import FIGURES, main
from reporting_cases import require_legible

FEW = 8  # flights that show the same in less time


@cache
def drawn(number: int) -> PaperFigure:
    if number == 6:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(gates, "TILTS", (45,))
            patch.setattr(gates, "hardware_causes", partial(hardware_causes, flights=FEW))
            return FIGURES[number](print)
    return FIGURES[number](print)


@pytest.mark.parametrize(
    "number", [2, *(pytest.param(number, marks=pytest.mark.slow) for number in (3, 5, 6, 8, 9, 10))]
)
def test_no_text_lies_over_another_or_beyond_the_page(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    require_legible(drawn(number).figure, monkeypatch)


@pytest.mark.slow
def test_the_same_runs_give_the_same_bytes() -> None:
    first = drawn(3)
    maneuver_flights.cache_clear()
    again = FIGURES[3](print)
    assert again.caption == first.caption
    assert again.png == first.png
    assert again.pdf == first.pdf


@pytest.mark.slow
def test_the_search_on_times_comes_to_the_paper_s_times_and_only_then_within_the_limits() -> None:
    search = time_search()
    for iteration, times in PAPER_TIMES.items():
        np.testing.assert_allclose(search.iterations[iteration - 1].trajectory.knots[1:], times)
    assert [plan.certified for plan in search.iterations] == 11 * [False] + [True]
    assert search.optimized.score.outcome.is_success
    assert not search.stopped.score.outcome.is_success


def test_intervals_that_are_drawn_meet_and_have_constant_jerk() -> None:
    axes = {panel.get_ylabel(): panel for panel in drawn(2).figure.axes}
    trajectory = printed_plan("flip-roll").trajectory
    for label, derivative in (("position [m]", 0), ("jerk [m/s³]", 3)):
        y, z, *_ = (np.asarray(line.get_ydata(), dtype=float) for line in axes[label].get_lines())
        expected = trajectory.on_segments(np.linspace(0.0, 1.0, len(y) // trajectory.segments), derivative)
        np.testing.assert_allclose(np.stack([y, z], axis=-1), expected[..., 1:].reshape(-1, 2), atol=1e-9)
    jerk = np.asarray(axes["jerk [m/s³]"].get_lines()[1].get_ydata()).reshape(trajectory.segments, -1)
    assert np.ptp(jerk, axis=1).max() < 1e-6
    assert np.abs(jerk).max() <= 200.0 + 1e-6


@pytest.mark.slow
def test_errors_that_are_told_are_those_of_the_flights() -> None:
    flights = maneuver_flights("half-flip")
    caption = drawn(5).caption
    assert f"{100 * flights.printed.score.max_position_error_m:.0f} cm" in caption.here
    assert f"{flights.printed.score.max_attitude_error_deg:.0f}°" in caption.here
    assert flights.here.plan.certified
    assert flights.here.score.max_position_error_m < 1e-3 * flights.printed.score.max_position_error_m


@pytest.mark.slow
@pytest.mark.parametrize(("named", "written"), [("2 2", [2]), ("3 2 2", [2, 3])])
def test_the_command_writes_what_it_names(
    named: str, written: list[int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main([str(tmp_path / "deep" / "figures"), *named.split()])
    names = {f"fig-{number}.{kind}" for number in written for kind in ("png", "pdf")}
    assert {path.name for path in (tmp_path / "deep" / "figures").iterdir()} == {*names, "figures.md"}
    assert drawn(2).caption.here in capsys.readouterr().out
    png, pdf = ((tmp_path / "deep" / "figures" / f"fig-2.{kind}").read_bytes() for kind in ("png", "pdf"))
    assert (png, pdf) == (drawn(2).png, drawn(2).pdf)  # of the same run, drawn another time


@pytest.mark.parametrize("number", ["4", "-1", "11"])
def test_an_unknown_figure_is_refused_before_anything_is_drawn(
    number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main([str(tmp_path / "figures"), "2", number])
    assert stop.value.code == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert f"no figure {number}" in err or "unrecognized arguments" in err
    assert not (tmp_path / "figures").exists()
