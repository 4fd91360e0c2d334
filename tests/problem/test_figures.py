"""Figures: turned, moved, mirrored and scaled they stay what they are, and vehicles fly them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.errors import SpecError
from aerobat.problem import Figure, Quantity, Stage
from aerobat.problem.condition import MIN_ATTITUDE_THRUST

PLACE = (1.0, 2.0, 3.0)
FIGURES = (
    ab.PowerLoop(PLACE),
    ab.SplitS(PLACE),
    ab.Immelmann(PLACE),
    ab.MattyFlip(PLACE),
    ab.BarrelRoll(PLACE, count=2),
    ab.Corkscrew(PLACE),
    ab.KnifeEdgePass(PLACE),
    ab.InvertedPass(PLACE),
)
SEARCHED = ("barrel-roll", "power-loop", "immelmann", "split-s", "matty-flip", "corkscrew")
PRESETS = tuple(
    pytest.param(figure.kind, marks=pytest.mark.slow) if figure.kind in SEARCHED else figure.kind
    for figure in FIGURES
)
figures = st.sampled_from(FIGURES)
headings = st.floats(-np.pi, np.pi)
Asked = list[tuple[str, Quantity, np.ndarray, float, float]]


def asked(figure: ab.Maneuver, gates: tuple[ab.Gate, ...] = ()) -> Asked:
    """All that the stages of a figure ask, positions from its place."""
    found = []
    for stage in figure.stage_sequence(gates, 30.0).stages:
        for condition in stage.conditions:
            shift = condition.direction @ PLACE if condition.quantity is Quantity.POSITION else 0.0
            lower, upper = condition.lower - shift, condition.upper - shift
            found.append((stage.name, condition.quantity, condition.direction, lower, upper))
        up = stage.attitude.up
        found.append((stage.name, Quantity.SPECIFIC_THRUST, up, stage.attitude.min_thrust, np.inf))
    return found


def same(a: Asked, b: Asked, transform: np.ndarray, scale: float = 1.0) -> bool:
    """True if `b` asks what `a` does, transformed."""
    for (name, quantity, direction, *bounds), (*other, transformed, low, high) in zip(a, b, strict=True):
        factor = scale if quantity is Quantity.POSITION else 1.0
        if other != [name, quantity] or not np.allclose(transform @ direction, transformed, atol=1e-12):
            return False
        if not np.allclose(factor * np.array(bounds), [low, high], atol=1e-9):
            return False
    return True


@given(figures, headings)
def test_a_figure_of_another_heading_is_the_figure_turned(figure: Figure, heading: float) -> None:
    turn = so3.axes(so3.about_axis(np.array([0.0, 0.0, 1.0]), np.asarray(heading)))
    assert same(asked(figure), asked(replace(figure, heading=heading)), turn)


@given(figures, headings)
def test_a_mirrored_figure_is_its_mirror_image(figure: Figure, heading: float) -> None:
    figure = replace(figure, heading=heading)
    left = np.array([-np.sin(heading), np.cos(heading), 0.0])
    assert same(asked(figure), asked(replace(figure, mirrored=True)), np.eye(3) - 2.0 * np.outer(left, left))


@given(st.sampled_from(FIGURES[:4]), st.floats(0.5, 5.0))
def test_a_figure_of_twice_the_radius_is_twice_as_large(figure: Figure, radius: float) -> None:
    smaller, larger = (replace(figure, radius=size) for size in (radius, 2.0 * radius))
    assert same(asked(smaller), asked(larger), np.eye(3), 2.0)


@given(st.sampled_from(FIGURES[:4]), st.floats(2.0, 10.0))
def test_a_loop_without_a_radius_grows_with_the_square_of_its_speed(figure: Figure, speed: float) -> None:
    """4.5 m/s make 1.5 m, as in Deep Drone Acrobatics."""
    by_speed = replace(figure, speed=speed)
    by_radius = replace(by_speed, radius=1.5 * (speed / 4.5) ** 2)
    assert same(asked(by_speed), asked(by_radius), np.eye(3))


@pytest.mark.parametrize(
    ("figure", "turned_deg", "climbed", "ahead"),
    [
        (ab.PowerLoop(PLACE), 360, 0.0, 1),
        (ab.SplitS(PLACE), 180, -3.0, -1),
        (ab.Immelmann(PLACE), 180, 3.0, -1),
        (ab.MattyFlip(PLACE), 360, 0.0, 1),
        (ab.Corkscrew(PLACE), 720, 0.0, 1),
    ],
)
def test_a_figure_turns_climbs_and_leaves_as_it_is_defined(figure, turned_deg, climbed, ahead) -> None:
    """The thrust's turn within its loop or helix, height between its first and last point, way out."""
    stages = [s for s in figure.stage_sequence((), 30.0).stages if heights(s)]
    ups = [stage.attitude.up for stage in stages]
    angles = [np.arccos(np.clip(a @ b, -1.0, 1.0)) for a, b in pairwise(ups)]
    assert np.rad2deg(sum(angles)) == pytest.approx(turned_deg)
    assert np.mean(heights(stages[-1])) - np.mean(heights(stages[0])) == pytest.approx(climbed)
    (leaving,) = (c for c in stages[-1].conditions if c.quantity is Quantity.VELOCITY)
    assert leaving.direction[0] == pytest.approx(ahead)


