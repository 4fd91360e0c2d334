"""The interface to a plant of another simulator: its inputs and its answers, tick by tick."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

from aerobat.declaration import Registry
from aerobat.environment.obstacles import Obstacle
from aerobat.kernels.motors import Airframe, VehicleState
from aerobat.kernels.ops import PerRotor, Vector
from aerobat.problem.gate import Gate
from aerobat.simulation.outcome import Contact
from aerobat.vehicle.ellipsoid import Ellipsoid


@dataclass(frozen=True, eq=False)
class PlantScene:
    """One vehicle and what it may touch, in the numbers of the kernels."""

    airframe: Airframe  # what really flies
    gravity: float  # [m/s²]
    ground: float | None  # [m] its height; None for no ground
    body: Ellipsoid  # that encloses the vehicle
    gates: tuple[Gate, ...]
    obstacles: tuple[Obstacle, ...] = ()  # the walls of gates among them


class Actuation(NamedTuple):
    """The inputs of a plant from one tick to the next."""

    commands: PerRotor  # [N] of the rotors, that are in effect
    wind: Vector  # [m/s] velocity of the air, world
    ceilings: PerRotor  # [N] the most that each rotor can give now


class PlantRun(Protocol):
    """A vehicle in another simulator, on its way."""

    @property
    def motion(self) -> VehicleState:
        """The present state of the vehicle and the present thrusts [N] of its rotors."""

    @property
    def contact(self) -> Contact:
        """The vehicle's contact since the last look; of several the last one of Contact."""

    def advance(self, actuation: Actuation, duration: float) -> None:
        """Let some time [s] pass under what is held meanwhile."""


class Plant(ABC):
    """Another simulator's physics, in place of ours.

    A plant of one's own inherits from this class and is registered by `PLANTS.add("its-name", cls)`.
    """

    kind: ClassVar[str] = ""  # its name in settings, set when it is registered

    @abstractmethod
    def begin(self, scene: PlantScene, motion: VehicleState) -> PlantRun:
        """Return the vehicle of a scene at its start.

        Raises BackendMissing where the simulator is not installed, SpecError for what it has not.
        """


_ROOM = "aerobat.simulation.plants"
PLANTS: Registry[Plant] = Registry(
    Plant,  # type: ignore[type-abstract]
    "plant",
    "aerobat.plants",
    {"mujoco": f"{_ROOM}.mujoco", "rotorpy": f"{_ROOM}.rotorpy"},
)
