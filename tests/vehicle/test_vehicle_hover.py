"""Dead rotors, and how the others share the weight: laws, and what the refusal says is left."""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.certification import certify
from aerobat.errors import SpecError
from aerobat.planning import plan
from aerobat.problem import load_problem
from aerobat.simulation import FlightConfig, fly
from aerobat.states import Wrench
from aerobat.vehicle import Rotor, Vehicle, load_vehicle, mixer, rotor_thrusts, write_vehicle
from aerobat.vehicle.fleet import Fleet
from aerobat.vehicle.hover import balanced_fractions
from refusals import complaint

HEXAROTOR = load_vehicle("hexarotor")
SURVIVING_SPINS = (1, 1, -1, -1, 1, -1)  # with these, four of six rotors may fail, the first among them
LAYOUTS = {"hexarotor": HEXAROTOR, "quadrotor": load_vehicle("agile-quad")}


def with_spins(vehicle: Vehicle, spins: tuple[int, ...]) -> Vehicle:
    rotors = (dataclasses.replace(r, spin=s) for r, s in zip(vehicle.rotors, spins, strict=True))
    return dataclasses.replace(vehicle, rotors=tuple(rotors))


def with_dead(vehicle: Vehicle, *dead: int) -> Vehicle:
    rotors = (
        dataclasses.replace(rotor, min_thrust=0.0, max_thrust=0.0) if i in dead else rotor
        for i, rotor in enumerate(vehicle.rotors)
    )
    return dataclasses.replace(vehicle, rotors=tuple(rotors))


SURVIVOR = with_spins(HEXAROTOR, SURVIVING_SPINS)


