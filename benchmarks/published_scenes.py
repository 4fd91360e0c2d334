"""Scenes that others have published, as problems: the easy forest of SANDO, and boxes that move on knots.

Both are of github.com/mit-acl/sando (Kondo, Tordesillas, How: SANDO, 2026). The forest is its
worlds/easy_forest.world, 41 trunks 6 m high. The boxes are drawn as its launch/dyn_obstacles.launch.py draws
them, 65 % of them cubes on trefoil knots as in MADER, the others pillars and bars that rest. The room, and
5 m/s, 20 m/s² and 100 m/s³ an axis, are those of its config/sando.yaml. There a planner sees the scene as it
flies, and plans anew several times a second; here the scene is known, and planned at once.
"""

from __future__ import annotations

import numpy as np

import aerobat as ab

# x, y and radius of each trunk [m]
EASY_FOREST = (
    (45.2762, -8.97843, 1.37898), (80.6973, -7.39447, 1.20247), (92.757, 0.175366, 1.29169),
    (64.5107, -9.29219, 1.3779), (83.0964, 14.8871, 1.49139), (91.7951, 6.85711, 1.36492),
    (46.5555, 4.20254, 1.05035), (50.7692, 13.5287, 1.4833), (57.7333, -18.0752, 1.40251),
    (84.7053, 6.32276, 1.19941), (88.8436, -9.60499, 1.24679), (22.9935, 2.50664, 1.43524),
    (82.4183, -1.92681, 1.48377), (14.8128, 1.93175, 1.16003), (98.2023, 3.86457, 1.27372),
    (62.3933, -4.32254, 1.22249), (22.6505, -11.8133, 1.14516), (50.7154, -15.3173, 1.32833),
    (94.1201, 12.7132, 1.43839), (56.9413, -4.03041, 1.46154), (101.496, 15.7288, 1.13782),
    (64.0435, -0.514004, 1.04119), (28.0346, 8.60096, 1.42254), (83.8898, -15.0889, 1.11023),
    (8.75022, 2.75537, 1.34884), (70.6013, -17.7327, 1.2671), (40.3525, 17.9683, 1.30317),
    (98.1711, -11.9642, 1.01082), (6.33318, -2.81082, 1.10529), (38.3677, -12.0648, 1.12996),
    (13.906, 18.5337, 1.01969), (75.6136, 12.7351, 1.17928), (69.8895, 17.6498, 1.08471),
    (86.618, -5.88549, 1.3381), (50.2362, -3.36983, 1.2984), (34.6176, -5.35558, 1.2543),
    (76.6137, -6.194, 1.12547), (27.6058, 17.0916, 1.14044), (66.0688, 4.56607, 1.14394),
    (4.34279, -11.5728, 1.19401), (66.4322, -4.58232, 1.11971),
)  # fmt: skip
SPEED, ACCELERATION, JERK = 5.0, 20.0, 100.0  # an axis
LOW, HIGH = (-5.0, -10.0, 0.5), (110.0, 10.0, 5.0)  # [m] of the room
START, GOAL = (0.0, 0.0, 2.0), (105.0, 0.0, 2.0)  # [m]
BOXES, MOVING, UPRIGHT = 50, 0.65, 0.35  # how many, how many of them move, how many of the others are pillars
CUBE, PILLAR, BAR = (0.8, 0.8, 0.8), (0.4, 0.4, 4.0), (0.4, 4.0, 0.4)  # [m]
ROWS = np.arange(0.0, 40.0, 0.4)  # [s] between which boxes move straight


def easy_forest(_: int) -> ab.Problem:
    """The easy forest, which is the same in all cases."""
    trunks = tuple(
        ab.Cylinder(start=(x, y, 0.0), end=(x, y, 6.0), radius=radius, name=f"trunk {i}")
        for i, (x, y, radius) in enumerate(EASY_FOREST)
    )
    return _across("easy-forest", trunks)


def knots(k: int) -> ab.Problem:
    """Case `k` of cubes that move on knots of 2 to 4 m at up to 1.5 m/s, between pillars and bars."""
    rng = np.random.default_rng([38, k])
    moving = round(MOVING * BOXES)
    upright = round(UPRIGHT * (BOXES - moving))
    places = rng.uniform((5.0, -6.0, 0.5), (100.0, 6.0, 4.5), (BOXES, 3))
    boxes = [_on_a_knot(rng, place, f"cube {i}") for i, place in enumerate(places[:moving])]
    for i, place in enumerate(places[moving:]):
        foot = (place[0], place[1], PILLAR[2] / 2.0)
        boxes.append(
            ab.Box(foot, PILLAR, name=f"pillar {i}") if i < upright else ab.Box(place, BAR, name=f"bar {i}")
        )
    return _across(f"knots-{k}", tuple(boxes))


def _on_a_knot(rng: np.random.Generator, centre: np.ndarray, name: str) -> ab.Box:
    """A cube on a trefoil knot about its centre, which it goes through in 25 to 38 s."""
    scale, phase, slower = rng.uniform(2.0, 4.0, 3), rng.uniform(0.0, 3.0), rng.uniform(4.0, 6.0)
    turn = ROWS / slower + phase
    knot = np.stack(
        [
            (np.sin(turn) + 2.0 * np.sin(2.0 * turn)) / 6.0,
            (np.cos(turn) - 2.0 * np.cos(2.0 * turn)) / 5.0,
            -np.sin(3.0 * turn) / 2.0,
        ],
        axis=-1,
    )
    places = centre + scale * knot
    return ab.Box(places[0], CUBE, path=np.column_stack([ROWS, places]), name=name)


def _across(name: str, obstacles: tuple[ab.Obstacle, ...]) -> ab.Problem:
    room = ab.Limits(
        lower=np.array(LOW), upper=np.array(HIGH), velocity=SPEED, acceleration=ACCELERATION, jerk=JERK
    )
    ends = ab.at_rest(START), ab.at_rest(GOAL)
    return ab.Problem(name, *ends, limits=room, environment=ab.Environment(obstacles=obstacles))
