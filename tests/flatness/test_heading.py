"""What was proven is what is flown: a flight has the certified trajectory's attitude, at any heading."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3

VEHICLE = ab.load_vehicle("agile-quad")


@pytest.mark.parametrize("heading_deg", [pytest.param(90.0, marks=pytest.mark.slow), -135.0])
def test_a_plan_is_flown_at_its_heading(heading_deg: float) -> None:
    heading = np.deg2rad(heading_deg)
    plan = ab.plan(replace(ab.load_problem("line"), heading=heading), vehicle=VEHICLE)
    flight = ab.fly(plan)
    turned = so3.about_axis([0.0, 0.0, 1.0], heading)
    assert so3.angle_between(flight.states.q_world_body[0], turned) < 1e-9
    asked = ab.reference(plan.trajectory, VEHICLE, times=flight.times).setpoint
    np.testing.assert_array_equal(flight.setpoint.q_world_body, asked.q_world_body)
    assert ab.score(flight, plan, VEHICLE).max_attitude_error_deg < 2.0


def test_a_bare_trajectory_is_flown_at_its_heading_too() -> None:
    trajectory = ab.plan(replace(ab.load_problem("line"), heading=1.0), vehicle=VEHICLE).trajectory
    flight = ab.fly(trajectory, VEHICLE)
    assert so3.angle_between(flight.states.q_world_body[0], so3.about_axis([0, 0, 1.0], 1.0)) < 1e-9


def test_a_score_knows_the_vehicle_of_its_plan() -> None:
    plan = ab.plan(ab.load_problem("half-flip"), vehicle=VEHICLE)
    flight = ab.fly(plan)
    assert ab.score(flight, plan) == ab.score(flight, plan, VEHICLE)
    assert ab.score(flight, plan).passages[0].clearance > 0.0
