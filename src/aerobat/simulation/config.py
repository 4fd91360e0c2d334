"""Settings of a flight."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Annotated, Any, TypedDict

from pydantic import Field, PlainValidator

from aerobat.control import ControlLaw, Controller, as_controller, named_controller
from aerobat.declaration import AS_IT_IS, FieldError, Seed, declared, shown
from aerobat.environment import Dispersion, as_dispersion
from aerobat.environment.sensors import SensorRate
from aerobat.errors import SpecError
from aerobat.simulation.flight_controller import AUTOPILOTS, Autopilot
from aerobat.simulation.plants import PLANTS, Plant
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle, as_vehicle

MAX_FLIGHTS = 10_000_000  # under conditions
LogRate = Annotated[float, Field(ge=1e-3, le=1e6, description="number from 0.001 to 1e6")]


def _or_named(cls: type, named: Callable[[str], Any]) -> PlainValidator:
    """Return the validator of an instance of a class, of its name or the path of its file, or of None."""

    def made(value: Any) -> Any:
        if value is None or isinstance(value, cls):
            return value
        if isinstance(value, str | os.PathLike):
            return named(os.fspath(value))
        raise FieldError("", f"must be a {cls.__name__} or the name of one, got {shown(value)}")

    return PlainValidator(made)


def _flights(value: Any) -> range | None:
    flights = range(value) if isinstance(value, int) and not isinstance(value, bool) else value
    if value is None:
        return None
    if not isinstance(flights, range) or not flights or min(flights[0], flights[-1]) < 0:
        raise FieldError("", f"must be a whole number of flights, or a range of theirs, got {shown(value)}")
    if max(flights[0], flights[-1]) >= MAX_FLIGHTS:
        raise FieldError("", f"must be {MAX_FLIGHTS} flights at most, got {shown(value)}")
    return flights


class FlightChanges(TypedDict, total=False):
    """Fields of FlightConfig that replace those of a given one; each as FlightConfig has it, or a name."""

    controller: Controller | ControlLaw | str | None
    rate: float
    conditions: Dispersion | str | None
    seed: int
    flights: range | int | None
    start: BodyState | None
    nominal: Vehicle | str | None
    engine: str
    plant: Plant | str | None
    autopilot: Autopilot | str | None
    log_rate: float | None


@declared
class FlightConfig:
    """Settings of a flight, whatever plan is flown.

    Raises SpecError for `flights` without `conditions`, and for `conditions` beside `start` or `nominal`,
    both of which conditions determine.
    """

    # controller settings, a control law, or a name (full, paper, lee, …); by default the nominal vehicle's
    controller: Annotated[Controller | ControlLaw | str | None, PlainValidator(as_controller)] = None
    rate: SensorRate = 500.0  # [1/s] of the controller, unless the conditions set it
    # realistic variations, disturbances and sensors; left out, the flight is ideal
    conditions: Annotated[Dispersion | None, _or_named(Dispersion, as_dispersion)] = None
    seed: Seed = 0  # of the draws from conditions
    # number of flights under conditions, or a range of their numbers; left out, flight 0 alone
    flights: Annotated[range | None, PlainValidator(_flights)] = None
    start: Annotated[BodyState, AS_IT_IS] | None = None  # initial state or states; by default the path's
    # the vehicle, or its name, that controller and set-points are made for; by default the one that flies
    nominal: Annotated[Vehicle | None, _or_named(Vehicle, as_vehicle)] = None
    # floats, compiled, jax, jax-float32, or auto: the fastest for this number of ticks
    engine: str = "auto"
    # external simulator in place of the built-in plant, or its name, mujoco or rotorpy; flies one vehicle
    plant: Annotated[Plant | None, PlainValidator(PLANTS.instance)] = None
    # firmware in place of the inner loop's model, or its name, betaflight; flies one vehicle
    autopilot: Annotated[Autopilot | None, PlainValidator(AUTOPILOTS.instance)] = None
    log_rate: LogRate | None = None  # [1/s] of logged rows: rate over a whole number; by default rate

    def __post_init__(self) -> None:
        if self.conditions is None:
            if self.flights is not None:
                raise FieldError("flights", "are drawn from conditions; give conditions too")
        elif self.start is not None or self.nominal is not None:
            name = "start" if self.start is not None else "nominal"
            raise FieldError(name, "comes of the conditions; leave it out, or leave out conditions")
        if self.autopilot is not None and (self.law is None or not self.law.GIVES_RATES):
            raise FieldError(
                "autopilot", "holds rates, which a controller gives it; fly by controller='rates'"
            )
        stride = self.control_rate / self.rows_rate
        if stride < 1.0 or abs(stride - round(stride)) > 1e-6 * stride:
            complaint = f"must be {self.control_rate:g} 1/s over a whole number, got {self.log_rate}"
            raise FieldError("log_rate", complaint)

    @property
    def control_rate(self) -> float:
        """The rate of the controller [1/s]."""
        requested = None if self.conditions is None else self.conditions.control_rate
        return requested or self.rate

    def changed(self, changes: FlightChanges) -> FlightConfig:
        """Return the settings with some of them replaced. Raises SpecError for unknown ones."""
        fields: Any = changes
        return replace(self, **fields)

    @property
    def law(self) -> ControlLaw | None:
        """The control law requested in place of the tracking controller; None for the tracking controller."""
        requested = self.controller if self.controller is not None or self.autopilot is None else "rates"
        found = named_controller(requested) if isinstance(requested, str) else requested
        return found if isinstance(found, ControlLaw) else None

    def controller_of(self, nominal: Sequence[Vehicle]) -> Controller:
        """Return the requested settings, or those of the nominal vehicles.

        Raises SpecError for nominal vehicles with different settings.
        """
        if isinstance(self.controller, Controller):
            return self.controller
        if any(vehicle.controller != nominal[0].controller for vehicle in nominal[1:]):
            raise SpecError(
                "controller: these vehicles have different ones; give one for all, or fly them apart"
            )
        own = nominal[0].controller
        named = named_controller(self.controller, own) if isinstance(self.controller, str) else own
        return named if isinstance(named, Controller) else own

    @property
    def rows_rate(self) -> float:
        """The rate of the flight's rows [1/s]."""
        return self.log_rate or self.control_rate
