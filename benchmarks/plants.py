"""Every preset maneuver in MuJoCo and RotorPy beside our own simulation; RotorPy's controller beside ours."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import aerobat as ab
from aerobat.simulation.plants.rotorpy import RotorPy, rotorpy_vehicle

sys.path.append(str(Path(__file__).parents[1] / "examples"))
from flat_outputs import FlatOutputs

MANEUVERS = ("line", "flip-roll", "flip-pitch", "flip-roll-translation", "half-flip")
VEHICLES = ("agile-quad", "hexarotor")
CONTROL_RATE = 500.0  # [1/s]
LOST = 5.0  # [m] of error


@dataclass(frozen=True)
class Flown:
    """A flight in another simulator beside our own."""

    own: ab.Flight
    other: ab.Flight
    cost: float  # [s] of the processor

    @property
    def row(self) -> list[str]:
        """In words."""
        apart = np.linalg.norm(self.other.position - self.own.position, axis=-1).max()
        errors = [f"{100 * flight.position_error.max():.2f} cm" for flight in (self.own, self.other)]
        return [
            *errors,
            f"{1e3 * apart:.2g} mm",
            self.other.first_contact[0].name.lower(),
            f"{self.cost:.2f} s",
        ]


def flown(plan: ab.Plan, plant: str) -> Flown:
    own, begun = ab.fly(plan), time.process_time()
    return Flown(own, ab.fly(plan, plant=plant), time.process_time() - begun)


def beside_our_own() -> Table:
    table = Table("vehicle", "maneuver", "plant", "own error", "its error", "apart", "contact", "cost")
    for vehicle in VEHICLES:
        for name in MANEUVERS:
            plan = ab.plan(name, ab.Miqp(order=4), vehicle)
            for plant in ("mujoco", "rotorpy") if vehicle == "agile-quad" else ("mujoco",):
                table.add_row(vehicle, name, plant, *flown(plan, plant).row)
    return table


def rotorpys_own_controller(plan: ab.Plan) -> float:
    """The largest error [m] of RotorPy's controller on a plan, in RotorPy's hummingbird."""
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    wanted, controller = FlatOutputs(plan), SE3Control(quad_params)
    hover = np.sqrt(quad_params["mass"] * 9.81 / (4 * quad_params["k_eta"]))
    state = {
        "x": wanted.update(0.0)["x"],
        "v": np.zeros(3),
        "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "w": np.zeros(3),
        "wind": np.zeros(3),
        "rotor_speeds": np.full(4, hover),
    }
    vehicle, errors = Multirotor(quad_params, state), []
    for tick in range(round(plan.duration * CONTROL_RATE)):
        at = wanted.update(tick / CONTROL_RATE)
        errors.append(np.linalg.norm(state["x"] - at["x"]))
        if errors[-1] > LOST:
            return math.inf
        state = vehicle.step(state, controller.update(tick / CONTROL_RATE, state, at), 1.0 / CONTROL_RATE)
    return float(max(errors))


def controllers() -> Table:
    table = Table("maneuver, reserve 0.05", "ours", "RotorPy's SE3Control")
    hummingbird = rotorpy_vehicle("hummingbird")
    for name in MANEUVERS:
        plan = ab.plan(name, ab.Miqp(order=4, reserve=0.05), hummingbird)
        ours = ab.fly(plan, plant=RotorPy(vehicle="hummingbird")).position_error.max()
        its = rotorpys_own_controller(plan)
        table.add_row(name, f"{100 * ours:.1f} cm", f"{100 * its:.1f} cm" if its < LOST else "lost")
    return table


if __name__ == "__main__":
    console = Console(width=120)
    console.print(beside_our_own())
    console.print("RotorPy's hummingbird, with its aerodynamics, which no controller is told:")
    console.print(controllers())
