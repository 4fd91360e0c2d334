"""Vehicles as their makers describe them: speeds and coefficients, thrust stands, a frame of one's own."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
import tomli_w
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.control.parameters import airframe_parameters
from aerobat.declaration import from_table
from aerobat.engines.floats import FloatOps
from aerobat.engines.pytree import tree_map
from aerobat.errors import SpecError
from aerobat.kernels import motors, rigid_body
from aerobat.kernels.rigid_body import Body, EnvironmentParameters
from aerobat.vehicle import Rotor, Vehicle, implausibilities, load_vehicle, wrench
from aerobat.vehicle.fleet import Fleet
from random_vehicles import random_vehicle, thrusts_within_limits

PLACES = [[0.1, 0.1, 0.0], [0.1, -0.1, 0.0], [-0.1, -0.1, 0.0], [-0.1, 0.1, 0.0]]
COMMON = {"lag": 0.02, "radius": 0.06}
THRUSTS = {"min_thrust": 0.0, "max_thrust": 6.0, "torque_coefficient": 0.02}


def table(defaults: dict, first: dict | None = None, **others: object) -> dict:
    rotors: list[dict] = [{"position_body": p, "spin": (-1) ** (i + 1)} for i, p in enumerate(PLACES)]
    rotors[0] |= first or {}
    content = {"name": "mine", "mass": 0.8, "inertia": [0.004, 0.004, 0.007], "rotors": rotors}
    return content | {"rotor_defaults": COMMON | defaults} | others


def made(*args, **kwargs) -> Vehicle:
    return from_table(Vehicle, table(*args, **kwargs))


@given(st.floats(1e-9, 1e-3), st.floats(0, 0.1), st.floats(0, 900), st.floats(1000, 40000))
def test_coefficients_and_speeds_give_the_thrust_and_torque_of_the_propellers_law(
    k_f: float, ratio: float, idle: float, full: float
) -> None:
    keys = {"k_f": k_f, "k_m": ratio * k_f, "min_rpm": idle, "max_rpm": full}
    rotor = from_table(Rotor, {"position_body": [0.1, 0.1, 0.0], "spin": 1, **COMMON, **keys})
    for thrust, rpm in ((rotor.min_thrust, idle), (rotor.max_thrust, full)):
        omega = 2 * np.pi * rpm / 60
        assert thrust == pytest.approx(k_f * omega**2, rel=1e-12)
        assert rotor.torque_coefficient * thrust == pytest.approx(ratio * k_f * omega**2, rel=1e-12)


def test_a_thrust_stand_gives_its_ends_and_the_torque_that_fits_all_rows_best() -> None:
    rows = [[1000, 0.1, 0.002], [5000, 2.0, 0.03], [9000, 6.5, 0.11]]
    vehicle = made({"thrust_curve": rows})
    np.testing.assert_array_equal(vehicle.min_thrusts, 0.1)
    np.testing.assert_array_equal(vehicle.max_thrusts, 6.5)
    thrust, torque = np.array(rows)[:, 1:].T
    expected = np.linalg.lstsq(thrust[:, None], torque, rcond=None)[0]
    assert vehicle.rotors[0].torque_coefficient == pytest.approx(expected[0], rel=1e-12)
    without = made({"thrust_curve": [row[:2] for row in rows], "torque_coefficient": 0.02})
    np.testing.assert_array_equal(without.max_thrusts, vehicle.max_thrusts)


def test_a_rotors_own_keys_win_over_whatever_the_defaults_say_by_other_keys() -> None:
    speeds = {"k_f": 1e-5, "k_m": 2e-7, "min_rpm": 0, "max_rpm": 7000}
    everyones = made(speeds).max_thrusts
    for defaults, own, first in [
        (speeds, {"max_thrust": 3.0}, 3.0),
        (speeds, {"max_rpm": 3500}, everyones[0] / 4),
        (speeds, {"k_f": 2e-5}, 2 * everyones[0]),
        (speeds, {"thrust_curve": [[0, 0.0], [1, 4.0]]}, 4.0),
        (THRUSTS, {"k_f": 1e-5, "max_rpm": 7000}, everyones[0]),
        ({"thrust_curve": [[0, 0.0], [1, 4.0]], "torque_coefficient": 0.02}, {"max_thrust": 3.0}, 3.0),
    ]:
        vehicle = made(defaults, own)
        assert vehicle.max_thrusts[0] == pytest.approx(first)
        np.testing.assert_array_equal(vehicle.max_thrusts[1:], made(defaults).max_thrusts[1:])


@pytest.mark.parametrize(
    ("defaults", "first", "complaint"),
    [
        ({"max_rpm": 7000}, {}, "rotors[0].k_f is missing; max_rpm says nothing without it"),
        (
            {"k_f": 1e-5, "max_rpm": 7000},
            {},
            "rotors[0].min_thrust and torque_coefficient are missing; add them there or",
        ),
        ({"k_f": -1e-5, "max_rpm": 7000}, {}, "rotor_defaults.k_f must be positive, got -1e-05"),
        ({"k_f": 0, "max_rpm": 7000}, {}, "rotor_defaults.k_f must be positive, got 0"),
        ({"k_f": "x", "max_rpm": 7000}, {}, "rotor_defaults.k_f must be a number, got 'x'"),
        (
            {"k_f": 1e-5, "max_rpm": 7e3} | THRUSTS,
            {},
            "rotor_defaults.max_thrust is given twice, by itself and by",
        ),
        (
            {"k_f": 1e-5, "max_rpm": 7e3, "thrust_curve": [[0, 0], [1, 1]]},
            {},
            "rotors[0].max_thrust is given twice",
        ),
        ({"thrust_curve": 3}, {}, "rotor_defaults.thrust_curve must be two rows or more, got 3"),
        (
            {"thrust_curve": [[0, 0], [1]]},
            {},
            "rotor_defaults.thrust_curve[1] must be 2 numbers, got a list of 1",
        ),
        ({"thrust_curve": [[0, 0], [1, "x"]]}, {}, "rotor_defaults.thrust_curve[1][1] must be a number"),
        (
            {"thrust_curve": [[0, 2], [1, 1]]},
            {},
            "rotor_defaults.thrust_curve[1] must continue the rise: thrusts",
        ),
        (
            {"thrust_curve": [[1, 0], [1, 1]]},
            {},
            "rotor_defaults.thrust_curve[1] must continue the rise: commands",
        ),
        (THRUSTS, {"max_rmp": 3}, "rotors[0].max_rmp is not a known key; did you mean 'max_rpm'?"),
        (THRUSTS | {"max_rmp": 3}, {}, "rotor_defaults.max_rmp is not a known key; did you mean 'max_rpm'?"),
    ],
)
def test_what_a_data_sheet_lacks_or_says_twice_is_one_sentence(
    defaults: dict, first: dict, complaint: str, tmp_path: Path
) -> None:
    (tmp_path / "mine.toml").write_text(tomli_w.dumps(table(defaults, first)), encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        load_vehicle(tmp_path / "mine.toml")
    assert str(caught.value).partition("mine.toml: ")[2].startswith(complaint)


@pytest.mark.parametrize(
    "said",
    [
        THRUSTS,
        {"k_f": 1e-5, "k_m": 2e-7, "min_rpm": 900, "max_rpm": 7000},
        {"thrust_curve": [[0, 0.1, 0.01], [1, 4.0, 0.1]]},
    ],
)
def test_a_rotor_is_killed_by_one_key_whatever_else_is_said_of_its_thrust(said: dict) -> None:
    for vehicle in (made(said, {"max_thrust": 0}), made(THRUSTS, said | {"max_thrust": 0})):
        assert vehicle.dead_rotors == (0,)
        assert vehicle.rotors[0].min_thrust == 0.0


@pytest.mark.parametrize("wrong", [{"k_f": 1e-7}, {"max_rpm": 733}])
def test_a_coefficient_per_rpm_and_a_speed_in_radians_are_suspected(wrong: dict) -> None:
    right = {"k_f": 1e-5, "k_m": 2e-7, "min_rpm": 0, "max_rpm": 7000}
    assert implausibilities(made(right)) == ()
    told = implausibilities(made(right | wrong))[-1]
    assert "k_f" in told
    assert "rpm" in told


@given(st.integers(0, 2**32 - 1), st.sampled_from([4, 6, 8]))
def test_a_frame_whose_origin_is_not_the_centre_of_mass_feels_the_moments_about_that_centre(
    seed: int, count: int
) -> None:
    """Forces at the rotors' places, moments about the centre of mass, in the frame of the file."""
    rng = np.random.default_rng(seed)
    vehicle, centre = random_vehicle(rng, count), rng.normal(size=3)
    rotors = [
        {
            name: getattr(r, name)
            for name in ("min_thrust", "max_thrust", "torque_coefficient", "lag", "radius", "spin")
        }
        | {"position_body": (r.position_body + centre).tolist()}
        for r in vehicle.rotors
    ]
    basics = {"name": "shifted", "mass": vehicle.mass, "inertia": vehicle.inertia}
    moved = from_table(Vehicle, basics | {"centre_of_mass": centre.tolist(), "rotors": rotors})
    thrusts = thrusts_within_limits(vehicle, rng)
    load = wrench(moved, thrusts)
    forces = thrusts[..., None] * [0.0, 0.0, 1.0]
    arms = np.array([rotor["position_body"] for rotor in rotors]) - centre
    torque = np.array([-rotor.spin * rotor.torque_coefficient for rotor in vehicle.rotors])
    moment = np.cross(arms, forces).sum(axis=-2) + (thrusts @ torque)[:, None] * [0.0, 0.0, 1.0]
    scale = 1e-12 * np.abs(thrusts).max()
    np.testing.assert_allclose(load.moment_body, moment, rtol=0, atol=scale)
    np.testing.assert_allclose(moved.allocation, vehicle.allocation, rtol=0, atol=1e-12)


