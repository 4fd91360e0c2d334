"""A limit of one's own, a function of ten lines, is held by every planner and by certificates."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import radians

import numpy as np
import pytest

from aerobat.certification import Side, certify
from aerobat.errors import Infeasible, SpecError
from aerobat.flatness import reference
from aerobat.limits import Asked, Limit, PathQuantity, register_limits
from aerobat.limits.along import FAMILIES
from aerobat.planning import FreeKnots, MinSnap, Miqp, Planner, TimeOptimal, plan
from aerobat.problem import Limits, load_problem
from aerobat.vehicle import load_vehicle
from shared_plans import shared_plan

QUAD = load_vehicle("agile-quad")
LINE = load_problem("line")
PLANNERS = (  # with half of the rate [N/s] of collective thrust that their plans of `line` come to
    (MinSnap(), 12.0),
    (Miqp(), 120.0),
    pytest.param(FreeKnots(segments=2), 120.0, marks=pytest.mark.slow),
    pytest.param(TimeOptimal(starts=1), 120.0, marks=pytest.mark.slow),
)


@contextmanager
def smooth_thrust(most: float) -> Iterator[None]:
    """Limit the rate [N/s] of the collective thrust while the context lasts."""

    @register_limits
    def limits(asked: Asked) -> Iterator[Limit]:
        if asked.vehicle is not None:
            rate = PathQuantity.of_wrench(np.zeros(4), [1.0, 0.0, 0.0, 0.0])
            yield Limit("thrust rate", "N/s", rate, -most, most, ("own.rate", "own.rate"), 2.0 * most)

    try:
        yield
    finally:
        FAMILIES.remove(limits)


def largest_rate(found: object) -> float:
    """The largest change of the collective thrust [N/s] in dense samples of a plan."""
    path = found.trajectory  # type: ignore[attr-defined]
    times = np.linspace(0.0, path.duration, 4001)
    thrust = reference(path, QUAD, times).setpoint.wrench.thrust
    return float(np.abs(np.diff(thrust) / np.diff(times)).max())


@pytest.mark.parametrize(("planner", "most"), PLANNERS)
def test_every_planner_holds_a_limit_of_ones_own(planner: Planner, most: float) -> None:
    with smooth_thrust(most):
        found = plan(LINE, planner, QUAD)
    assert found.certified
    assert found.certificate is not None
    stated = [finding for finding in found.certificate.findings if finding.quantity == "thrust rate"]
    assert {finding.side for finding in stated} == {Side.MIN, Side.MAX}
    assert {finding.field for finding in stated} == {"own.rate"}
    assert 0.5 * most < largest_rate(found) < 1.01 * most


def test_a_certificate_refutes_what_a_limit_of_ones_own_forbids() -> None:
    path = shared_plan("line").trajectory
    with smooth_thrust(120.0):
        certificate = certify(path, QUAD)
    assert not certificate.certified
    assert "thrust rate" in certificate.why
    assert certify(path, QUAD).certified


@pytest.mark.parametrize(
    "planner", [MinSnap(), Miqp(), pytest.param(FreeKnots(segments=2), marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "ceiling", [40.0, *(pytest.param(tilt, marks=pytest.mark.slow) for tilt in (25.0, 70.0))]
)
def test_every_planner_keeps_below_a_ceiling_on_tilt(planner: Planner, ceiling: float) -> None:
    limited = replace(LINE, limits=Limits(max_tilt=radians(ceiling)))
    found = plan(limited, planner, QUAD)
    assert found.certified
    times = np.linspace(0.0, found.duration, 2001)
    upright = reference(found.trajectory, QUAD, times).setpoint.q_world_body
    tilt = np.degrees(2.0 * np.arcsin(np.hypot(upright[:, 1], upright[:, 2])))
    assert 0.9 * ceiling < tilt.max() < ceiling + 1e-4


def test_a_flip_below_a_ceiling_on_tilt_is_refused() -> None:
    with pytest.raises(Infeasible):
        Miqp(rescue=False).plan(
            replace(load_problem("flip-roll"), limits=Limits(max_tilt=radians(60.0))), QUAD
        )


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"lower": float("nan")}, "limit 'thrust rate' has lower nan and upper 9"),
        ({"lower": 10.0}, "lower 10 and upper 9"),
        ({"size": 0.0}, "has size 0; give its range"),
        ({"fields": "battery"}, "fields must be a pair"),
    ],
)
def test_a_limit_that_is_none_is_refused_in_a_sentence(changed: dict[str, object], told: str) -> None:
    rate = PathQuantity.of_wrench(np.zeros(4), [1.0, 0.0, 0.0, 0.0])
    with pytest.raises(SpecError, match=told):
        replace(Limit("thrust rate", "N/s", rate, -9.0, 9.0, ("a", "b"), 18.0), **changed)  # type: ignore[arg-type]