def heights(stage: Stage) -> tuple[float, ...]:
    """The bounds on the height [m]."""
    found = [c for c in stage.conditions if c.quantity is Quantity.POSITION and c.direction[2] == 1.0]
    return tuple(x for c in found for x in (c.lower, c.upper))


@given(st.integers(1, 4), st.booleans())
def test_rolls_and_flips_turn_once_for_every_count(count: int, mirrored: bool) -> None:
    """About one axis, in one direction."""
    for figure in (
        ab.BarrelRoll(PLACE, count=count, mirrored=mirrored),
        ab.Flip(count=count, mirrored=mirrored),
    ):
        ups = [np.array([0.0, 0.0, 1.0]), *map(thrust_direction, figure.stage_sequence((), 30.0).stages)]
        ups.append(np.array([0.0, 0.0, 1.0]))
        turns = [np.arctan2(np.cross(a, b)[0], a @ b) for a, b in pairwise(ups)]
        assert sum(turns) == pytest.approx(2.0 * np.pi * count * (-1.0 if mirrored else 1.0))
        assert np.abs(turns).max() <= np.pi / 2 + 1e-9


def thrust_direction(stage: Stage) -> np.ndarray:
    """Where the thrust points in a stage."""
    if stage.attitude is not None:
        return stage.attitude.up
    (along,) = (c.direction for c in stage.conditions if c.lower > 0.0)
    return along


@given(figures, headings)
def test_a_figure_of_a_gate_passes_it_on_entry_in_its_direction(figure: Figure, heading: float) -> None:
    gate = ab.tilted_gate(PLACE, heading, name="red")
    by_gate = replace(figure, position=None, gate="red")
    entry = [s for s in by_gate.stage_sequence((gate,), 30.0).stages if s.gate == "red"]
    assert len(entry) == 1
    others = [
        each for each in asked(replace(figure, heading=heading)) if each[0] not in names_of_entry(figure)
    ]
    found = [each for each in asked(by_gate, (gate,)) if each[0] not in ("red", *names_of_entry(figure))]
    assert same(others, found, np.eye(3))


def names_of_entry(figure: Figure) -> tuple[str, ...]:
    """The name of its stage at the place."""
    return tuple(
        stage.name
        for stage in figure.stage_sequence((), 30.0).stages
        if holds_at_place(c for c in stage.conditions if c.quantity is Quantity.POSITION)
    )


def holds_at_place(conditions) -> bool:
    """True if there are conditions, and all hold at the place."""
    at = [c.lower <= c.direction @ PLACE <= c.upper for c in conditions]
    return bool(at) and all(at)


def test_a_figure_in_a_gate_that_is_passed_straight_up_is_refused() -> None:
    gate = ab.tilted_gate(PLACE, elevation=np.pi / 2, name="chimney")
    with pytest.raises(SpecError, match="gate 'chimney' is passed straight up or down, without a heading"):
        ab.PowerLoop(gate="chimney").stage_sequence((gate,), 30.0)


@pytest.mark.parametrize("name", PRESETS)
def test_every_figure_flies_on_the_agile_quadrotor(name: str) -> None:
    """Certified, in its own flight too, and within a second or two of planning."""
    plan = ab.plan(name, vehicle="agile-quad")
    assert plan.certified
    assert plan.flies


@pytest.mark.slow
def test_a_vehicle_too_weak_for_a_figure_is_told_what_it_lacks() -> None:
    heavy = replace(ab.load_vehicle("agile-quad"), name="heavy", mass=2.75)
    lacks = r"that heavy can fly: at best, the (thrust|command) of rotor \d is beyond its limit by"
    with pytest.raises(ab.Infeasible, match=lacks):
        ab.plan("inverted-pass", ab.Miqp(rescue=False), heavy)


@given(
    thrust=st.floats(12.0, 80.0), name=st.sampled_from(["split-s", "immelmann", "barrel-roll", "corkscrew"])
)
def test_strong_vehicles_keep_attitudes_of_figures_firmly_and_weak_ones_as_they_can(
    thrust: float, name: str
) -> None:
    figure = ab.load_problem(name).maneuver
    asked = {
        stage.attitude.min_thrust for stage in figure.stage_sequence((), thrust).stages if stage.attitude
    }
    assert asked == {MIN_ATTITUDE_THRUST if thrust - 9.81 >= MIN_ATTITUDE_THRUST else 0.2 * thrust}
    firm = figure.with_stage_thrust((), 11.0)
    assert {s.attitude.min_thrust for s in firm.stage_sequence((), thrust).stages if s.attitude} == {11.0}


@pytest.mark.parametrize(("tilt_deg", "asked"), [(90.0, 19.125), (45.0, 13.523), (30.0, 9.81), (0.0, 9.81)])
def test_a_half_flip_asks_for_thrust_by_its_gates_tilt_and_for_a_hovers(
    tilt_deg: float, asked: float
) -> None:
    problem = ab.load_problem("half-flip")
    gates = problem.maneuver.with_gate_tilt(problem.gates, np.deg2rad(tilt_deg))
    (stage,) = problem.maneuver.stage_sequence(gates, 40.0).stages
    assert max(c.min_thrust for c in stage.explicit(gates[0]).conditions) == pytest.approx(asked, rel=1e-4)
