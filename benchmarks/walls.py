"""Random worlds with walls, planned by the planner that is taken where none is named.

    uv run python benchmarks/walls.py [--count 20] [--more] [--families forest slit ...]

Case k of a family is always the same. Forests: 20 cylinders or boxes in 10 x 10 x 4 m, 10 m from rest to
rest. Slits: a wall with one opening 1.3 times as high as the body is thick, tilted by any angle, 8 m.
Windows: three rooms, one window from each to the next, 9 m. Woods: 45 trunks of 1 to 1.5 m in 100 x 30 m,
100 m at 10 m/s an axis. The easy forest and the knots are scenes that others published
(published_scenes.py), 105 m at 5 m/s an axis. The vehicle is agile-quad, with the
reserve and the clearance of plans that are flown. Bodies are sampled at 2000 instants a second against exact
distances.
With `--more`, the duration is compared with the best of ten times as many routes. Times are of the processor,
on one core.
"""

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import replace

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

import aerobat as ab
from aerobat.planning import Plan
from aerobat.planning.around.fastest import fastest_around
from aerobat.planning.planners import planner_for
from aerobat.planning.recorder import Recorder
from aerobat.planning.refinement.refine import SEGMENTS, Refinement
from aerobat.planning.result import FLYING_CLEARANCE, FLYING_RESERVE
from aerobat.planning.task import Task
from published_scenes import easy_forest, knots

VEHICLE = "agile-quad"
TREES, TREE_GAP = 20, 0.1  # [m] between trees, at least
SLIT = 1.3  # times the body's thickness
RATE = 2000  # [Hz] at which bodies are sampled
MORE = 10  # times as many routes


def forest(k: int) -> ab.Problem:
    """Case `k`: trees from floor to ceiling, round ones, square ones in the odd cases."""
    rng = np.random.default_rng([34, k])
    trees: list[tuple[np.ndarray, float]] = []
    while len(trees) < TREES:
        foot, radius = np.append(rng.uniform([1.0, -5.0], [9.0, 5.0]), 0.0), rng.uniform(0.2, 0.6)
        if all(np.hypot(*(foot - other)[:2]) > radius + r + TREE_GAP for other, r in trees):
            trees.append((foot, radius))
    if k % 2:
        sides = [np.array([np.sqrt(2.0) * radius, np.sqrt(2.0) * radius, 4.0]) for _, radius in trees]
        obstacles = tuple(
            ab.Box(position=[*foot[:2], 2.0], size=side, heading=rng.uniform(0, np.pi), name=f"tree {i}")
            for i, ((foot, _), side) in enumerate(zip(trees, sides, strict=True))
        )
    else:
        obstacles = tuple(
            ab.Cylinder(start=foot, end=[*foot[:2], 4.0], radius=radius, name=f"tree {i}")
            for i, (foot, radius) in enumerate(trees)
        )
    room = ab.Limits(lower=np.array([-2.0, -5.0, 0.2]), upper=np.array([12.0, 5.0, 3.8]))
    ends = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest((10.0, 0.0, 1.5))
    return ab.Problem(f"forest-{k}", *ends, limits=room, environment=ab.Environment(obstacles=obstacles))


def slit(k: int) -> ab.Problem:
    """Case `k`: a wall with a slit that only a body on its side passes, or one that lies flat in it."""
    rng = np.random.default_rng([35, k])
    height = SLIT * 2.0 * ab.load_vehicle(VEHICLE).bounding_ellipsoid.semi_axes[2]
    tilt = rng.uniform(-np.pi / 2, np.pi / 2)
    place = (rng.uniform(3, 5), rng.uniform(-1, 1), rng.uniform(1.2, 2.5))
    gate = ab.tilted_gate(place, rng.uniform(-0.4, 0.4), 0.0, tilt, rng.uniform(0.6, 0.9), height)
    goal = (8.0, rng.uniform(-1, 1), rng.uniform(1, 2.5))
    room = ab.Limits(lower=np.array([-2.0, -4.0, 0.2]), upper=np.array([10.0, 4.0, 4.0]))
    ends = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest(goal)
    return ab.Problem(f"slit-{k}", *ends, gates=(replace(gate, wall=ab.Wall(border=4.0)),), limits=room)


def window(k: int) -> ab.Problem:
    """Case `k`: two walls across a hall, each with a window somewhere, no gate: the planner finds them."""
    rng = np.random.default_rng([36, k])
    obstacles: list[ab.Box] = []
    for number, x in enumerate((3.0, 6.0)):
        y, z = rng.uniform(-1.8, 1.8), rng.uniform(1.0, 2.6)
        wide, high = rng.uniform(0.6, 1.2, 2)
        for low, high_end in (((-4.0, 0.0), (y - wide / 2, 4.0)), ((y + wide / 2, 0.0), (4.0, 4.0))):
            obstacles.append(_slab(x, low, high_end, f"wall {number}"))
        for low, high_end in (
            ((y - wide / 2, 0.0), (y + wide / 2, z - high / 2)),
            ((y - wide / 2, z + high / 2), (y + wide / 2, 4.0)),
        ):
            obstacles.append(_slab(x, low, high_end, f"wall {number}"))
    room = ab.Limits(lower=np.array([-1.0, -4.0, 0.2]), upper=np.array([10.0, 4.0, 3.8]))
    ends = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest((9.0, 0.0, 1.5))
    world = ab.Environment(obstacles=tuple(obstacles))
    return ab.Problem(f"window-{k}", *ends, limits=room, environment=world)


