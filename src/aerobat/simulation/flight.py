"""Flights: recorded motions of one or many vehicles over time, which can be saved, replayed and scored."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat import so3
from aerobat.arrays import Array, frozen
from aerobat.declaration import PathName, by_value, from_table, in_notebooks, shown, to_table, validated
from aerobat.environment import Environment
from aerobat.environment.obstacles import OBSTACLES, Obstacle
from aerobat.errors import OutOfRange, SpecError
from aerobat.problem.gate import Gate, GateWall
from aerobat.simulation.outcome import Contact, Outcome, counted
from aerobat.states import BodyState, FlatState, Setpoint, Wrench
from aerobat.storage import format_of, read_arrays, whole_file

_FORMAT = "aerobat-flight-2"
MAX_FLIGHT = 2**31  # largest size of a flight file [bytes]: hours of flight at 500 Hz
LOG_OF_COMMANDS = "log of commands"  # the engine of a recorded flight whose thrusts follow from its commands
_ROTORS = -1  # placeholder in a shape for the number of rotors


@dataclass(frozen=True)
class Series:
    """One quantity of a flight; its array has the shape ([vehicles,] [times,] *shape)."""

    name: str
    unit: str
    shape: tuple[int, ...] = ()
    per_vehicle: bool = True
    over_time: bool = True
    logical: bool = False
    part: str | None = None  # optional part of a flight to which the series belongs; None: in every flight


SERIES = (
    Series("position", "m", (3,)),
    Series("velocity", "m/s", (3,)),
    Series("q_world_body", "", (4,)),
    Series("omega_body", "rad/s", (3,)),
    Series("commands", "N", (_ROTORS,)),
    Series("thrusts", "N", (_ROTORS,)),
    Series("saturated", "", logical=True),
    Series("observed_position", "m", (3,), part="observer"),
    Series("observed_velocity", "m/s", (3,), part="observer"),
    Series("observed_q_world_body", "", (4,), part="observer"),
    Series("since_pose", "s", part="observer"),  # since the exposure of the last pose that the filter took
    Series("rate_setpoint", "rad/s", (3,), part="inner loop"),  # commanded to the inner loop, in effect
    Series("thrust_setpoint", "N", part="inner loop"),  # collective; commanded to the inner loop, in effect
    Series("contact", "", part="plant"),  # object that the vehicle touched, as a code of Contact
    Series("setpoint_position", "m", (3,), per_vehicle=False),
    Series("setpoint_velocity", "m/s", (3,), per_vehicle=False),
    Series("setpoint_acceleration", "m/s²", (3,), per_vehicle=False),
    Series("setpoint_jerk", "m/s³", (3,), per_vehicle=False),
    Series("setpoint_snap", "m/s⁴", (3,), per_vehicle=False),
    Series("setpoint_q_world_body", "", (4,), per_vehicle=False),
    Series("setpoint_omega_body", "rad/s", (3,), per_vehicle=False),
    Series("setpoint_omega_dot_body", "rad/s²", (3,), per_vehicle=False),
    Series("setpoint_thrust", "N", per_vehicle=False),
    Series("setpoint_moment_body", "N·m", (3,), per_vehicle=False),
    Series("min_thrusts", "N", (_ROTORS,), over_time=False),
    Series("max_thrusts", "N", (_ROTORS,), over_time=False),
    Series("ends", "s", over_time=False),  # time of the last row of each vehicle
)


@validated
@in_notebooks
@by_value
class Flight:
    """One flight, or a batch of flights, whose per-vehicle series carry a leading axis of vehicles.

    Row k of every series is the situation at `times[k]`: the true state, the thrusts that the rotors give,
    and the commands that the controller sends then and holds until the next row. Each series of SERIES is an
    attribute too, as `flight.thrusts`. Estimated states are present if a filter flew, rate set-points if an
    inner loop tracked body rates, and contacts if the plant detects them. A vehicle that diverges ends at its
    time in `ends`; in a batch its later rows repeat its last row. Raises SpecError for shapes that do not
    match and numbers that are not finite.
    """

    times: Array  # [s], (T,), rising
    series: Mapping[str, Array]  # by the names of SERIES
    vehicles: tuple[str, ...]  # their names
    outcomes: tuple[Outcome, ...]  # outcome of each vehicle
    sentences: tuple[str, ...]  # the outcomes as sentences with their numbers
    engine: str  # name of the engine, or of the plant, that flew them; of a recorded one, log
    environment: Environment

    def __post_init__(self) -> None:
        """Copy, check and write-protect the arrays."""
        times = frozen(self.times, "times", (None,))
        if times.ndim != 1 or (np.diff(times) <= 0).any():
            raise SpecError("times must be one list of rising numbers of seconds")
        parts = {one.part for one in SERIES if one.name in self.series}
        kept = [one for one in SERIES if one.part is None or one.part in parts]
        missing = [one.name for one in kept if one.name not in self.series]
        if missing:
            raise SpecError(f"a flight needs the series {missing[0]!r}; its names are those of SERIES")
        many, rotors = np.shape(self.series["ends"]), np.shape(self.series["max_thrusts"])[-1:]
        alike = len(self.vehicles) == len(self.outcomes) == len(self.sentences)
        if not rotors or not alike or many not in ((), (len(self.vehicles),)):
            raise SpecError("a flight needs rotors, and one end, name and outcome for each vehicle")
        checked = {}
        for one in kept:
            shape = tuple(rotors[0] if size == _ROTORS else size for size in one.shape)
            leading = (many if one.per_vehicle else ()) + (times.shape if one.over_time else ())
            checked[one.name] = _checked(one, self.series[one.name], leading + shape)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "series", MappingProxyType(checked))

    def __getattr__(self, name: str) -> NDArray[Any]:
        series: Mapping[str, Array] = self.__dict__.get("series", {})
        if not name.startswith("_") and name in series:
            return series[name]
        raise AttributeError(f"this flight has no {name!r}; its series are {', '.join(series)}")

    @property
    def kinds(self) -> tuple[Series, ...]:
        """The entries of SERIES that the flight has."""
        return tuple(one for one in SERIES if one.name in self.series)

    @property
    def is_observed(self) -> bool:
        """True where a filter estimated the state in flight."""
        return "since_pose" in self.series

    @property
    def has_inner_loop(self) -> bool:
        """True where an inner loop tracked body rates given by the controller."""
        return "rate_setpoint" in self.series

    @property
    def first_contact(self) -> tuple[Contact, float]:
        """The first contact of one vehicle and its time [s]; NOTHING and NaN where no contact was detected.

        Contacts at the start, as of a vehicle that stands on the ground, do not count until they have ended.
        """
        contact = self.series.get("contact", np.zeros(1))
        came = (contact > 0) & ~np.logical_and.accumulate(contact > 0)
        if not came.any():
            return Contact.NOTHING, np.nan
        first = int(np.argmax(came))
        return Contact(int(contact[first])), float(self.times[first])

    @cached_property
    def states(self) -> BodyState:
        """True states, (..., T, ·)."""
        return BodyState(**{name: self.series[name] for name in BodyState.__dataclass_fields__})

    @cached_property
    def setpoint(self) -> Setpoint:
        """Set-points of the trajectory (of the first vehicle, where vehicles differ), (T, ·)."""
        series = self.series
        flat = FlatState(**{name: series[f"setpoint_{name}"] for name in FlatState.__dataclass_fields__})
        wrench = Wrench(series["setpoint_thrust"], series["setpoint_moment_body"])
        own = ("q_world_body", "omega_body", "omega_dot_body")
        return Setpoint(flat=flat, wrench=wrench, **{name: series[f"setpoint_{name}"] for name in own})

    @cached_property
    def position_error(self) -> Array:
        """|p − p_ref| [m], (..., T)."""
        off = self.series["position"] - self.series["setpoint_position"]
        return np.asarray(np.linalg.norm(off, axis=-1))

    @cached_property
    def attitude_error(self) -> Array:
        """The angle between actual and reference attitude [rad], (..., T)."""
        return so3.angle_between(self.series["q_world_body"], self.series["setpoint_q_world_body"])

    def __str__(self) -> str:
        """Return one line about the flight or the batch."""
        about = f"{self.times[-1]:.3f} s in {len(self.times)} rows by the engine {self.engine}"
        if not self.is_batch:
            return f"{self.vehicles[0]}: {self.sentences[0]}; {about}"
        return f"{len(self.outcomes)} flights: {counted(self.outcomes)}; {about}"

    @property
    def is_batch(self) -> bool:
        """True for a batch, false for one flight."""
        return bool(self.series["ends"].ndim)

    @property
    def outcome(self) -> Outcome:
        """The outcome of one flight. Raises SpecError for a batch."""
        if self.is_batch:
            raise SpecError("outcome is asked of one flight; of a batch, ask flight[k].outcome or outcomes")
        return self.outcomes[0]

    @property
    def diverged_at(self) -> Array:
        """The time when the flight diverged [s], NaN if it did not, (1,). Raises SpecError for a batch."""
        return np.array([np.nan if self.outcome is Outcome.COMPLETE else self.series["ends"]])

    def __len__(self) -> int:
        """The number of vehicles."""
        return len(self.vehicles)

    @validated
    def __getitem__(self, vehicle: int) -> Flight:
        """Return one vehicle's flight of a batch, as if flown alone. Raises SpecError for one flight."""
        if not self.is_batch:
            raise SpecError("this is one flight, not a batch: use it without an index")
        if not -len(self) <= vehicle < len(self):
            raise OutOfRange(f"there are {len(self)} flights, no flight {shown(vehicle)}; count from 0")
        rows = slice(0, int(np.searchsorted(self.times, self.series["ends"][vehicle], side="right")))
        picked = {}
        for one in self.kinds:
            values = self.series[one.name][vehicle] if one.per_vehicle else self.series[one.name]
            picked[one.name] = values[rows] if one.over_time else values
        return Flight(
            times=self.times[rows],
            series=picked,
            vehicles=(self.vehicles[vehicle],),
            outcomes=(self.outcomes[vehicle],),
            sentences=(self.sentences[vehicle],),
            engine=self.engine,
            environment=self.environment,
        )

    @validated
    def save(self, path: PathName) -> None:
        """Write the flight as a NumPy .npz file, whole or not at all.

        The file's arrays: `times`; each series of SERIES; `vehicles`, `outcomes`, `sentences` and `engine` as
        text; `gravity`, `wind` and `ground` (NaN: none) of the environment; `obstacles`, if there are
        any, as JSON text, in which a gate's wall is stored as its gate; and `format`, "aerobat-flight-2".
        The file holds no pickles. Raises SpecError when the file cannot be written.
        """
        text = {"vehicles": self.vehicles, "sentences": self.sentences, "engine": self.engine}
        outcomes = [outcome.name for outcome in self.outcomes]
        ground = np.nan if self.environment.ground is None else self.environment.ground
        air: dict[str, Any] = {
            "gravity": self.environment.gravity,
            "wind": self.environment.wind,
            "ground": ground,
        }
        if self.environment.obstacles:
            air["obstacles"] = json.dumps(list(map(_obstacle_table, self.environment.obstacles)))
        arrays: dict[str, Any] = {**self.series, **text, **air, "times": self.times, "outcomes": outcomes}
        with whole_file(path) as temporary, temporary.open("wb") as file:
            np.savez(file, format=_FORMAT, **arrays)


