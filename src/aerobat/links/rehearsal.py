"""A flight without a vehicle, which imports all that a real one needs before a vehicle waits for it."""

from __future__ import annotations

from aerobat.kernels.rigid_body import Body
from aerobat.links.commander import Commander, Doing
from aerobat.links.goals import Observed
from aerobat.vehicle import Vehicle

_HEIGHT = 1.0  # [m] of the climb
_STEP = 0.1  # [s] between goals
_STANDING = Body((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)


def rehearse(vehicle: Vehicle, gravity: float) -> None:
    """Lead a vehicle that is always at its goal up, to a halt, and down.

    Args:
        vehicle: whose thrust counts when braking.
        gravity: [m/s²].
    """
    commander, now = Commander(vehicle, gravity, _STEP), 0.0
    commander.observe(Observed(now, _STANDING))
    commander.take_off(now, _HEIGHT)
    for order in (commander.hover, commander.land, None):
        while commander.doing not in (Doing.HOVERING, Doing.NOTHING):
            goal, now = commander.step(now), now + _STEP
            if goal is not None:
                reached = goal.position, goal.velocity, goal.q_world_body, goal.omega
                commander.observe(Observed(now, Body(*(tuple(part.tolist()) for part in reached))))
        if order is not None:
            order(now)
