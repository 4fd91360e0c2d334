"""The polynomials that come nearest to a motion, with knots at its stages: where free knots begin on courses.

A motion of the rigid body at its limits turns sharply here and flies straight there. Each leg gets as many
polynomials as its acceleration needs: too few of them cannot turn the body as fast as it can, and a program
that holds its limits at samples then cheats between them, until there are so many samples that only a slow
path is left.
"""

from __future__ import annotations

from dataclasses import replace
from math import factorial

import numpy as np

from aerobat.arrays import Array
from aerobat.planning.polynomial.descent.path_limits import END_ORDER, ORDERS, TO_COEFFICIENTS, powers
from aerobat.planning.warm_start import WarmStart
from aerobat.trajectory import Trajectory

MET = 3  # derivatives of position that are met, itself the first: they decide where the thrust points
PLACES = 25  # in a segment at which they are: some twice its unknowns
DENSER = 2  # times as many, at which the deviation is looked for


def nearest_polynomials(motion: WarmStart, max_deviation: float, max_segments: int) -> WarmStart:
    """The motion in few polynomials of degree 9 a leg, continuous up to snap, its ends and phases kept.

    Legs are cut into equal parts, again and again the one whose acceleration deviates most.

    Args:
        motion: What is met, by least squares.
        max_deviation: Of the acceleration [m/s²]; legs that keep to it are cut no more.
        max_segments: In all; every leg has one at least.
    """
    parts = np.ones(len(motion.phases), dtype=int)
    while True:
        path = _fitted(motion.trajectory, np.repeat(motion.phases / parts, parts))
        deviations = _deviations(path, motion)
        worst = int(np.argmax(deviations))
        if deviations[worst] <= max_deviation or parts.sum() >= max_segments:
            return replace(motion, trajectory=path)
        parts[worst] += 1


def _fitted(motion: Trajectory, durations: Array) -> Trajectory:
    """Polynomials of these durations, least squares from a motion's first derivatives, its ends met."""
    effects, wanted = _rows(motion, durations)
    at_ends = np.zeros((len(durations) + 1, END_ORDER), dtype=bool)
    at_ends[[0, -1], :MET] = True
    values = np.zeros((*at_ends.shape, 3))
    values[[0, -1], :MET] = np.stack([motion.evaluate([0.0, motion.duration], k) for k in range(MET)], axis=1)
    sizes = np.broadcast_to(durations.mean() ** -np.arange(END_ORDER, dtype=float), at_ends.shape)[~at_ends]
    left = wanted - effects[:, at_ends] @ values[at_ends]
    values[~at_ends] = sizes[:, None] * np.linalg.lstsq(effects[:, ~at_ends] * sizes, left, rcond=None)[0]
    of_segments = np.concatenate([values[:-1], values[1:]], axis=1)
    by_part = durations[:, None, None] ** ORDERS[:, None]
    return Trajectory(durations, TO_COEFFICIENTS @ (by_part * of_segments), motion.heading)


def _rows(motion: Trajectory, durations: Array) -> tuple[Array, Array]:
    """Effects of all knots' derivatives on what is met, (rows, knots, 5), and the motion's own, (rows, 3)."""
    s = np.linspace(0.0, 1.0, PLACES)
    starts = np.cumsum(durations) - durations
    effects = np.zeros((len(durations), MET, PLACES, len(durations) + 1, END_ORDER))
    wanted = np.zeros((len(durations), MET, PLACES, 3))
    for i, duration in enumerate(durations.tolist()):
        times = np.minimum(starts[i] + duration * s, motion.duration)
        for k in range(MET):
            size = durations.mean() ** k / factorial(k)
            effect = powers(s, k) @ TO_COEFFICIENTS * duration ** (ORDERS - float(k))
            effects[i, k, :, i : i + 2] = size * effect.reshape(PLACES, 2, END_ORDER)
            wanted[i, k] = size * motion.evaluate(times, k)
    return effects.reshape(-1, *effects.shape[-2:]), wanted.reshape(-1, 3)


def _deviations(path: Trajectory, motion: WarmStart) -> Array:
    """How far the acceleration of each leg is from the motion's, at most [m/s²], (P,)."""
    ends = np.cumsum(motion.phases)
    inside = np.linspace(0.0, 1.0, DENSER * PLACES, endpoint=False)
    times = (ends - motion.phases)[:, None] + motion.phases[:, None] * inside
    times = np.minimum(times, motion.trajectory.duration)
    apart = path.evaluate(times, MET - 1) - motion.trajectory.evaluate(times, MET - 1)
    return np.asarray(np.linalg.norm(apart, axis=-1).max(axis=-1))