@pytest.mark.slow
def test_a_hexarotor_with_a_dead_rotor_is_planned_certified_and_flown_by_the_others() -> None:
    problem = load_problem("half-flip")
    failed = with_dead(SURVIVOR, 0)
    found = plan(problem, vehicle=failed)
    assert found.certificate.certified
    assert found.flies
    assert found.vehicle == failed.without_dead_rotors()
    assert len(found.vehicle.rotors) == 5
    again = certify(found.trajectory, failed, problem.environment)
    assert again.findings == certify(found.trajectory, found.vehicle, problem.environment).findings
    whole, without = fly(found, vehicle=failed), fly(found)
    np.testing.assert_allclose(whole.position, without.position, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(whole.commands[:, 0], 0.0)
    np.testing.assert_array_equal(whole.thrusts[:, 0], 0.0)


def test_a_rotor_that_fails_under_a_controller_that_knows_nothing_of_it_can_be_flown() -> None:
    found = plan(load_problem("line"), vehicle=HEXAROTOR)
    flight = fly(found, vehicle=with_dead(HEXAROTOR, 1), config=FlightConfig(nominal=HEXAROTOR))
    dying = flight.thrusts[:, 1]
    assert (np.diff(dying) <= 0.0).all()
    assert dying[-1] < 1e-6 * dying[0]
    assert flight.position_error.max() > fly(found).position_error.max()


@pytest.mark.parametrize(
    ("layout", "dead", "sentence"),
    [
        ("quadrotor", (1,), r"without rotors\[1\] \(max_thrust = 0\): .* at best spinning remains"),
        (
            "hexarotor",
            (1,),
            r"without rotors\[1\] .*: rotors\[4\] would have to stop; thrust, roll and pitch",
        ),
        ("hexarotor", (0, 1), r"without rotors\[0\] and rotors\[1\] .* centre of mass is not inside"),
    ],
)
def test_a_failure_that_leaves_too_little_is_refused_with_what_remains(
    layout: str, dead: tuple[int, ...], sentence: str
) -> None:
    failed = with_dead(LAYOUTS[layout], *dead)
    problem = load_problem("line")
    path = plan(problem, vehicle=None).trajectory
    for use in (
        lambda: plan(problem, vehicle=failed),
        lambda: certify(path, failed),
        lambda: fly(path, failed),
        lambda: mixer(failed),
    ):
        with pytest.raises(SpecError, match=sentence) as caught:
            use()
        assert not re.search(r"\de-\d", str(caught.value))


def test_a_rotor_that_is_left_out_is_told_as_a_dead_one_without_rounding() -> None:
    with pytest.raises(SpecError, match=r"hover and yaw: rotors\[3\] would have to stop") as caught:
        dataclasses.replace(HEXAROTOR, rotors=HEXAROTOR.rotors[:1] + HEXAROTOR.rotors[2:])
    assert not re.search(r"\de-\d", str(caught.value))


def test_a_dead_rotor_survives_its_file_and_needs_no_idle_of_its_own(tmp_path) -> None:
    failed = with_dead(SURVIVOR, 0)
    write_vehicle(failed, tmp_path / "hexarotor.toml")
    assert load_vehicle(tmp_path / "hexarotor.toml") == failed
    assert failed.dead_rotors == (0,)
    text = (tmp_path / "hexarotor.toml").read_text(encoding="utf-8").replace("min_thrust = 0.0\n", "")
    (tmp_path / "idle.toml").write_text(
        text.replace("[rotor_defaults]", "[rotor_defaults]\nmin_thrust = 0.2")
    )
    idling = load_vehicle(tmp_path / "idle.toml")
    np.testing.assert_array_equal(idling.min_thrusts, [0.0, *[0.2] * 5])


@st.composite
def lopsided(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions, spins and strengths of rotors, the centre of mass anywhere among them, one dead at times."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.sampled_from([5, 6, 8]))
    angles = 2 * np.pi * np.arange(count) / count + rng.uniform(-0.2, 0.2, count)
    places = 0.2 * np.c_[np.cos(angles), np.sin(angles), 0 * angles] - [*rng.uniform(-0.1, 0.1, 2), 0.0]
    strengths = np.ones(count)
    strengths[: draw(st.integers(0, 1))] = 0.0
    return places, rng.permutation(np.resize([1, -1], count)), strengths


@given(lopsided())
def test_a_vehicle_is_refused_only_if_no_sharing_of_its_weight_holds_a_hover(made: tuple) -> None:
    """Linear programming is the judge; whoever is accepted shares weight and moments exactly."""
    places, spins, strengths = made
    rotors = [
        Rotor(place, int(spin), 0.0, 5.0 * strength, 0.02, 0.02, 0.1)
        for place, spin, strength in zip(places, spins, strengths, strict=True)
    ]
    made_vehicles: list[Vehicle] = []
    refused = complaint(
        lambda: made_vehicles.append(
            Vehicle("any", 1.0, np.diag([0.01, 0.01, 0.02]), rotors).without_dead_rotors()
        )
    )
    x, y, _ = places.T
    allocation = np.array([np.ones_like(x), y, -x, -0.02 * spins])
    _, smallest = balanced_fractions(allocation, np.zeros(len(x)), 5.0 * strengths)
    assert bool(refused) == (smallest <= 1e-3) or abs(smallest) < 2e-3
    for vehicle in made_vehicles:
        np.testing.assert_allclose(vehicle.allocation @ mixer(vehicle), np.eye(4), rtol=0, atol=1e-9)
        assert (mixer(vehicle)[:, 0] > 0.0).all()
        np.testing.assert_array_equal(Fleet.of([vehicle, vehicle]).mixer, [mixer(vehicle)] * 2)


@pytest.mark.parametrize("most", [0.5, 1.0, 2.0])
def test_a_rotor_hardly_as_strong_as_its_part_of_the_weight_gives_what_it_can_and_others_the_rest(
    most: float,
) -> None:
    """Its part by the least norm is 1.64 N; a map over `max_thrust` said that no hover is possible."""
    weak = dataclasses.replace(HEXAROTOR.rotors[1], min_thrust=0.0, max_thrust=most)
    vehicle = dataclasses.replace(HEXAROTOR, rotors=(HEXAROTOR.rotors[0], weak, *HEXAROTOR.rotors[2:]))
    vehicle.require_hover(9.81)
    np.testing.assert_allclose(vehicle.allocation @ mixer(vehicle), np.eye(4), rtol=0, atol=1e-9)
    mixers = Fleet.of([HEXAROTOR, vehicle]).mixer
    np.testing.assert_array_equal(mixers, [mixer(HEXAROTOR), mixer(vehicle)])
    hover = vehicle.mass * 9.81 * mixer(vehicle)[:, 0]
    assert hover[1] <= 0.8 * most


def test_a_fleet_shares_the_weight_as_each_of_its_vehicles_does() -> None:
    skew = [
        dataclasses.replace(r, position_body=np.add(r.position_body, [0.05, 0.02, 0.0]))
        for r in SURVIVOR.rotors
    ]
    vehicles = [SURVIVOR, with_dead(SURVIVOR, 0), dataclasses.replace(SURVIVOR, rotors=tuple(skew))]
    mixers = Fleet.of(vehicles).mixer
    for vehicle, found in zip(vehicles, mixers, strict=True):
        np.testing.assert_allclose(found, mixer(vehicle), rtol=0, atol=1e-12)
    hover = rotor_thrusts(vehicles[1], Wrench(np.array(9.81), np.zeros(3)))
    np.testing.assert_array_equal(hover[0], 0.0)
