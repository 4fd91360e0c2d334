"""The whole body through gates: clear of each frame for as long as it stays about the opening.

As flights are judged, a frame is the gate's plane around its opening, without an end and as thin as nothing.
It counts while the body, or its centre within PASSAGE_DEPTH, is at that plane without a break, near enough to
touch the circle about the opening.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aerobat.arrays import Array
from aerobat.certification.body_path import BodyPath
from aerobat.certification.certificate import Finding
from aerobat.certification.clearance import clearance_finding
from aerobat.certification.envelope import PASSAGE_DEPTH, PlannedPassage
from aerobat.environment.obstacles import Pieces
from aerobat.problem import Gate


def frame_findings(
    attitude: BodyPath | None, ball: BodyPath, passages: Sequence[PlannedPassage]
) -> list[Finding]:
    """The findings about the body's least gap from the frame of each gate as it passes.

    Args:
        attitude: The body where its attitude is determined, if it is anywhere.
        ball: The ball around the body, on the rest of the path.
        passages: Where the path passes gates.
    """
    return [_clear(attitude, ball, passage) for passage in passages]


def _clear(attitude: BodyPath | None, ball: BodyPath, passage: PlannedPassage) -> Finding:
    """The finding about one passage."""
    gate, reach = passage.gate, ball.body.reach
    around = gate.opening.circumradius + reach
    paths = [path for path in (attitude, ball) if path is not None]
    away = np.sort(np.concatenate([_away(path, gate, around) for path in paths]))
    begin = away[away < passage.time].max(initial=0.0)
    end = away[away > passage.time].min(initial=ball.trajectory.duration)
    known = None if attitude is None else attitude.during(begin, end)
    found = clearance_finding(known, ball.during(begin, end), Pieces(gate.plane_around(around + reach)))
    return replace(found, gate=gate.name, obstacle=None, field="")


def _away(path: BodyPath, gate: Gate, around: float) -> Array:
    """Instants [s] at which the body on a path is not about a gate's opening, within `around` [m] of it."""
    times, centres, axes = path.sampled
    offset = centres - gate.places(times)
    height, along = offset @ gate.normal, axes @ gate.normal
    body = path.body
    touched = np.sqrt(body.wide**2 + (body.high**2 - body.wide**2) * along**2) + body.aside
    is_off = np.minimum(np.abs(height + body.up * along) - touched, np.abs(height) - PASSAGE_DEPTH) > 0.0
    return np.asarray(times[is_off | (np.linalg.norm(offset, axis=1) > around)])
