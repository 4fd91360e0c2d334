"""Bodies beside openings: what encloses a vehicle, which gates it fits, and the opening that flights need."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.declaration import from_table, to_table
from aerobat.errors import SpecError
from aerobat.planning.passages import require_openings
from aerobat.vehicle.ellipsoid import about_rotors
from gate_motions import Motion, cruise
from score_cases import QUAD
from suites import examples


@pytest.mark.parametrize("name", ab.vehicle_names())
def test_presets_fit_through_all_gates_that_come_with_aerobat(name: str) -> None:
    for problem in ab.problem_names():
        require_openings(ab.load_problem(problem), ab.load_vehicle(name))


@pytest.mark.parametrize("key", ["width", "height"])
def test_a_gate_too_small_in_the_attitude_asked_is_refused_before_planning_with_the_least_opening(
    key: str,
) -> None:
    """A hair larger than that it is accepted."""
    problem = ab.load_problem("half-flip")
    (gate,) = problem.gates
    least = 2 * dict(zip(("width", "height"), QUAD.bounding_ellipsoid.semi_axes[1:], strict=True))[key]
    with pytest.raises(SpecError, match=r"^gate 'gate' is .* agile-quad takes 42\.97 cm by 8\.59 cm, in"):
        ab.plan(replace(problem, gates=(replace(gate, **{key: 0.999 * least}),)), vehicle=QUAD)
    require_openings(replace(problem, gates=(replace(gate, **{key: 1.001 * least}),)), QUAD)


@given(st.integers(0, 2**32 - 1))
@examples(20)
def test_what_is_refused_in_any_attitude_fits_in_none(seed: int) -> None:
    """A gate that only a stage's name passes; the body straight through its centre, in random attitudes."""
    rng = np.random.default_rng(seed)
    body = ab.Ellipsoid(rng.uniform(0.25, 0.4, 3))
    vehicle = replace(QUAD, body=body)
    gate = ab.tilted_gate((2.0, 0.0, 1.0), width=rng.uniform(0.4, 0.8), height=rng.uniform(0.4, 0.8))
    _, problem = cruise()
    passing = ab.CustomManeuver((ab.Stage("gate", gate="gate"),))
    asked = replace(problem, gates=(gate,), maneuver=passing)
    try:
        require_openings(asked, vehicle)
        refused = False
    except SpecError:
        refused = True
    still = np.zeros(3)
    fits = []
    for _ in range(15):
        attitude = so3.exp(3 * rng.normal(size=3))
        straight = Motion(gate, body, still, 4 * gate.normal, still, attitude, still)
        fits.append(straight.passage().clearance >= 0.0)
    assert not (refused and any(fits))


@pytest.mark.parametrize("name", ab.vehicle_names())
def test_what_encloses_a_vehicle_encloses_its_propellers_closely(name: str) -> None:
    vehicle = ab.load_vehicle(name)
    body = about_rotors(vehicle.rotors)
    angle = np.linspace(0, 2 * np.pi, 1000)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    tips = np.concatenate([rotor.position_body + rotor.radius * rim for rotor in vehicle.rotors])
    scales = np.linalg.norm((tips - body.centre) / body.semi_axes, axis=-1)
    assert 0.999 < scales.max() <= 1.0
    assert np.linalg.norm(body.centre / body.semi_axes) < 1.0  # the centre of mass lies inside


def test_a_body_that_a_propeller_sticks_out_of_is_refused() -> None:
    with pytest.raises(SpecError, match=r"body must enclose rotors\[0\] .*; 1\.07\d? times its semi_axes"):
        replace(QUAD, body=ab.Ellipsoid((0.2, 0.2, 0.05)))
    with pytest.raises(SpecError, match=r"semi_axes.* must be positive"):
        ab.Ellipsoid((0.2, 0.0, 0.05))


def test_a_body_is_counted_from_where_the_rotors_are() -> None:
    table = to_table(replace(QUAD, body=ab.Ellipsoid((0.25, 0.25, 0.1), (0.0, 0.0, -0.02))))
    moved = from_table(ab.Vehicle, table | {"centre_of_mass": [0.01, 0.0, 0.03]})
    np.testing.assert_allclose(moved.bounding_ellipsoid.centre, [-0.01, 0.0, -0.05], atol=1e-15)
    assert from_table(ab.Vehicle, to_table(moved)) == moved


def test_a_dead_rotor_is_carried_through_gates() -> None:
    hexa = ab.load_vehicle("hexarotor")
    spins = (1, 1, -1, -1, 1, -1)
    rotors = [replace(rotor, spin=spin) for rotor, spin in zip(hexa.rotors, spins, strict=True)]
    rotors[1] = replace(rotors[1], min_thrust=0.0, max_thrust=0.0)
    broken = replace(hexa, rotors=rotors)
    assert broken.without_dead_rotors().bounding_ellipsoid == broken.bounding_ellipsoid


@cache
def scored() -> ab.Score:
    path, problem = cruise()
    return ab.score_flights(path, QUAD, problem=problem)


def needing(widths: Array, heights: Array) -> ab.Score:
    """Scores of flights whose bodies swept so much of a gate's plane, NaN where they did not cross it."""
    scores = scored()
    passage = replace(scores.passages[0], needed_width=widths.copy(), needed_height=heights.copy())
    return replace(scores, passages=(passage,), stop=np.full(len(widths), np.nan))


def test_the_smallest_opening_is_large_enough_as_often_as_it_says() -> None:
    """Of flights whose need is known, uniform between 0.5 and 1.5 of the opening; 99 % need 1.49 at most."""
    gate = cruise()[1].gates[0]
    rng = np.random.default_rng(0)
    scales = 0.5 + rng.uniform(size=(150, 600))
    found = [
        ab.smallest_opening(needing(s * gate.width, 0.1 * gate.height + 0 * s), gate).scale for s in scales
    ]
    enough = float(np.mean(np.array(found) >= 1.49))
    assert 0.95 - 3 * np.sqrt(0.05 * 0.95 / 150) < enough < 1.0
    assert max(found) < 1.5


def test_the_smallest_opening_counts_flights_that_never_got_there_and_knows_when_they_are_too_few() -> None:
    gate = cruise()[1].gates[0]
    widths, heights = np.full(1000, 0.6), np.full(1000, 0.15)
    found = ab.smallest_opening(needing(widths, heights), gate)
    assert (found.width, found.height, found.scale) == pytest.approx((0.6, 0.18, 0.6))
    assert str(found) == (
        "an opening of 60.00 cm by 18.00 cm, 0.6 times the gate's, is passed with 99 % probability, says "
        "95 % confidence from 1000 flights"
    )
    alone = ab.smallest_opening(needing(widths, heights), gate, side="height")
    assert (alone.width, alone.height, alone.scale) == pytest.approx((1.0, 0.15, 0.5))
    heights[:20] = np.nan
    assert ab.smallest_opening(needing(widths, heights), gate).scale == np.inf
    heights[:20] = 0.15
    with pytest.raises(
        SpecError, match="99 % with 95 % confidence takes the scores of 299 flights or more, got 298"
    ):
        ab.smallest_opening(needing(widths[:298], heights[:298]), gate)
    assert ab.smallest_opening(needing(widths[:299], heights[:299]), gate).scale == pytest.approx(0.6)
    with pytest.raises(SpecError, match="takes the scores of 299 flights or more, got 1; score more"):
        ab.smallest_opening(scored()[0], gate)
    with pytest.raises(SpecError, match="no gate named 'other'"):
        ab.smallest_opening(needing(widths, heights), replace(gate, name="other"))
