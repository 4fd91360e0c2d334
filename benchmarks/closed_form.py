"""Minimum snap on N segments of given durations: against minsnap-trajectories (PyPI), and how it grows.

    uv run python benchmarks/closed_form.py [--runs N] [--long]

Both solve the same problem in turn, from rest to rest with random positions and durations of 0.5 to 2 s, to
the same cost. With --long the peer also takes N = 300, about 10 s a run.
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable
from functools import partial

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import minsnap_trajectories as peer
import numpy as np

from aerobat.trajectory import Trajectory, minimum_effort

SNAP = 4
DERIVATIVES = ("position", "velocity", "acceleration", "jerk")
GROWTH = (1_000, 10_000)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=9, help="runs of each (9)")
    parser.add_argument("--long", action="store_true", help="N = 300 for the peer, too")
    options = parser.parse_args()
    print(f"{'N':>6}{'aerobat':>12}{'minsnap-trajectories':>24}{'ratio':>8}{'cost differs by':>18}")
    for segments in (10, 100, 300) if options.long else (10, 100):
        print(comparison(segments, options.runs), flush=True)
    for order, name in ((4, "snap"), (5, "crackle")):
        times = medians([partial(minimum_effort, *course(n, order)) for n in GROWTH], options.runs)
        exponent = np.log(times[1] / times[0]) / np.log(GROWTH[1] / GROWTH[0])
        shown = " and ".join(f"{1e3 * seconds:.1f} ms" for seconds in times)
        print(f"minimum {name}: {shown} for N = {GROWTH[0]} and {GROWTH[1]}, time ~ N^{exponent:.2f}")
    print(f"medians of {options.runs} runs")


def comparison(segments: int, runs: int) -> str:
    given, durations = course(segments, SNAP)
    ours = minimum_effort(given, durations).effort(SNAP)
    theirs = peer_trajectory(solved_by_peer(given, durations)).effort(SNAP)
    fast, slow = medians(
        [partial(solve, given, durations) for solve in (minimum_effort, solved_by_peer)], runs
    )
    return f"{segments:6}{1e3 * fast:9.2f} ms{1e3 * slow:21.2f} ms{slow / fast:8.0f}{theirs / ours - 1:18.1e}"


def course(segments: int, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Random positions from rest to rest (N + 1, order, 3), NaN where free, and durations [s] (N,)."""
    rng = np.random.default_rng(segments)
    given = np.full((segments + 1, order, 3), np.nan)
    given[:, 0] = rng.uniform(-5.0, 5.0, (segments + 1, 3))
    given[[0, -1], 1:] = 0.0
    return given, rng.uniform(0.5, 2.0, segments)


def solved_by_peer(given: np.ndarray, durations: np.ndarray) -> peer.PiecewisePolynomialTrajectory:
    waypoints = [
        peer.Waypoint(at, **{name: v for name, v in zip(DERIVATIVES, values, strict=True) if v[0] == v[0]})
        for at, values in zip(np.append(0.0, np.cumsum(durations)), given, strict=True)
    ]
    return peer.generate_trajectory(
        waypoints, degree=2 * SNAP - 1, idx_minimized_orders=SNAP, num_continuous_orders=SNAP
    )


def peer_trajectory(found: peer.PiecewisePolynomialTrajectory) -> Trajectory:
    powers = found.durations[:, None] ** np.arange(2 * SNAP)
    return Trajectory(found.durations, found.coefficients * powers[..., None])


def medians(solves: list[Callable[[], object]], runs: int) -> list[float]:
    """The median time of each [s], run in turn."""
    seconds: list[list[float]] = [[] for _ in solves]
    for _ in range(runs):
        for taken, solve in zip(seconds, solves, strict=True):
            began = time.perf_counter()
            solve()
            taken.append(time.perf_counter() - began)
    return [statistics.median(taken) for taken in seconds]


if __name__ == "__main__":
    main()
