"""The layout of a vehicle's TOML file. Types and keys only: Rotor and Vehicle say which values may be."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix = Annotated[list[Vector], Field(min_length=3, max_length=3)]


def _rows(value: Any) -> str:
    return "matrix" if isinstance(value, list) and value and isinstance(value[0], list) else "vector"


class _Table(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


class RotorDefaults(_Table):
    """[rotor_defaults]: what all rotors share, unless a rotor says otherwise."""

    min_thrust: float | None = None
    max_thrust: float | None = None
    torque_coefficient: float | None = None
    lag: float | None = None
    radius: float | None = None


class RotorTable(RotorDefaults):
    """[[rotors]]: one rotor."""

    position_body: Vector
    spin: int


class VehicleTable(_Table):
    """A vehicle's file, SI units throughout."""

    name: str | None = None  # the file's name unless given
    description: str = ""
    mass: float
    inertia: Annotated[
        Annotated[Vector, Tag("vector")] | Annotated[Matrix, Tag("matrix")], Discriminator(_rows)
    ]  # principal moments along the body axes, or the whole matrix
    drag_body: Vector = [0.0, 0.0, 0.0]
    rotor_defaults: RotorDefaults = RotorDefaults()
    rotors: list[RotorTable]
