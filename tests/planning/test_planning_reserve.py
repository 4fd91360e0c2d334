"""A reserve that is asked for is proven of the plan that is returned, whoever planned it in the end."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from aerobat.certification import Certificate, Side
from aerobat.errors import Infeasible
from aerobat.limits.limit import effective_reserve
from aerobat.planning import FreeKnots, Miqp, Planner, TimeOptimal
from aerobat.planning.miqp.rescue import Rescue
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import FLYING_RESERVE
from aerobat.planning.rotor_margin import reserve_shortfalls, rotor_findings
from aerobat.planning.task import Task
from aerobat.problem import load_problem
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import load_vehicle


def kept(certificate: Certificate | None) -> float:
    """The smallest fraction of its range that a rotor's thrust or command is proven to keep from a limit."""
    assert certificate is not None
    limits: dict[str, list[float]] = {}
    margins: dict[str, float] = {}
    for finding in certificate.findings:
        if finding.rotor is not None:
            assert finding.limit is not None
            assert finding.margin is not None
            limits.setdefault(finding.name, []).append(finding.limit)
            margins[finding.name] = min(finding.margin, margins.get(finding.name, finding.margin))
    return min(margins[name] / (max(ends) - min(ends)) for name, ends in limits.items())


@pytest.mark.parametrize(
    ("planner", "reserve", "problem"),
    [
        (Miqp(reserve=0.03), 0.03, "half-flip"),
        pytest.param(Miqp(reserve=0.1), 0.1, "flip-roll", marks=pytest.mark.slow),
        pytest.param(Miqp(reserve=0.3), 0.3, "flip-roll", marks=pytest.mark.slow),
        (FreeKnots(segments=2, reserve=0.03), 0.03, "line"),
        pytest.param(FreeKnots(reserve=0.03), 0.03, "flip-roll", marks=pytest.mark.slow),
        pytest.param(
            TimeOptimal(segments=8, reserve=0.1, starts=1), 0.1, "half-flip", marks=pytest.mark.slow
        ),
    ],
    ids=str,
)
def test_every_plan_is_proven_to_keep_the_reserve_that_was_asked(
    planner: Planner, reserve: float, problem: str
) -> None:
    """Free-knots returned the path that it began from, which kept none, and so did rescues."""
    plan = planner.plan(load_problem(problem), load_vehicle("crazyflie"))
    assert plan.certified
    assert kept(plan.certificate) >= reserve


def test_every_rescue_is_asked_to_keep_what_was_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []

    def refuse(self: Any, *_: Any) -> None:
        asked.append(self.reserve)
        raise Infeasible("refused")

    for planner in (Miqp, FreeKnots, TimeOptimal):
        monkeypatch.setattr(planner, "plan", refuse)
    problem, vehicle = load_problem("flip-roll"), load_vehicle("crazyflie")
    assert Rescue(Miqp(reserve=0.34), problem, vehicle, Recorder(None)).plan() is None
    assert asked
    assert min(asked) == 0.34


def test_what_is_missing_of_a_reserve_is_told_of_the_rotor_that_keeps_least() -> None:
    certificate = Miqp().plan(load_problem("half-flip"), load_vehicle("agile-quad")).certificate
    assert certificate is not None
    least = kept(certificate)
    assert reserve_shortfalls(certificate, least) == []
    worst = reserve_shortfalls(certificate, least + 0.01)[0]
    assert worst.kept == least
    assert worst.size == pytest.approx(0.01)
    assert "in reserve" in str(worst)


@pytest.mark.slow
def test_a_large_reserve_leaves_strong_rotors_the_room_to_sink() -> None:
    """They hover at 15 % of their range: of that, a reserve of 0.3 keeps two thirds from their lower ends."""
    vehicle = load_vehicle("agilicious")
    certificate = FreeKnots(segments=2, reserve=0.3).plan(load_problem("line"), vehicle).certificate
    assert certificate is not None
    hover = 9.81 / vehicle.max_specific_thrust
    for side, least in ((Side.MIN, hover * 0.3 / 0.45), (Side.MAX, 0.3)):
        kept = min(each.margin / each.size for each in rotor_findings(certificate, side))  # type: ignore[operator]
        assert kept == pytest.approx(least, abs=0.02)
        assert kept >= least


def test_of_a_small_room_a_reserve_keeps_a_part_that_grows_and_never_all() -> None:
    assert effective_reserve(0.3, float("inf")) == 0.3
    assert effective_reserve(0.15, 0.15) == pytest.approx(0.075)
    parts = [effective_reserve(0.01 * k, 0.15) for k in range(50)]
    assert parts == sorted(parts)
    assert parts[0] == 0.0
    assert parts[-1] < 0.15


@pytest.mark.parametrize("idle", [0.0, 0.02, 0.3, 0.5, 0.75, 0.95])
def test_a_reserve_leaves_rotors_the_room_to_hover_whatever_their_idle_thrust(idle: float) -> None:
    """With 75 %, the default reserve reached beyond hover thrust, so that no plan kept it."""
    vehicle = load_vehicle("agile-quad")
    hover = vehicle.mass * STANDARD_GRAVITY / len(vehicle.rotors)
    rotors = tuple(replace(rotor, min_thrust=idle * hover) for rotor in vehicle.rotors)
    task = Task.of(load_problem("line"), replace(vehicle, rotors=rotors))
    for limit in task.limits:
        if limit.rotor is not None:
            lower, upper = limit.reserves(FLYING_RESERVE)
            assert idle * hover + lower * limit.size < hover
            assert upper == FLYING_RESERVE
