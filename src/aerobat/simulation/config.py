"""Settings of a flight."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, Any

import numpy as np
from pydantic import Field, PlainValidator

from aerobat.control import Controller
from aerobat.declaration import AS_IT_IS, FieldError, declared, shown
from aerobat.simulation.noise import StateNoise
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle

ControlRate = Annotated[float, Field(ge=1, le=1e6, description="number from 1 to 1e6")]
LogRate = Annotated[float, Field(ge=1e-3, le=1e6, description="number from 0.001 to 1e6")]


def _seed(value: Any) -> int | np.random.SeedSequence:
    if isinstance(value, np.random.SeedSequence):
        return value
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise FieldError("", f"must be a whole number, zero or more, or a SeedSequence, got {shown(value)}")
    return value


@declared
class FlightConfig:
    """Settings of a flight, whatever plan is flown."""

    controller: Controller = field(default_factory=Controller)
    rate: ControlRate = 500.0  # [1/s] of the controller
    noise: StateNoise | None = None  # errors of the state that the controller sees
    seed: Annotated[int | np.random.SeedSequence, PlainValidator(_seed)] = 0  # of the noise
    start: Annotated[BodyState, AS_IT_IS] | None = None  # true, by default the trajectory's; or a batch's
    nominal: Vehicle | None = None  # that controller and set-points are made for; by default what flies
    # floats, bytecode, numpy, compiled, jax, jax-float32, or the fastest that is installed
    engine: str = "auto"
    log_rate: LogRate | None = None  # [1/s] of the flight's rows, rate over a whole number; by default rate

    def __post_init__(self) -> None:
        stride = self.rate / (self.log_rate or self.rate)
        if stride < 1.0 or abs(stride - round(stride)) > 1e-6 * stride:
            complaint = f"must be rate ({self.rate:g}) over a whole number, got {self.log_rate}"
            raise FieldError("log_rate", complaint)

    @property
    def log_stride(self) -> int:
        """The ticks from one row of the log to the next."""
        return round(self.rate / (self.log_rate or self.rate))