@validated
def load_flight(path: PathName) -> Flight:
    """Read a flight that `Flight.save` wrote. Raises SpecError, one sentence, for any other file."""
    content = read_arrays(path, "flight", MAX_FLIGHT)
    try:
        if format_of(content) != _FORMAT:
            raise SpecError(f"it holds {format_of(content)}, not {_FORMAT}; fly it again")
        ground = float(content["ground"])
        return Flight(
            times=content["times"],
            series={one.name: content[one.name] for one in SERIES if one.name in content or one.part is None},
            vehicles=_texts(content["vehicles"]),
            outcomes=tuple(_outcome(name) for name in _texts(content["outcomes"])),
            sentences=_texts(content["sentences"]),
            engine=str(content["engine"]),
            environment=Environment(
                gravity=float(content["gravity"]),
                wind=content["wind"],
                ground=None if np.isnan(ground) else ground,
                obstacles=tuple(map(_obstacle, json.loads(str(content.get("obstacles", "[]"))))),
            ),
        )
    except KeyError as error:
        raise SpecError(f"flight file {path}: it has no array {error.args[0]!r}; save it again") from None
    except SpecError as error:
        raise SpecError(f"flight file {path}: {error}") from None
    except (TypeError, ValueError):  # arrays of wrong kinds or shapes
        raise SpecError(f"flight file {path}: it is damaged; save it again") from None


