"""Values typed in the wrong unit are told with the unit that was meant, and nothing built is suspected."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from aerobat import cli
from aerobat.vehicle import Vehicle, implausibilities, load_vehicle, vehicle_names, write_vehicle

QUAD = load_vehicle("agile-quad")


def with_rotors(**changes: Callable) -> Vehicle:
    rotors = (
        replace(r, **{name: made(getattr(r, name)) for name, made in changes.items()}) for r in QUAD.rotors
    )
    return replace(QUAD, rotors=tuple(rotors))


MISTYPED = {
    "arms in mm": (with_rotors(position_body=lambda p: 1000 * p), "position_body", "typed in mm"),
    "lag in ms": (with_rotors(lag=lambda t: 30.0), "lag", "typed in ms"),
    "torque in mm": (with_rotors(torque_coefficient=lambda c: 13.0), "torque_coefficient", "typed in mm"),
    "propeller of five": (with_rotors(radius=lambda r: 5.0), "radius", "typed in inches"),
    "inertia in g m2": (replace(QUAD, inertia=1e3 * QUAD.inertia), "inertia", "typed in g·m²"),
    "inertia in g cm2": (replace(QUAD, inertia=1e7 * QUAD.inertia), "inertia", "typed in g·cm²"),
    "inertia of a speck": (replace(QUAD, inertia=1e-4 * QUAD.inertia), "inertia", "check its unit"),
    "rate in degrees": (replace(QUAD, max_body_rate=1998.0), "max_body_rate", "typed in °/s"),
    "thrust in grams": (with_rotors(max_thrust=lambda f: 100 * f), "max_thrust", "grams of force"),
}


@pytest.mark.parametrize("name", vehicle_names())
def test_no_vehicle_that_comes_with_aerobat_is_suspected(name: str) -> None:
    assert implausibilities(load_vehicle(name)) == ()


@pytest.mark.parametrize("scale", [0.3, 1.0, 3.0, 30.0])
def test_vehicles_scaled_by_the_laws_of_similarity_are_not_suspected(scale: float) -> None:
    """Lengths, masses as lengths cubed, moments of inertia as their fifth power."""
    rotors = tuple(
        replace(
            rotor,
            position_body=scale * rotor.position_body,
            radius=scale * rotor.radius,
            torque_coefficient=scale * rotor.torque_coefficient,
            max_thrust=scale**3 * rotor.max_thrust,
            min_thrust=scale**3 * rotor.min_thrust,
        )
        for rotor in QUAD.rotors
    )
    scaled = replace(QUAD, mass=scale**3 * QUAD.mass, inertia=scale**5 * QUAD.inertia, rotors=rotors)
    assert implausibilities(scaled) == ()


@pytest.mark.parametrize("mistake", MISTYPED)
def test_a_mistyped_value_is_told_by_its_field_and_the_unit_meant(mistake: str) -> None:
    vehicle, field, unit = MISTYPED[mistake]
    told = [sentence for sentence in implausibilities(vehicle) if field in sentence]
    assert len(told) == 1
    assert unit in told[0]
    assert told[0].isprintable()


def test_of_dead_rotors_without_which_nothing_hovers_the_doubt_leaves_the_vehicle_to_who_tells_it() -> None:
    dead = replace(QUAD.rotors[0], max_thrust=0.0)
    (doubt,) = implausibilities(replace(QUAD, rotors=(dead, *QUAD.rotors[1:])))
    assert doubt.startswith("rotors cannot hold a level hover without rotors[0]")


def test_a_suspicion_is_told_on_standard_error_and_in_the_report_and_refuses_nothing(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    suspicious, _, _ = MISTYPED["propeller of five"]
    write_vehicle(suspicious, "mine.toml")
    with suppress(SystemExit):
        cli.main(
            ["plan", "line", "--planner", "min-snap", "--vehicle", "mine.toml", "--out", "out/line", "--json"]
        )
    out, err = capsys.readouterr()
    (doubt,) = implausibilities(suspicious)
    assert json.loads(out)["warnings"] == [doubt]
    assert err == f"aerobat: warning: vehicle 'agile-quad': {doubt}\n"
    with suppress(SystemExit):
        cli.main(["check", "out/line", "--vehicle", "mine.toml"])
    assert capsys.readouterr().err == err
