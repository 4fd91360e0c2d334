"""Conditions of flights: every preset's number has a source; files there and back; errors in a sentence."""

from dataclasses import replace
from importlib.resources import files
from math import radians
from pathlib import Path

import pytest
import tomli_w

from aerobat.environment import (
    Dispersion,
    Imu,
    MotionCapture,
    as_dispersion,
    dispersion_names,
    load_dispersion,
    write_dispersion,
)
from aerobat.errors import SpecError

PRESETS = files("aerobat.environment") / "presets"


def test_the_presets_are_found_by_name_and_say_what_they_are() -> None:
    assert dispersion_names() == ("field", "lab", "none")
    for name in dispersion_names():
        conditions = load_dispersion(name)
        assert conditions.name == name
        assert conditions.description in str(conditions)
        assert as_dispersion(name) == as_dispersion(conditions) == conditions


@pytest.mark.parametrize("name", dispersion_names())
def test_every_number_of_a_preset_has_its_source_beside_it(name: str) -> None:
    for line in (PRESETS / f"{name}.toml").read_text(encoding="utf-8").splitlines():
        value, _, comment = line.partition("#")
        if value.strip() and "=" in value and '"' not in value:
            source = comment.strip().rpartition("]")[2].strip()
            assert source.split(":")[0] in ("S", "MPU", "EuRoC", "as in lab") or source.startswith(
                "chosen"
            ), line


def test_none_is_a_flight_in_which_nothing_varies() -> None:
    assert replace(load_dispersion("none"), name="conditions", description="") == Dispersion()


def test_lab_has_the_spreads_and_sensors_that_were_studied() -> None:
    """1σ of 3 % mass, 10 % inertia, 3 % rotors, 25 % lag, 2 cm, 5 cm/s; 1 kHz, 1 mm, 0.3° at 100 Hz."""
    lab = load_dispersion("lab")
    assert (lab.mass, lab.inertia, lab.rotor, lab.lag) == (0.03, 0.10, 0.03, 0.25)
    assert (lab.start_position, lab.start_velocity) == (0.02, 0.05)
    assert lab.imu is not None
    assert lab.motion_capture is not None
    assert (lab.imu.rate, lab.imu.gyro_noise, lab.imu.accelerometer_noise) == (1000.0, 1e-3, 0.02)
    assert lab.imu.gyro_range == radians(2000.0)
    assert (lab.motion_capture.rate, lab.motion_capture.position_noise) == (100.0, 0.001)
    assert lab.motion_capture.attitude_noise == radians(0.3)


@pytest.mark.parametrize("name", dispersion_names())
def test_conditions_are_read_as_they_were_written(name: str, tmp_path: Path) -> None:
    write_dispersion(name, tmp_path / "mine.toml")
    assert load_dispersion(tmp_path / "mine.toml") == load_dispersion(name)


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ({"mass": -0.1}, "mass must be 0 or more, got -0.1"),
        ({"lag": 1.0}, "lag must be less than 1, got 1.0"),
        ({"imu": {"rate": 200.0}}, "motion_capture is missing; an observer takes it with imu"),
        ({"motion_capture": {}}, "imu is missing; an observer takes it with motion_capture"),
        ({"imu": {"gyro_nois": 0.1}}, "imu.gyro_nois is not a known key; did you mean 'gyro_noise'?"),
        (
            {"imu": {"accelerometer_range": 1.0, "accelerometer_range_g": 2.0}},
            "imu.accelerometer_range_g stands beside accelerometer_range; give one of them",
        ),
        (
            {"motion_capture": {"hand_off": {"normal": [0.0, 0.0, 0.0]}}},
            "motion_capture.hand_off.normal must be a direction, not the zero vector",
        ),
        ({"motion_capture": {"dropout": 1.5}}, "motion_capture.dropout must be 1 or less, got 1.5"),
        ({"motion_capture": {"outage": {"start": 1.0}}}, "motion_capture.outage.duration is missing; add it"),
        ({"battery": {"sag": 0.1}}, "battery.endurance is missing; add it"),
        ({"gusts": 3.0}, "gusts must be a Gusts, in a file a table, got 3.0"),
    ],
)
def test_what_does_not_fit_is_one_sentence_that_names_the_field(
    table: dict[str, object], sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(tomli_w.dumps(table), encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        load_dispersion(path)
    assert str(caught.value) == f"conditions file {path}: {sentence}"


def test_a_name_that_no_preset_has_is_met_with_the_closest_one() -> None:
    with pytest.raises(
        SpecError, match=r"no conditions named 'lap'; did you mean 'lab'\? Known: field, lab, none"
    ):
        load_dispersion("lap")


def test_ranges_in_degrees_and_in_g_are_the_same_ranges(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[imu]\ngyro_range_deg = 500.0\naccelerometer_range_g = 4.0\n[motion_capture]\n")
    assert load_dispersion(path) == Dispersion(
        "mine",
        imu=Imu(gyro_range=radians(500.0), accelerometer_range=4.0 * 9.81),
        motion_capture=MotionCapture(),
    )
