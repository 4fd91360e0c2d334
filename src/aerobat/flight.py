"""Flights: what vehicles did over time, as values that can be saved, replayed and scored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array, frozen
from aerobat.errors import SpecError
from aerobat.states import BodyState, FlatState, Setpoint, Wrench
from aerobat.storage import read_arrays, whole_file

COMPLETE = "flown to the end"  # the outcome of a flight that did not diverge
DIVERGED = 5.0  # [m] of position error: no controller is expected back from there
_OWN = ("times", "commands", "thrusts", "min_thrusts", "max_thrusts", "ends")
_REST = ("saturated", "outcomes", "vehicles", "engine")
_PREFIX = "setpoint_"
_FORMAT = "aerobat-flight-1"
_TRUTH = {"position": 3, "velocity": 3, "q_world_body": 4, "omega_body": 3}
_FLAT = ("position", "velocity", "acceleration", "jerk", "snap")
_ASKED = {"q_world_body": 4, "omega_body": 3, "omega_dot_body": 3}


@dataclass(frozen=True, eq=False)
class Flight:
    """One flight, or a batch of them: then the arrays marked ... carry a leading axis of vehicles.

    Row k of every series is the situation at `times[k]`: the true state, the thrusts that the rotors give,
    and the commands that the controller sends then and holds until the next row. A vehicle that diverges
    ends at its `ends`; in a batch its later rows repeat that one. Raises SpecError for shapes that do not
    match and numbers that are not finite.
    """

    times: Array  # [s], (T,), rising
    states: BodyState  # (..., T, ·)
    setpoint: Setpoint  # what the trajectory asked (of the first vehicle, where vehicles differ), (T, ·)
    commands: Array  # [N], within limits, (..., T, n)
    thrusts: Array  # [N], (..., T, n)
    saturated: NDArray[np.bool_]  # whether the limits changed the commands, (..., T)
    min_thrusts: Array  # [N], (..., n)
    max_thrusts: Array  # [N], (..., n)
    ends: Array  # [s] the last row of each flight, (...)
    outcomes: tuple[str, ...]  # a sentence for each vehicle
    vehicles: tuple[str, ...]  # their names
    engine: str  # which engine flew them

    def __post_init__(self) -> None:
        """Copy, check and write-protect."""
        times = frozen(self.times, "times", (None,))
        if times.ndim != 1 or (np.diff(times) <= 0).any():
            raise SpecError("times must be one list of rising numbers of seconds")
        many, rotors = np.shape(self.ends), np.shape(self.max_thrusts)[-1:]
        series = (*many, len(times))
        if not rotors or many not in ((), (len(self.vehicles),)) or len(self.vehicles) != len(self.outcomes):
            raise SpecError("a flight needs rotors, and one end, name and outcome for each vehicle")
        states = {k: _exact(getattr(self.states, k), k, (*series, n)) for k, n in _TRUTH.items()}
        saturated = np.array(self.saturated, dtype=bool)
        saturated.flags.writeable = False
        shapes = {
            "commands": (*series, *rotors),
            "thrusts": (*series, *rotors),
            "min_thrusts": (*many, *rotors),
            "max_thrusts": (*many, *rotors),
            "ends": many,
        }
        checked = {name: _exact(getattr(self, name), name, shape) for name, shape in shapes.items()}
        _require_shape(saturated.shape, "saturated", series)
        for name, value in (
            checked
            | {"times": times, "states": BodyState(**states), "saturated": saturated}
            | {"setpoint": _checked_setpoint(self.setpoint, len(times))}
            | {"outcomes": tuple(self.outcomes), "vehicles": tuple(self.vehicles)}
        ).items():
            object.__setattr__(self, name, value)

    @property
    def diverged(self) -> str | None:
        """The sentence that says when and why the flight diverged, None if it did not.

        Raises SpecError for a batch.
        """
        if self.ends.ndim:
            raise SpecError("diverged is asked of one flight; of a batch, ask flight[k].diverged")
        return None if self.outcomes[0] == COMPLETE else self.outcomes[0]

    def __getitem__(self, vehicle: int) -> Flight:
        """The flight of one vehicle of a batch, as if it had flown alone. Raises SpecError for one flight."""
        if not self.ends.ndim:
            raise SpecError("this is one flight, not a batch: use it without an index")
        rows = slice(0, int(np.searchsorted(self.times, self.ends[vehicle], side="right")))
        return Flight(
            times=self.times[rows],
            states=BodyState(**{k: getattr(self.states, k)[vehicle, rows] for k in _TRUTH}),
            setpoint=rows_of(self.setpoint, rows),
            commands=self.commands[vehicle, rows],
            thrusts=self.thrusts[vehicle, rows],
            saturated=self.saturated[vehicle, rows],
            min_thrusts=self.min_thrusts[vehicle],
            max_thrusts=self.max_thrusts[vehicle],
            ends=self.ends[vehicle],
            outcomes=(self.outcomes[vehicle],),
            vehicles=(self.vehicles[vehicle],),
            engine=self.engine,
        )

    def save(self, path: str | Path) -> None:
        """Write the flight as a NumPy .npz file, whole or not at all.

        Its arrays, named and shaped as here: times, commands, thrusts, saturated, min_thrusts, max_thrusts,
        ends, outcomes, vehicles, engine (the last three text); of the states position, velocity,
        q_world_body, omega_body; of the set-point setpoint_position, _velocity, _acceleration, _jerk, _snap,
        _q_world_body, _omega_body, _omega_dot_body, _thrust, _moment_body; and format, "aerobat-flight-1".
        No pickles. Raises SpecError when the file cannot be written.
        """
        arrays = (
            {k: getattr(self, k) for k in (*_OWN, *_REST)}
            | vars(self.states)
            | _setpoint_arrays(self.setpoint)
        )
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez(file, format=_FORMAT, **arrays)


def divergence(time: float, sound: bool) -> str:
    """The outcome of a flight that diverged at a time [s], its state still `sound` or no longer a number."""
    reason = f"position error above {DIVERGED:g} m" if sound else "its state is no longer a number"
    return f"diverged at {time:.2f} s: {reason}"


def load_flight(path: str | Path) -> Flight:
    """Read a flight that `Flight.save` wrote. Raises SpecError, one sentence, for any other file."""
    content = read_arrays(path, "flight")
    try:
        if str(content["format"]) != _FORMAT:
            raise SpecError(f"its format is {content['format']}, not {_FORMAT}")
        return Flight(
            **{k: content[k] for k in _OWN},
            saturated=content["saturated"].astype(bool),
            states=BodyState(**{k: content[k] for k in _TRUTH}),
            setpoint=_setpoint(content),
            outcomes=_sentences(content["outcomes"]),
            vehicles=_sentences(content["vehicles"]),
            engine=str(content["engine"]),
        )
    except KeyError as error:
        raise SpecError(f"flight file {path}: it has no array {error.args[0]!r}; save it again") from None
    except SpecError as error:
        raise SpecError(f"flight file {path}: {error}") from None


def _sentences(array: NDArray[np.generic]) -> tuple[str, ...]:
    return tuple(str(text) for text in np.atleast_1d(array).tolist())


def rows_of(setpoint: Setpoint, rows: slice | NDArray[np.intp]) -> Setpoint:
    """Some rows of a series of set-points."""
    return _setpoint({name: values[rows] for name, values in _setpoint_arrays(setpoint).items()})


def _setpoint_arrays(setpoint: Setpoint) -> dict[str, Array]:
    parts = {k: getattr(setpoint.flat, k) for k in _FLAT} | {k: getattr(setpoint, k) for k in _ASKED}
    parts |= vars(setpoint.wrench)
    return {_PREFIX + name: value for name, value in parts.items()}


def _setpoint(arrays: Mapping[str, Array]) -> Setpoint:
    flat = FlatState(**{k: arrays[_PREFIX + k] for k in _FLAT})
    wrench = Wrench(arrays[_PREFIX + "thrust"], arrays[_PREFIX + "moment_body"])
    return Setpoint(flat=flat, wrench=wrench, **{k: arrays[_PREFIX + k] for k in _ASKED})


def _checked_setpoint(setpoint: Setpoint, ticks: int) -> Setpoint:
    sizes: dict[str, tuple[int, ...]] = {k: (n,) for k, n in _ASKED.items()} | {"thrust": ()}
    return _setpoint(
        {
            name: _exact(value, name, (ticks, *sizes.get(name.removeprefix(_PREFIX), (3,))))
            for name, value in _setpoint_arrays(setpoint).items()
        }
    )


def _exact(value: Array, name: str, shape: tuple[int, ...]) -> Array:
    array = frozen(value, name)
    _require_shape(array.shape, name, shape)
    return array


def _require_shape(found: tuple[int, ...], name: str, wanted: tuple[int, ...]) -> None:
    if found != wanted:
        raise SpecError(f"{name} must have the shape {wanted}, got {found}")
