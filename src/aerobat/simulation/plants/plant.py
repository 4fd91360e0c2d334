"""The interface to a plant of another simulator: its inputs and its outputs, tick by tick."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

from aerobat.environment.obstacles import Obstacle
from aerobat.kernels.motors import Airframe, VehicleState
from aerobat.kernels.ops import PerRotor, Vector
from aerobat.problem.gate import Gate
from aerobat.registry import Registry
from aerobat.simulation.outcome import Contact
from aerobat.vehicle.ellipsoid import Ellipsoid


@dataclass(frozen=True, eq=False)
class PlantScene:
    """One vehicle and the objects that it may touch, in the numbers of the kernels."""

    airframe: Airframe  # of the vehicle that really flies
    gravity: float  # [m/s²]
    ground: float | None  # [m] its height; None for no ground
    body: Ellipsoid  # the ellipsoid that encloses the vehicle
    gates: tuple[Gate, ...]
    obstacles: tuple[Obstacle, ...] = ()  # the walls of gates among them


class Actuation(NamedTuple):
    """The inputs of a plant from one tick to the next."""

    commands: PerRotor  # [N] rotor thrusts commanded and in effect
    wind: Vector  # [m/s] velocity of the air, world
    ceilings: PerRotor  # [N] the most that each rotor can give now


class PlantRun(Protocol):
    """A vehicle that flies in another simulator."""

    @property
    def motion(self) -> VehicleState:
        """The present state of the vehicle and the present thrusts [N] of its rotors."""

    @property
    def contact(self) -> Contact:
        """The object touched since the property was last read; of several, the highest code of Contact."""

    def advance(self, actuation: Actuation, duration: float) -> None:
        """Advance the simulation by `duration` [s] under held inputs."""


class Plant(ABC):
    """Another simulator's physics, in place of ours.

    A custom plant inherits from this class and is registered by `PLANTS.add("its-name", cls)`.
    """

    kind: ClassVar[str] = ""  # its name in settings, set when it is registered

    @abstractmethod
    def begin(self, scene: PlantScene, motion: VehicleState) -> PlantRun:
        """Return the vehicle of a scene at its start.

        Raises BackendMissing where the simulator is not installed, SpecError for an unsupported scene.
        """


PLANTS: Registry[Plant] = Registry(
    Plant,  # type: ignore[type-abstract]
    "plant",
    "aerobat.plants",
    {name: f"aerobat.simulation.plants.{name}" for name in ("mujoco", "rotorpy")},
)
