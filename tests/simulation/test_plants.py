"""Plants: the same controller in physics that others wrote, which agree with ours, and feel gates."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat.environment.obstacles import OBSTACLES
from aerobat.kernels.motors import VehicleState
from aerobat.simulation.outcome import Contact, Outcome
from aerobat.simulation.plants import PLANTS
from aerobat.simulation.plants.mujoco import Mujoco
from aerobat.simulation.plants.plant import Plant, PlantScene
from aerobat.simulation.plants.rotorpy import RotorPy, rotorpy_vehicle
from flat_outputs import FlatOutputs
from shared_plans import shared_plan

ORDER_4 = ab.Miqp(order=4)
AT_LENGTH = pytest.mark.peer


@AT_LENGTH
@pytest.mark.parametrize(
    ("name", "vehicle"),
    [
        ("line", "hexarotor"),
        ("flip-roll", "hexarotor"),
        ("flip-pitch", "hexarotor"),
        ("half-flip", "hexarotor"),
        ("half-flip", "agile-quad"),
        ("flip-roll-translation", "agile-quad"),
    ],
)
def test_mujoco_flies_every_maneuver_as_our_simulation_does(name: str, vehicle: str) -> None:
    """To a tenth of a micrometre: a free body, four or six rotors with a lag, no contact with the gate."""
    plan = shared_plan(name, vehicle, ORDER_4)
    own, other = ab.fly(plan), ab.fly(plan, plant="mujoco")
    np.testing.assert_allclose(other.position, own.position, rtol=0, atol=1e-7)
    np.testing.assert_allclose(other.thrusts, own.thrusts, rtol=0, atol=1e-5)
    assert other.first_contact[0] is Contact.NOTHING
    assert ab.score(other, plan).outcome is ab.score(own, plan).outcome


def test_mujoco_flies_a_curve_as_our_simulation_does() -> None:
    """Level at first, and turning: off the path."""
    start = ab.BodyState([0.02, 0.0, 1.0], [3.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [1.0, -2.0, 0.5])
    own, other = (ab.fly(dash(), "hexarotor", start=start, plant=plant) for plant in (None, "mujoco"))
    assert own.position_error.max() > 0.02
    np.testing.assert_allclose(other.position, own.position, rtol=0, atol=1e-7)
    np.testing.assert_allclose(other.thrusts, own.thrusts, rtol=0, atol=1e-5)
    assert other.first_contact[0] is Contact.NOTHING


def through_the_gate() -> ab.Plan:
    """A plan with the reserve that the command line keeps."""
    return shared_plan("half-flip", "agile-quad", ab.Miqp(order=4, reserve=0.1))


def dash() -> ab.Trajectory:
    """A short curve, at 3 m/s and 6 m/s²."""
    return ab.Trajectory([0.3], [[[0.0, 0.0, 1.0], [0.9, 0.0, 0.0], [0.0, 0.3, 0.0]]])


PATHS = pytest.mark.parametrize(
    "path", [dash, pytest.param(through_the_gate, marks=AT_LENGTH)], ids=["dash", "half-flip"]
)


@PATHS
def test_drag_wind_and_full_inertia_are_the_same_in_mujoco(path: Callable[[], Any]) -> None:
    """Its drag, unknown to the controller, is that of the middle of a step, hence micrometres."""
    known = ab.load_vehicle("agile-quad")
    vehicle = replace(
        known,
        drag_body=np.array([0.2, 0.25, 0.1]),
        inertia=[[0.0025, 2e-4, -1e-4], [2e-4, 0.0021, 1e-4], [-1e-4, 1e-4, 0.0043]],
    )
    windy = ab.Environment(wind=(1.0, -2.0, 0.5))
    flights = [
        ab.fly(path(), vehicle, environment=windy, nominal=known, plant=plant) for plant in (None, "mujoco")
    ]
    assert flights[0].position_error.max() > 1e-3
    np.testing.assert_allclose(flights[1].position, flights[0].position, rtol=0, atol=2e-6)


@pytest.mark.parametrize(
    "aside", [(0.3, 0.0), pytest.param((0.0, 0.3), marks=AT_LENGTH)], ids=["lateral", "up"]
)
def test_a_gate_that_was_moved_is_touched_where_geometry_says(aside: tuple[float, float]) -> None:
    """By 0.3 m to a side the ellipsoid meets a bar: felt by MuJoCo, told of our own flight by its score."""
    plan = through_the_gate()
    gate = plan.problem.gates[0]
    moved = replace(gate, position=gate.position + aside[0] * gate.lateral + aside[1] * gate.up)
    elsewhere = replace(plan, problem=replace(plan.problem, gates=(moved,)))
    own, felt = ab.fly(elsewhere), ab.fly(elsewhere, plant="mujoco")
    judged = ab.score(own, elsewhere)
    assert judged.outcome in (Outcome.HIT_FRAME, Outcome.MISSED_GATE)
    contact, time = felt.first_contact
    assert contact is Contact.GATE
    assert time == pytest.approx(judged.passages[0].time, abs=0.05)
    assert ab.score(felt, elsewhere).outcome is Outcome.TOUCHED_GATE


def test_a_vehicle_that_comes_down_touches_the_ground_and_one_that_takes_off_does_not() -> None:
    """What stands there at first has come to none."""
    vehicle, flat = ab.load_vehicle("agile-quad"), ab.Environment(ground=0.0)
    height = float(vehicle.bounding_ellipsoid.semi_axes[2])
    rise = ab.Trajectory([0.3], [[[0.0, 0.0, 0.99 * height], [0.0, 0.0, 0.0], [0.0, 0.0, 0.27]]])
    rising = ab.fly(rise, vehicle, environment=flat, plant="mujoco")
    assert rising.contact[0] == Contact.GROUND
    assert rising.first_contact[0] is Contact.NOTHING
    descent = ab.Trajectory([0.3], [[[0.0, 0.0, 0.15], [0.0, 0.0, -0.3]]])
    felt, unfelt = (
        ab.fly(descent, vehicle, environment=flat, plant=plant).first_contact
        for plant in ("mujoco", Mujoco(contacts=False))
    )
    assert felt[0] is Contact.GROUND
    assert felt[1] == pytest.approx(0.15 - height, abs=0.02)
    assert unfelt[0] is Contact.NOTHING


@PATHS
def test_conditions_are_the_same_in_mujoco(path: Callable[[], Any]) -> None:
    """Sensors, filter, delays, gusts, battery and the vehicle that was drawn: flight 3 of seed 1."""
    own, other = (
        ab.fly(path(), "agile-quad", conditions="lab", seed=1, flights=range(3, 4), plant=plant)[0]
        for plant in (None, "mujoco")
    )
    np.testing.assert_allclose(other.position, own.position, rtol=0, atol=1e-5)
    np.testing.assert_allclose(other.observed_position, own.observed_position, rtol=0, atol=1e-5)
    assert own.position_error.max() > 0.01


def test_rotorpy_flies_a_curve_on_its_model_of_our_vehicle_to_millimetres() -> None:
    """The speeds of its rotors lag, not their thrusts."""
    assert 0.0 < ab.fly(dash(), "agile-quad", plant="rotorpy").position_error.max() < 0.005


@AT_LENGTH
def test_rotorpy_flies_our_plan_on_its_model_of_our_vehicle() -> None:
    """With a reserve of thrust, for its rotors' lag is of speeds, not of the thrusts that we plan with."""
    plan = shared_plan("flip-roll", "agile-quad", ab.Miqp(order=4, reserve=0.2))
    flight = ab.fly(plan, plant="rotorpy")
    assert flight.position_error.max() < 0.005
    assert ab.score(flight, plan).outcome is Outcome.THROUGH_GATES