def test_without_rotors_a_centre_of_mass_is_no_different_error() -> None:
    for wrong, complaint in (
        ([0.1], "centre_of_mass must be 3 numbers"),
        ([0, 0, "x"], r"centre_of_mass\[2\]"),
    ):
        with pytest.raises(SpecError, match=f"^{complaint}"):
            made(THRUSTS, centre_of_mass=wrong)


MODEL = """
<mujoco>
  <option integrator="RK4" timestep="0.001" gravity="0 0 -9.81"/>
  <worldbody>
    <body><freejoint/>{sites}
      <inertial pos="0.02 -0.01 0.03" mass="0.8" diaginertia="0.004 0.004 0.007"/>
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
</mujoco>
"""


def test_mujocos_body_with_its_centre_of_mass_off_the_origin_agrees_to_a_nanometre() -> None:
    centre = [0.02, -0.01, 0.03]
    vehicle = made(THRUSTS, centre_of_mass=centre)
    sites = "".join(f'<site name="r{i}" pos="{x} {y} {z}"/>' for i, (x, y, z) in enumerate(PLACES))
    gears = "".join(
        f'<general site="r{i}" gear="0 0 1 0 0 {-r.spin * r.torque_coefficient}"/>'
        for i, r in enumerate(vehicle.rotors)
    )
    model = mujoco.MjModel.from_xml_string(MODEL.format(sites=sites, motors=gears))
    data = mujoco.MjData(model)
    data.qpos[:] = [*(-np.array(centre)), 1.0, 0.0, 0.0, 0.0]
    airframe = tree_map(lambda leaf: leaf[0], airframe_parameters(Fleet.of([vehicle])))
    body = Body((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    environment = EnvironmentParameters(9.81, (0.0, 0.0, 0.0))
    for k in range(500):
        thrusts = tuple(2.0 + 0.2 * np.sin(0.01 * k + i) for i in range(4))
        data.ctrl[:] = thrusts
        mujoco.mj_step(model, data)
        load = motors.wrench(airframe.rotors, thrusts)
        body = rigid_body.step(FloatOps, airframe.mass_properties, environment, body, (load,) * 3, 0.001)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(body.position, data.xipos[1], rtol=0, atol=1e-9)
    assert so3.angle_between(body.q_world_body, data.qpos[3:]) < 1e-9
