"""Plans in a world with obstacles, which were not planned."""

from __future__ import annotations

from functools import cache

import aerobat as ab

OBSTACLES = (
    ab.Cylinder((0.5, 0.8, 0.0), (0.5, 0.8, 2.0), 0.2, name="trunk"),
    ab.Sphere((1.5, -0.8, 1.5), 0.3),
    ab.Box((1.5, 0.9, 0.5), (0.4, 0.4, 1.0), heading=0.5),
)


@cache
def walled_cruise(obstacles: tuple[ab.Obstacle, ...] = OBSTACLES) -> ab.Plan:
    """Half a second along x, past obstacles and through a gate in a wall."""
    trajectory = ab.Trajectory([0.5], [[[0.0, 0.0, 1.0], [2.0, 0.0, 0.0]]])
    ends = ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((2.0, 0.0, 1.0))
    gate = ab.Gate((1.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), wall=ab.Wall())
    world = ab.Environment(ground=0.0, obstacles=obstacles)
    problem = ab.Problem("cruise", *ends, gates=(gate,), environment=world)
    return ab.Plan(problem, trajectory, "none", vehicle=ab.load_vehicle("agile-quad"))


@cache
def open_cruise() -> ab.Plan:
    """The same where nothing stands in the way but the gate."""
    walled = walled_cruise().problem
    gate = ab.Gate((1.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    problem = ab.Problem("cruise", walled.start, walled.goal, gates=(gate,))
    return ab.Plan(problem, walled_cruise().trajectory, "none", vehicle=ab.load_vehicle("agile-quad"))
