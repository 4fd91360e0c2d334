"""Programs of corridors, as FASTER and SANDO pose them, by the built-in search and by Gurobi in the same run.

    uv run python benchmarks/corridors.py [--count 20] [--seed 0]

Nine metres from rest to rest through a row of three to five polytopes of ten to twenty faces, which overlap.
N = 4, 5 or 6 intervals of constant jerk, each wholly in one polytope by its Bézier control points; velocity
within 1 m/s, acceleration within 2 m/s², jerk within 3 m/s³ per axis. The squared jerk is minimized in a
given time. The built-in solver's time is all of it, nothing kept from the run before; Gurobi's is the Runtime
that it reports, without building its model. One thread each, medians over the programs that have a solution.
"""

import argparse
import os
import statistics
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

from aerobat.arrays import Array
from aerobat.optimization import AssignmentProgram, SlottedStage, solver

LENGTH, LIMITS = 9.0, (1.0, 2.0, 3.0)  # [m]; of velocity, acceleration and jerk
SLOWNESS = 2.5  # times the time that the way takes at the limit of velocity
BEND = 0.7  # [rad] from one polytope's direction to the next, at most about that
ROOM = (0.7, 1.5)  # [m] from the middle line to a face
ROWS = 1500  # of faces and points: as many as Gurobi takes without a licence
JERK, ACCELERATION, VELOCITY, POSITION = range(4)
SAME = 1e-5  # of the cost


def corridor(rng: np.random.Generator, count: int, most: int) -> tuple[Array, list[tuple[Array, Array]]]:
    """A broken line's corners (count + 1, 3), and a polytope n·x ≤ d around each part of it.

    A polytope has `most` faces at most, and reaches to the middle of the neighbouring parts.
    """
    direction, corners = np.array([1.0, 0.0, 0.0]), [np.zeros(3)]
    for _ in range(count):
        corners.append(corners[-1] + direction * LENGTH / count)
        direction = direction + BEND * rng.normal(size=3) / np.sqrt(3.0)
        direction /= np.linalg.norm(direction)
    polytopes = []
    middles = np.diff(corners, axis=0) / 2.0 + corners[:-1]
    for k in range(count):
        around = [middles[max(k - 1, 0)], corners[k], corners[k + 1], middles[min(k + 1, count - 1)]]
        normals = rng.normal(size=(rng.integers(10, most + 1), 3))
        normals[:6] = np.concatenate([np.eye(3), -np.eye(3)])  # it has an end on every side
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        farthest = (normals @ np.transpose(around)).max(axis=1)
        polytopes.append((normals, farthest + rng.uniform(*ROOM, len(normals))))
    return np.array(corners), polytopes


def control_points(intervals: int, step: float) -> list[Array]:
    """By derivative, jerk first: control points as rows · jerks, each (intervals, k, intervals)."""
    jerks = np.eye(intervals)
    knots = np.zeros((3, intervals + 1, intervals))  # position, velocity, acceleration
    for i, jerk in enumerate(jerks):
        p, v, a = knots[:, i]
        knots[0, i + 1] = p + step * v + step**2 / 2 * a + step**3 / 6 * jerk
        knots[1, i + 1] = v + step * a + step**2 / 2 * jerk
        knots[2, i + 1] = a + step * jerk
    p, v, a = knots
    b, e = slice(None, -1), slice(1, None)
    velocity = np.stack([v[b], v[b] + step / 2 * a[b], v[e]], axis=1)
    position = np.stack([p[b], p[b] + step / 3 * v[b], p[e] - step / 3 * v[e], p[e]], axis=1)
    return [jerks[:, None], np.stack([a[b], a[e]], axis=1), velocity, position]


def program(rng: np.random.Generator, intervals: int) -> AssignmentProgram:
    """One program: x has the jerks of all intervals; each is a stage, each polytope a slot of it."""
    count = int(rng.integers(3, 6))
    corners, polytopes = corridor(rng, count, min(20, ROWS // (4 * intervals * count)))
    points = control_points(intervals, SLOWNESS * LENGTH / LIMITS[0] / intervals)
    axes = np.eye(3)
    ends = [points[k][-1, -1] for k in (POSITION, VELOCITY, ACCELERATION)]
    equality = np.concatenate([np.kron(end, axes) for end in ends])
    target = np.concatenate([corners[-1], np.zeros(6)])
    bounded = [points[k].reshape(-1, intervals) for k in (VELOCITY, ACCELERATION, JERK)]
    rows = [np.kron(each, axes) for each in bounded]
    bounds = np.concatenate([np.full(len(part), limit) for part, limit in zip(rows, LIMITS, strict=True)])
    faces = max(len(normals) for normals, _ in polytopes)
    stages, first = [], len(bounds)
    for i, of_interval in enumerate(points[POSITION]):
        at, upper = [], []
        for normals, offsets in polytopes:
            again = np.arange(faces) % len(normals)  # as many rows for each: some faces twice
            rows.append((of_interval[:, None, :, None] * normals[again][:, None]).reshape(-1, 3 * intervals))
            at.append(first + np.arange(len(rows[-1])))
            upper.append(np.tile(offsets[again], 4))
            first += len(rows[-1])
        slots = tuple(i * len(polytopes) + k for k in range(len(polytopes)))
        stages.append(SlottedStage(f"interval {i}", slots, np.array(at), np.array(-np.inf), np.array(upper)))
    free = np.full(first - len(bounds), np.inf)
    upper_bounds = np.concatenate([bounds, free])
    return AssignmentProgram(
        equality, target, np.concatenate(rows), np.concatenate([-bounds, -free]), upper_bounds, tuple(stages)
    )


def main() -> None:
    """Print a line a number of intervals."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=20, help="programs of each number of intervals (20)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for intervals in (4, 5, 6):
        rng, times, infeasible = np.random.default_rng([options.seed, intervals]), [], 0
        for k in range(options.count):
            asked = program(rng, intervals)
            began = time.perf_counter()
            ours = solver().solve(asked)
            seconds = time.perf_counter() - began
            theirs = solver("gurobi").solve(asked)
            if theirs.status == ours.status == "infeasible":
                infeasible += 1
                continue
            if not abs(ours.cost - theirs.cost) <= SAME * theirs.cost:
                print(f"case {k}: {ours.status} {ours.cost:.6g}, Gurobi {theirs.status} {theirs.cost:.6g}")
            times.append((1e3 * seconds, 1e3 * theirs.time))
        ours, theirs = (statistics.median(each) for each in zip(*times, strict=True))
        most = max(seconds for seconds, _ in times)
        print(
            f"N = {intervals}: {len(times)} solved, {infeasible} without a solution; built-in {ours:.1f} ms "
            f"(at most {most:.1f}), Gurobi {theirs:.1f} ms: {theirs / ours:.1f} times as long"
        )


if __name__ == "__main__":
    main()
