"""A dry run without a vehicle, which imports all modules of a real flight before a vehicle waits for them."""

from __future__ import annotations

from aerobat.kernels.rigid_body import Body
from aerobat.links.commander import Commander, Doing
from aerobat.links.goals import Observed
from aerobat.vehicle import Vehicle


def rehearse(vehicle: Vehicle, gravity: float) -> None:
    """Fly a vehicle that is always at its goal up, to a halt, and down.

    Args:
        vehicle: of which the maximum thrust is used for braking.
        gravity: [m/s²].
    """
    period, now = 0.1, 0.0  # [s]
    commander = Commander(vehicle, gravity, period)
    standing = Body((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
    commander.observe(Observed(now, standing))
    commander.take_off(now, height=1.0)
    for order in (commander.hover, commander.land, None):
        while commander.doing not in (Doing.HOVERING, Doing.NOTHING):
            goal, now = commander.step(now), now + period
            if goal is not None:
                reached = goal.position, goal.velocity, goal.q_world_body, goal.omega
                commander.observe(Observed(now, Body(*(tuple(part.tolist()) for part in reached))))
        if order is not None:
            order(now)
