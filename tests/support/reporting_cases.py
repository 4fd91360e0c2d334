"""What tests of figures share: plans and flights, each made once, and what makes a page legible."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

import aerobat as ab
from aerobat.arrays import Array
from aerobat.reporting.page import house_style
from shared_plans import shared_plan

PROBLEMS = ("flip-roll", "flip-roll-translation", "flip-pitch", "half-flip", "line")


@lru_cache
def simulated(problem: str, vehicle: str = "agile-quad") -> ab.Flight:
    """A flight of that plan, at a rate that keeps tests short."""
    return ab.fly(shared_plan(problem, vehicle).trajectory, ab.load_vehicle(vehicle), rate=200.0)


@lru_cache
def two_flips() -> tuple[ab.Plan, ab.Flight]:
    """A plan through two gates, and its flight."""
    plan = ab.plan(
        ab.load_problem("examples/two-flips.toml"), ab.Miqp(order=4), ab.load_vehicle("agile-quad")
    )
    return plan, ab.fly(plan.trajectory, ab.load_vehicle("agile-quad"), rate=200.0)


def with_moving_gates(plan: ab.Plan) -> ab.Plan:
    """The plan as if its gates moved, and were where they are as they are passed."""
    velocity, times = np.array([0.5, 0.4, 0.3]), {stage.gate: stage.time for stage in plan.stages}
    gates = (
        replace(gate, position=gate.position - times[gate.name] * velocity, velocity=velocity)
        for gate in plan.problem.gates
    )
    return replace(plan, problem=replace(plan.problem, gates=tuple(gates)))


def drawn_gates(axes: Axes) -> list[Array]:
    """The corners of the frames that are drawn in a panel, (n, 2) each."""
    frames = (c for c in axes.collections if isinstance(c, PolyCollection) and c.get_zorder() == 1.5)
    return [np.concatenate([path.vertices for path in frame.get_paths()]) for frame in frames]


def require_legible(figure: Figure, monkeypatch: pytest.MonkeyPatch, fewest: int = 20) -> None:
    """No text of a page lies over another one or beyond the page."""
    texts = texts_of(figure, monkeypatch)
    assert len(texts) >= fewest
    for name, box in texts:
        assert box.min.min() >= 0, name
        assert (box.max <= figure.bbox.max).all(), name
    for (one, a), (other, b) in combinations(texts, 2):
        across, up = np.minimum(a.max, b.max) - np.maximum(a.min, b.min)
        assert across < 2 or up < 4, (one, other)  # pixels; boxes reach a little beyond their letters


def texts_of(figure: Figure, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, Bbox]]:
    """Every text that is really drawn, as in files, with its box in pixels."""
    drawn = []

    def draw_and_note(text, renderer):  # type: ignore[no-untyped-def]
        if text.get_visible() and text.get_text().strip():
            drawn.append((text.get_text(), text.get_window_extent(renderer)))
        draw_text(text, renderer)

    draw_text = matplotlib.text.Text.draw
    monkeypatch.setattr(matplotlib.text.Text, "draw", draw_and_note)
    with house_style():
        figure.canvas.draw()
    monkeypatch.undo()
    return drawn


def batch_of(problem, count):
    """As many flights as `count`, each of a vehicle a little heavier than the one before."""
    quad = ab.load_vehicle("agile-quad")
    heavier = [replace(quad, mass=(1.0 + 0.01 * k) * quad.mass) for k in range(count)]
    return ab.fly(shared_plan(problem).trajectory, heavier, rate=200.0)