@AT_LENGTH
def test_rotorpys_own_controller_follows_our_plan_in_rotorpys_own_simulation() -> None:
    """Its `simulate` takes the plan as one of its trajectories; a slow line, upright."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.environments import Environment
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    limits = ab.Limits(velocity=1.0, acceleration=1.0, jerk=3.0)
    line = ab.Problem("line", ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((1.0, 0.5, 1.5)), limits=limits)
    plan = ab.plan(line, ab.Miqp(order=4), vehicle=None)
    wanted = FlatOutputs(plan)
    hover = np.full(4, np.sqrt(quad_params["mass"] * 9.81 / (4 * quad_params["k_eta"])))
    rest = {"v": np.zeros(3), "q": np.array([0.0, 0.0, 0.0, 1.0]), "w": np.zeros(3), "wind": np.zeros(3)}
    start = rest | {"x": wanted.update(0.0)["x"], "rotor_speeds": hover}
    world = Environment(Multirotor(quad_params, start), SE3Control(quad_params), wanted, sim_rate=200)
    logged = world.run(t_final=plan.duration, plot=False, animate_bool=False, verbose=False)
    times = np.minimum(logged["time"], plan.duration)
    np.testing.assert_allclose(logged["flat"]["x"], plan.trajectory.evaluate(times), atol=1e-9)
    np.testing.assert_allclose(logged["state"]["x"], logged["flat"]["x"], atol=0.1)
    np.testing.assert_array_equal(wanted.update(-1.0)["x_ddot"], np.zeros(3))
    np.testing.assert_array_equal(wanted.target(99.0)["target_pos"], wanted.update(plan.duration)["x"])


@AT_LENGTH
def test_rotorpys_hummingbird_flips_with_its_own_aerodynamics() -> None:
    """Lift that its airspeed brings, which no model of ours knows: further off, through the gate yet."""
    vehicle = rotorpy_vehicle("hummingbird")
    plan = ab.plan("flip-roll", ab.Miqp(order=4, reserve=0.15), vehicle)
    flight = ab.fly(plan, plant=RotorPy(vehicle="hummingbird"))
    assert 0.01 < flight.position_error.max() < 0.3
    assert ab.score(flight, plan).passages[0].failure is None


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"plant": "mujco"}, "did you mean 'mujoco'"),
        ({"plant": 3}, "plant must be a plant or the name of one"),
        ({"plant": "mujoco", "conditions": "lab", "flights": 2}, "one vehicle at a time"),
        ({"plant": "rotorpy", "vehicle": "hexarotor"}, "4 rotors"),
        ({"plant": "rotorpy", "conditions": "lab"}, "one kind"),
    ],
)
def test_plants_that_cannot_fly_are_refused_in_a_sentence(wrong: dict, sentence: str) -> None:
    with pytest.raises(ab.SpecError, match=sentence):
        ab.fly(through_the_gate(), **wrong)


def test_scores_of_many_flights_refuse_a_plant() -> None:
    with pytest.raises(ab.SpecError, match="one vehicle at a time"):
        ab.score_flights(through_the_gate(), plant="mujoco")


@pytest.mark.parametrize("outside", [{"plant": "mujoco"}, {"autopilot": "betaflight"}])
def test_what_flies_as_a_whole_is_not_prepared_to_be_stepped(outside: dict[str, Any]) -> None:
    with pytest.raises(ab.SpecError, match="is not stepped; give it to fly"):
        ab.prepare(through_the_gate(), **outside)


def test_a_plant_whose_vehicle_is_none_is_refused_by_name() -> None:
    class Wrong(Plant):
        def begin(self, scene: PlantScene, motion: VehicleState) -> Any:
            return 42

    with pytest.raises(ab.SpecError, match=r"returned 42 from begin\(\), which has no motion"):
        ab.fly(through_the_gate(), plant=Wrong())


def test_unknown_vehicles_of_rotorpy_are_refused() -> None:
    with pytest.raises(ab.SpecError, match="hummingbird"):
        rotorpy_vehicle("humingbird")
    with pytest.raises(ab.SpecError, match="RotorPy's vehicles"):
        RotorPy(vehicle="a/b")


def test_plants_are_known_by_name() -> None:
    assert set(PLANTS) >= {"mujoco", "rotorpy"}


def test_a_flight_that_felt_contact_is_saved_and_loaded_whole(tmp_path) -> None:
    flight = ab.fly(dash(), "agile-quad", plant="mujoco")
    flight.save(tmp_path / "flight.npz")
    assert ab.load_flight(tmp_path / "flight.npz") == flight
    assert flight.engine == "mujoco"


@pytest.mark.parametrize("kind", ["box", "sphere", "cylinder", "capsule", "polytope", "half-space"])
@pytest.mark.parametrize("clearance", [0.01, -0.01])
def test_mujoco_feels_an_obstacle_when_our_judge_sees_the_contact(kind: str, clearance: float) -> None:
    """Level, past solids of every kind: nothing is felt a centimetre beside them."""
    path = ab.Trajectory([0.3], [[[0.0, 0.0, 1.0], [0.9, 0.0, 0.0]]])
    vehicle = ab.load_vehicle("agile-quad")
    side = float(vehicle.bounding_ellipsoid.semi_axes[1] + clearance)
    x = 1.2 if kind == "half-space" else 0.5
    solids: dict[str, dict[str, Any]] = {
        "box": {"position": [x, side + 0.2, 1.0], "size": [0.1, 0.4, 1.0]},
        "sphere": {"position": [x, side + 0.2, 1.0], "radius": 0.2},
        "cylinder": {"start": [x, side + 0.2, 0.0], "end": [x, side + 0.2, 2.0], "radius": 0.2},
        "capsule": {"start": [x, side + 0.2, 0.0], "end": [x, side + 0.2, 2.0], "radius": 0.2},
        "polytope": {"points": [[x, side, z] for z in (0.5, 1.5)] + [[x + d, 1.0, 1.0] for d in (-0.1, 0.1)]},
        "half-space": {"position": [0.9, side, 1.0], "normal": [-0.1, -1.0, 0.0]},
    }
    world = ab.Environment(obstacles=(OBSTACLES[kind](**solids[kind]),))
    own, other = (ab.fly(path, vehicle, environment=world, plant=plant) for plant in (None, "mujoco"))
    problem = ab.Problem("past", ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((0.9, 0.0, 1.0)))
    ours, felt = (ab.score(flight, problem, vehicle) for flight in (own, other))
    assert ours.nearest is not None
    if clearance > 0.0:
        assert (felt.contact, ours.nearest.failure) == (Contact.NOTHING, None)
        assert ours.nearest.clearance == pytest.approx(clearance, abs=5e-3)
    else:
        assert felt.outcome is ours.outcome is Outcome.HIT_OBSTACLE
        assert felt.contact == Contact.OBSTACLE
        assert felt.contact_time == pytest.approx(ours.nearest.time, abs=0.005)
