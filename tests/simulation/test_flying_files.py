"""Flights as files: what is saved is what is loaded, and nothing else loads."""

import os
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.simulation import Flight, fly, load_flight
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle

QUAD = load_vehicle("agile-quad")
RISE = Trajectory(np.array([0.1]), np.array([[[0, 0, 0], [0.1, 0, 0], [0, 0, 0.05]]], dtype=float))


def leaves(flight: Flight) -> dict[str, object]:
    """Every array and word of a flight by its name."""
    rest = {field.name: getattr(flight, field.name) for field in fields(flight) if field.name != "series"}
    air = rest.pop("environment")
    return rest | dict(flight.series) | {"gravity": air.gravity, "wind": air.wind, "ground": air.ground}


@pytest.mark.parametrize("vehicles", [QUAD, [QUAD], [QUAD] * 3], ids=["one", "batch of one", "batch"])
def test_a_flight_survives_saving_and_loading_bit_for_bit(vehicles, tmp_path: Path) -> None:
    flight = fly(RISE, vehicles, environment=Environment(wind=[0.5, 0.0, 0.0], ground=-1.0))
    flight.save(tmp_path / "flight.npz")
    again = load_flight(tmp_path / "flight.npz")
    assert leaves(again).keys() == leaves(flight).keys()
    for name, leaf in leaves(flight).items():
        np.testing.assert_array_equal(leaves(again)[name], leaf, err_msg=name)


def test_saving_replaces_the_file_as_a_whole_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "new" / "flight.npz"
    for vehicles in ([QUAD] * 2, QUAD):
        fly(RISE, vehicles).save(path)
    assert load_flight(path).states.position.ndim == 2
    assert os.listdir(path.parent) == ["flight.npz"]


def test_arrays_of_a_flight_cannot_be_written_to() -> None:
    flight = fly(RISE, QUAD)
    for array in (leaf for leaf in leaves(flight).values() if isinstance(leaf, np.ndarray)):
        assert not array.flags.writeable


def changed(**arrays: object) -> Callable[[Path], None]:
    """Write a flight's file with some arrays changed, or removed where they are None."""

    def write(path: Path) -> None:
        fly(RISE, QUAD).save(path)
        content = dict(np.load(path)) | arrays
        np.savez(path, **{name: array for name, array in content.items() if array is not None})

    return write


@pytest.mark.parametrize(
    ("write", "sentence"),
    [
        (lambda path: None, "there is no such file"),
        (lambda path: path.mkdir(), "this is a folder; give the path of a file"),
        (lambda path: path.write_bytes(b""), "not a whole .npz"),
        (lambda path: path.write_bytes(b"PK\x03\x04 torn"), "not a whole .npz"),
        (lambda path: path.write_text("time,x,y,z\n"), "not a whole .npz"),
        (lambda path: np.save(path.open("wb"), np.zeros(3)), "not a whole .npz"),
        (lambda path: np.savez(path, a=np.zeros(3)), "holds something else"),
        (lambda path: np.savez(path, format=np.array([{}], dtype=object)), "not a whole .npz"),
        (changed(format="aerobat-flight-1"), "holds aerobat-flight-1, not aerobat-flight-2; fly it again"),
        (changed(outcomes=["LANDED"]), "outcomes must be names of outcomes, got 'LANDED'"),
        (changed(thrusts=None), "no array 'thrusts'"),
        (changed(setpoint_jerk=None), "no array 'setpoint_jerk'"),
        (changed(position=np.zeros((3, 3))), "position must have the shape"),
        (changed(position=np.full((51, 3), np.nan)), "position must be numbers; it contains a NaN"),
        (changed(velocity="fast"), "velocity must be numbers"),
        (changed(times=np.zeros(51)), "times must be one list of rising"),
        (changed(saturated=np.zeros(3)), "saturated must have the shape"),
        (changed(saturated="never"), "saturated must have the shape"),
        (changed(outcomes=["COMPLETE"] * 2), "one end, name and outcome"),
        (changed(setpoint_thrust=np.zeros(7)), "setpoint_thrust must have the shape"),
        (changed(max_thrusts=6.0), "a flight needs rotors"),
    ],
)
def test_a_broken_file_is_refused_in_one_sentence(
    write: Callable[[Path], None], sentence: str, tmp_path: Path
) -> None:
    path = tmp_path / "flight.npz"
    write(path)
    with pytest.raises(SpecError, match=sentence) as caught:
        load_flight(path)
    assert str(caught.value).startswith(f"flight file {path}: ")
    assert "\n" not in str(caught.value)


def test_a_flight_of_mismatched_arrays_cannot_be_made() -> None:
    flight = fly(RISE, QUAD)
    with pytest.raises(SpecError, match="position must have the shape"):
        replace(flight, series={**flight.series, "position": np.zeros((2, 3))})


def test_one_flight_is_no_batch_and_a_batch_no_flight() -> None:
    flight, batch = fly(RISE, QUAD), fly(RISE, [QUAD, QUAD])
    with pytest.raises(SpecError, match="one flight, not a batch"):
        flight[0]
    with pytest.raises(SpecError, match=r"flight\[k\]\.outcome"):
        batch.outcome  # noqa: B018
    assert isinstance(batch[1], Flight)
    assert len(list(batch)) == 2


def test_each_series_of_the_table_is_an_attribute_and_nothing_else_is() -> None:
    flight = fly(RISE, QUAD)
    for series in flight.kinds:
        assert getattr(flight, series.name) is flight.series[series.name]
    np.testing.assert_array_equal(flight.states.velocity, flight.velocity)
    np.testing.assert_array_equal(flight.setpoint.wrench.thrust, flight.setpoint_thrust)
    with pytest.raises(AttributeError, match="this flight has no 'thrust'; its series are position"):
        flight.thrust  # noqa: B018
