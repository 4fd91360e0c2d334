"""Logs of other systems: a planted cause is named from a CSV as from our own log, and what lacks is told."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat import cli
from shared_plans import shared_plan

POSE = ("t", "x", "y", "z", "qw", "qx", "qy", "qz")
RATES = ("vx", "vy", "vz", "wx", "wy", "wz")
SEEN = ("est_x", "est_y", "est_z", "est_vx", "est_vy", "est_vz")
THRUSTS, COMMANDS = ("f0", "f1", "f2", "f3"), ("u0", "u1", "u2", "u3")
ROWS = 5  # of our log for one of theirs: 100 Hz


@cache
def plan() -> ab.Plan:
    return shared_plan("flip-roll", planner=ab.Miqp(order=5))


def under(**conditions: Any) -> ab.Flight:
    return ab.fly(plan(), conditions=ab.Dispersion(**conditions), seed=1)


def weak(**factors: float) -> ab.Vehicle:
    vehicle = plan().vehicle
    assert vehicle is not None
    rotors = (
        replace(rotor, **{name: factor * getattr(rotor, name) for name, factor in factors.items()})
        for rotor in vehicle.rotors
    )
    return replace(vehicle, rotors=tuple(rotors))


def heavier_to_turn() -> ab.Vehicle:
    vehicle = plan().vehicle
    assert vehicle is not None
    return replace(vehicle, inertia=2.0 * vehicle.inertia)


def handed_over() -> ab.Flight:
    lab = ab.load_dispersion("lab")
    assert lab.motion_capture is not None
    cameras = replace(lab.motion_capture, hand_off=ab.HandOff(translation=0.15))
    return under(imu=lab.imu, motion_capture=cameras, control_rate=500.0)


PLANTED: dict[str, Callable[[], ab.Flight]] = {
    "start": lambda: under(start_position=0.05),
    "vehicle": lambda: under(mass=0.1),
    "hand-off": handed_over,
    "saturation": lambda: ab.fly(plan(), weak(max_thrust=0.6)),
    "inertia": lambda: ab.fly(plan(), heavier_to_turn(), nominal=plan().vehicle),
    "gains": lambda: ab.fly(
        plan(), controller=ab.Controller(attitude_frequency=14.0, moment_feedforward=False)
    ),
}


def log(path: Path, flight: ab.Flight, names: Iterable[str], every: int = ROWS) -> Path:
    """Write a flight as another system would, with columns of these names."""
    blocks = {
        ("t",): flight.times[:, None],
        POSE[1:4]: flight.position,
        POSE[4:]: flight.q_world_body,
        RATES[:3]: flight.velocity,
        RATES[3:]: flight.omega_body,
        THRUSTS: flight.thrusts,
        COMMANDS: flight.commands,
    }
    if flight.is_observed:
        blocks |= {SEEN[:3]: flight.observed_position, SEEN[3:]: flight.observed_velocity}
    columns = {name: values[:, k] for group, values in blocks.items() for k, name in enumerate(group)}
    table = np.column_stack([columns[name] for name in names if name in columns])[::every]
    header = ",".join(name for name in names if name in columns)
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.9g")
    return path


@pytest.mark.parametrize("cause", PLANTED)
def test_a_planted_cause_is_named_first_from_another_systems_log(cause: str, tmp_path: Path) -> None:
    flight = PLANTED[cause]()
    every = 1 if cause == "saturation" else ROWS
    file = log(tmp_path / "log.csv", flight, (*POSE, *RATES, *THRUSTS, *COMMANDS, *SEEN), every)
    found = ab.inspect_flight(ab.read_flight_log(file, plan(), flown_by(cause)), plan(), flown_by(cause))
    assert found.cause == cause
    assert found.shares[0].error > 0.7 * found.largest


def flown_by(cause: str) -> ab.Vehicle | None:
    """The vehicle whose limits the log's reader knows."""
    return weak(max_thrust=0.6) if cause == "saturation" else None


@pytest.mark.parametrize("every", [1, ROWS])
def test_commands_alone_do_not_take_slow_rotors_for_an_inertia(every: int, tmp_path: Path) -> None:
    slow = ab.fly(plan(), weak(lag=3.0), nominal=plan().vehicle)
    file = log(tmp_path / "log.csv", slow, (*POSE, *RATES, *COMMANDS), every)
    flight = ab.read_flight_log(file, plan())
    assert ab.inspect_flight(flight, plan()).cause != "inertia"
    assert ab.inspect_flight(replace(flight, engine="log"), plan()).cause == "inertia"  # as if measured


def test_a_pose_and_thrusts_alone_tell_a_heavy_vehicle(tmp_path: Path) -> None:
    file = log(tmp_path / "log.csv", PLANTED["vehicle"](), (*POSE, *THRUSTS))
    assert ab.inspect_flight(ab.read_flight_log(file, plan()), plan()).cause == "vehicle"


