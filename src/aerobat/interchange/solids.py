"""Obstacles and walls of a plan's problem as triangles, for programs that show them."""

from __future__ import annotations

from aerobat.environment.obstacles.surface import Surface, flattening, surface_of
from aerobat.planning import Plan

REACH = 100.0  # [m] from the path, at which infinite surfaces are cut off


def solid_surfaces(plan: Plan) -> tuple[Surface, ...]:
    """Return the surfaces of all obstacles and walls, as far as `REACH` around the path."""
    pieces = plan.problem.surroundings.pieces.pieces
    if not pieces:
        return ()
    path = plan.trajectory.evaluate(plan.trajectory.sample(10.0))
    lower, upper = path.min(axis=0) - REACH, path.max(axis=0) + REACH
    found = (surface_of(piece).within(lower, upper) for piece in pieces)
    return tuple(surface for surface in found if surface.faces)


def flattened(plan: Plan) -> float:
    """Return the largest distance [m] by which triangles of round obstacles lie inside of them."""
    return max((flattening(piece) for piece in plan.problem.surroundings.pieces.pieces), default=0.0)
