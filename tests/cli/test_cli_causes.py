"""`aerobat causes`: four causes of error measured as Python does, and refused where one cannot be."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import pytest

import aerobat as ab
from aerobat import cli
from aerobat.cli.progress import Progress
from aerobat.reporting.plain_data import to_json
from aerobat.studies.error_causes import error_causes, four_causes
from public_calls import cruise

FEW = ("--vehicle", "hexarotor", "--flights", "8", "--seed", "3")


def quick_study(flights: int) -> ab.ErrorCauses:
    """Measure one cause of a cruise, planned in closed form."""
    return error_causes(
        cruise().problem,
        "agile-quad",
        [ab.Cause("late", {"conditions.control_rate": 200.0})],
        planner=ab.MinSnap(),
        conditions=ab.Dispersion(mass=0.01, control_rate=100.0),
        flights=flights,
    )


def test_a_trial_counts_as_progress_once_it_is_finished(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[tuple[int, str]] = []
    monkeypatch.setattr(Progress, "tell", lambda self, done, note: told.append((done, note)))

    def measured(*given: object, begin: Callable[[str], None], **more: object) -> ab.ErrorCauses:
        for name in ("none", "late", "all together"):
            begin(name)
        return quick_study(flights=8)

    monkeypatch.setattr("aerobat.cli.commands.causes.error_causes", measured)
    cli.main(["causes", "half-flip", *FEW, "--json"])
    assert told == [(0, "none"), (1, "late"), (2, "all together")]


def test_what_the_command_says_is_measured_and_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a study that takes less time than the one asked for."""
    found = quick_study(flights=8)
    asked = []
    monkeypatch.setattr(
        "aerobat.cli.commands.causes.error_causes",
        lambda *given, **more: asked.append((given, more)) or found,
    )
    cli.main(["causes", "half-flip", *FEW, "--reserve", "0.2"])
    table = capsys.readouterr().out
    (((problem, vehicle, causes), settings),) = asked
    assert problem == ab.load_problem("half-flip")
    assert vehicle == ab.load_vehicle("hexarotor")
    assert causes == four_causes(ab.load_dispersion("lab"), vehicle.controller)
    settings.pop("begin")("late")
    assert settings == {
        "planner": ab.Miqp(order=4, reserve=0.2),
        "conditions": ab.load_dispersion("lab"),
        "flights": 8,
        "seed": 3,
        "workers": None,
    }
    assert "cruise · agile-quad" in table
    assert all(result.cause in table for result in found.results)
    cli.main(["causes", "half-flip", *FEW, "--json"])
    told = json.loads(capsys.readouterr().out)["causes"]
    assert {facts["cause"]: facts["cost_median_m"] for facts in told} == {
        result.cause: found.cost(result.cause).median for result in found.results
    }


def test_bounds_that_few_flights_cannot_give_are_null_in_json() -> None:
    """Two flights vouch for no interval of a median: its ends are infinite, which JSON has no word for."""
    found = quick_study(flights=2)
    told = json.loads(to_json(found))
    (late,) = (facts for facts in told["causes"] if facts["cause"] == "late")
    assert late["cost_low_m"] is None
    assert late["cost_median_m"] == found.cost("late").median


@pytest.mark.slow
def test_the_table_holds_what_python_measures(capsys: pytest.CaptureFixture[str]) -> None:
    cli.main(["causes", "half-flip", *FEW, "--json"])
    told = json.loads(capsys.readouterr().out)
    lab, vehicle = ab.load_dispersion("lab"), ab.load_vehicle("hexarotor")
    measured = error_causes(
        "half-flip",
        vehicle,
        four_causes(lab, vehicle.controller),
        planner=ab.Miqp(order=4, reserve=0.1),
        conditions=lab,
        flights=8,
        seed=3,
    )
    rows = {facts["cause"]: facts for facts in told["causes"]}
    assert list(rows) == [result.cause for result in measured.results]
    assert len(rows) == 6
    for result in measured.results:
        facts = rows[result.cause]
        assert facts["duration_s"] == result.plan.duration
        assert facts["cost_median_m"] == measured.cost(result.cause).median
        assert facts["error_median_m"] in result.position_error
    assert rows["hand-off 5 cm, 2°"]["cost_median_m"] > 0.03


def test_a_hand_off_is_made_where_conditions_have_none() -> None:
    lab = ab.load_dispersion("lab")
    assert lab.motion_capture is not None
    single = replace(lab, motion_capture=replace(lab.motion_capture, hand_off=None))
    cause = four_causes(single, ab.Controller())[1]
    (made,) = cause.changes.values()
    assert made.translation == 0.05
    assert made.warp == 0.0


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("line",), "has no gate"),
        (("half-flip", "--conditions", "none"), "no motion capture"),
        (("half-flip", "--flights", "0"), "flights"),
        (("half-flip", "--reserve", "0.5"), "reserve"),
    ],
)
def test_what_cannot_be_measured_is_refused_in_a_sentence(
    arguments: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(["causes", *arguments])
    assert stop.value.code == 2
    assert told in capsys.readouterr().err