def wood(k: int) -> ab.Problem:
    """Case `k`: a long way between trunks that may touch one another."""
    rng = np.random.default_rng([37, k])
    feet = rng.uniform((4.0, -15.0, 1.0), (96.0, 15.0, 1.5), (45, 3)).tolist()
    trunks = tuple(
        ab.Cylinder(start=(x, y, 0.0), end=(x, y, 6.0), radius=radius, name=f"trunk {i}")
        for i, (x, y, radius) in enumerate(feet)
    )
    room = ab.Limits(lower=np.array([-5.0, -15.0, 0.5]), upper=np.array([105.0, 15.0, 5.5]), velocity=10.0)
    ends = ab.at_rest((0.0, 0.0, 2.0)), ab.at_rest((100.0, 0.0, 2.0))
    return ab.Problem(f"wood-{k}", *ends, limits=room, environment=ab.Environment(obstacles=trunks))


def _slab(x: float, low: tuple[float, float], high: tuple[float, float], name: str) -> ab.Box:
    """A part of a wall across x, 10 cm thick."""
    middle, size = np.add(low, high) / 2.0, np.subtract(high, low)
    return ab.Box(position=(x, *middle.tolist()), size=(0.1, *size.tolist()), name=name)


FAMILIES: dict[str, Callable[[int], ab.Problem]] = {
    "forest": forest,
    "slit": slit,
    "window": window,
    "wood": wood,
    "easy-forest": easy_forest,
    "knots": knots,
}


def least_gap(plan: Plan) -> float:
    """The least distance [m] of the body in its own attitude to any piece, sampled."""
    assert plan.vehicle is not None
    world = plan.problem.surroundings
    times = np.linspace(0.0, plan.duration, int(RATE * plan.duration))
    found = ab.reference(plan.trajectory, plan.vehicle, times, environment=world)
    offset, shapes = plan.vehicle.bounding_ellipsoid.turned(found.setpoint.q_world_body)
    centres = plan.trajectory.evaluate(times) + offset
    bodies, pieces = world.pieces.near(centres, plan.vehicle.body_radius, 0.5, times)
    gaps = world.pieces.separated(pieces, centres[bodies], shapes[bodies], times=times[bodies]).gaps
    return float(gaps.min(initial=np.inf))


def best_of_many(problem: ab.Problem, vehicle: ab.Vehicle) -> float:
    """The duration [s] of the best of many routes."""
    task = Task.of(problem, vehicle, FLYING_RESERVE, FLYING_CLEARANCE)
    refinement = Refinement.of(task, Recorder(None))
    around = fastest_around(refinement, SEGMENTS, MORE * 4)
    return np.inf if around is None else around.judged.solution.duration


def main() -> None:
    """Print a line a case and a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=list(FAMILIES))
    parser.add_argument("--more", action="store_true")
    arguments = parser.parse_args()
    vehicle = ab.load_vehicle(VEHICLE)
    planner_for(ab.load_problem("line"), vehicle).plan(ab.load_problem("line"), vehicle)  # imports paid
    for family in arguments.families:
        seconds, durations, gaps, ratios, certified, flying = [], [], [], [], 0, 0
        for k in range(arguments.count):
            problem = FAMILIES[family](k)
            began = time.process_time()
            try:
                plan = ab.plan(problem, vehicle=vehicle)
            except ab.Infeasible as refusal:
                print(
                    f"{problem.name}: refused in {time.process_time() - began:.1f} s: {refusal}", flush=True
                )
                continue
            seconds.append(time.process_time() - began)
            durations.append(plan.duration)
            gaps.append(least_gap(plan))
            certified += plan.certified
            flying += plan.flies
            ratios.append(plan.duration / best_of_many(problem, vehicle) if arguments.more else np.nan)
            print(
                f"{problem.name}: {plan.planner} {plan.duration:.3f} s, certified {plan.certified}, flies "
                f"{plan.flies}, {100 * gaps[-1]:.2f} cm clear, {seconds[-1]:.1f} s, over the best of many "
                f"{ratios[-1]:.3f}",
                flush=True,
            )
        print(
            f"{family}: {len(seconds)} of {arguments.count} planned, {certified} certified, {flying} fly; "
            f"{np.median(seconds):.2f} s of the processor, {max(seconds):.1f} at most; "
            f"{np.median(durations):.2f} s long; {100 * min(gaps):.2f} cm clear at least; "
            f"over the best of many {np.median(ratios):.3f}, {np.max(ratios):.3f} at most"
        )


if __name__ == "__main__":
    main()