def _obstacle_table(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle as a table, as in problem files; the wall of a gate is stored as its gate."""
    return {"gate": to_table(obstacle.gate)} if isinstance(obstacle, GateWall) else to_table(obstacle)


def _obstacle(table: dict[str, Any]) -> Obstacle:
    return GateWall.of(from_table(Gate, table["gate"])) if "gate" in table else OBSTACLES.read(table)


def _outcome(name: str) -> Outcome:
    if name not in Outcome.__members__:
        raise SpecError(f"outcomes must be names of outcomes, got {shown(name)}; save it again")
    return Outcome[name]


def setpoint_series(setpoint: Setpoint) -> dict[str, Array]:
    """Return set-points as arrays by the names of SERIES."""
    parts = vars(setpoint) | vars(setpoint.flat) | vars(setpoint.wrench)
    return {f"setpoint_{name}": part for name, part in parts.items() if isinstance(part, np.ndarray)}


def _checked(series: Series, values: Array, shape: tuple[int, ...]) -> Array:
    if series.logical:
        array: Any = np.array(values, dtype=bool)
        array.flags.writeable = False
    else:
        array = frozen(values, series.name)
    if array.shape != shape:
        raise SpecError(f"{series.name} must have the shape {shape}, got {array.shape}")
    return np.asarray(array)


def _texts(array: NDArray[Any]) -> tuple[str, ...]:
    return tuple(str(text) for text in np.atleast_1d(array).tolist())