def test_what_a_log_holds_is_what_is_read_and_what_it_lacks_is_told_from_the_rest(tmp_path: Path) -> None:
    flight = ab.fly(plan())
    whole = ab.read_flight_log(
        log(tmp_path / "whole.csv", flight, (*POSE, *RATES, *THRUSTS, *COMMANDS), 1), plan()
    )
    poses = ab.read_flight_log(log(tmp_path / "poses.csv", flight, (*POSE, *COMMANDS), 1), plan())
    for name in ("position", "velocity", "omega_body", "thrusts", "commands"):
        rows = slice(len(whole.times))
        np.testing.assert_allclose(whole.series[name], flight.series[name][rows], atol=1e-6)
    np.testing.assert_allclose(poses.velocity, whole.velocity, atol=0.05)
    np.testing.assert_allclose(poses.thrusts, whole.thrusts, atol=0.05)
    np.testing.assert_allclose(
        whole.setpoint_position, flight.setpoint_position[: len(whole.times)], atol=1e-9
    )


def test_a_dead_rotor_is_not_saturated(tmp_path: Path) -> None:
    hexarotor, spins = ab.load_vehicle("hexarotor"), (1, 1, -1, -1, 1, -1)  # the first may fail
    rotors = [replace(rotor, spin=spin) for rotor, spin in zip(hexarotor.rotors, spins, strict=True)]
    rotors[0] = replace(rotors[0], min_thrust=0.0, max_thrust=0.0)
    failed, line = replace(hexarotor, rotors=tuple(rotors)), shared_plan("line")
    logged = ab.reference(line, failed, rate=100.0)
    pose = (logged.times, logged.setpoint.flat.position, logged.setpoint.q_world_body)
    header = ",".join((*POSE, *(f"f{k}" for k in range(6))))
    table = np.column_stack((*pose, logged.rotor_thrusts))
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=header, comments="")
    assert not ab.read_flight_log(tmp_path / "log.csv", line, failed).saturated.all()


def test_the_command_takes_a_log_beside_its_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan().save(tmp_path / "flip.plan")
    file = log(tmp_path / "log.csv", PLANTED["start"](), (*POSE, *THRUSTS))
    cli.main(["inspect", str(file), "--plan", str(tmp_path / "flip.plan"), "--json"])
    assert json.loads(capsys.readouterr().out)["cause"] == "start"
    assert (tmp_path / "inspect.png").exists()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("0,0,0,0,1,0,0,0\n", "it names no columns"),
        ("t,x,y,z,f0\n0,0,0,0,1\n1,0,0,0,1\n", "there is no column qw"),
        ("t,t,x\n0,0,0\n1,1,1\n", "there are two columns t"),
        ("t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0,0,0,0,1,0,0,0\n", "times, the column t, must rise"),
        ("t,x,y,z,qw,qx,qy,qz\n90,0,0,0,1,0,0,0\n91,0,0,0,1,0,0,0\n", "let t be 0 where the plan begins"),
        (
            "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n0.1,0,0,0,1,0,0,0\n0.2,0,0,0,1,0,0,0\n",
            "neither f0 to f3, the rotors' thrusts",
        ),
        (
            "t,x,y,z,qw,qx,qy,qz,f0\n0,0,0,0,1,0,0,0,1\n0.1,0,1e300,0,1,0,0,0,1\n0.2,0,0,0,1,0,0,0,1\n",
            "line 3: the column y is beyond 1e\\+06; see its unit",
        ),
        (
            "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1e-300,0,0,0,1,0,0,0\n0.2,0,0,0,1,0,0,0\n",
            "must rise, by 1e-06 s or more",
        ),
        (
            "t,x,y,z,qw,qx,qy,qz\n0,0,0,0,9,0,0,0\n0.1,0,0,0,1,0,0,0\n0.2,0,0,0,1,0,0,0\n",
            "must be unit quaternions",
        ),
        (
            "t,x,y,z,qw,qx,qy,qz,f0,f1,f2,f3,f4\n0,0,0,0,1,0,0,0,1,1,1,1,1\n0.1,0,0,0,1,0,0,0,1,1,1,1,1\n"
            "0.2,0,0,0,1,0,0,0,1,1,1,1,1\n",
            "there is a column f4, and agile-quad has 4 rotors",
        ),
    ],
)
def test_a_malformed_log_is_refused_in_a_sentence(text: str, told: str, tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text(text)
    with pytest.raises(ab.SpecError, match=told):
        ab.read_flight_log(file, plan())


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"position": lambda x: 1000.0 * x}, "from the plan's path half of the time; give metres"),
        ({"position": lambda x: x[:, [1, 0, 2]] * [1.0, 1.0, -1.0]}, "z up, of a flight of this plan"),
        ({"q_world_body": lambda q: q[:, [1, 2, 3, 0]]}, "plan's attitude half of the time; give qw first"),
        ({"thrusts": lambda f: 102.0 * f}, "the column f0 reaches .* N at most; give newtons"),
        ({"times": lambda t: t + (t > 0.5 * t[-1]) * 0.4}, "t rises by 0.4[0-9]* s, where rows are"),
    ],
)
def test_a_log_in_other_units_or_axes_or_with_a_gap_is_refused(
    change: dict[str, Callable[[Any], Any]], told: str, tmp_path: Path
) -> None:
    flight = PLANTED["vehicle"]()
    changed = {name: how(getattr(flight, name)) for name, how in change.items()}
    times = changed.pop("times", flight.times)
    other = replace(flight, times=times, series={**flight.series, **changed})
    with pytest.raises(ab.SpecError, match=told):
        ab.read_flight_log(log(tmp_path / "log.csv", other, (*POSE, *THRUSTS)), plan())
