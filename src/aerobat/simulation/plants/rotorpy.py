"""RotorPy as a plant: its multirotor with aerodynamics, under our controller.

Source: Folk, Paulos, Kumar, "RotorPy: A Python-based Multirotor Simulator with Aerodynamics for Education and
Research", 2023.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PlainValidator

from aerobat.arrays import Array
from aerobat.declaration import FieldError, shown, validated
from aerobat.errors import SpecError, import_extra
from aerobat.kernels.motors import Airframe, VehicleState
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.outcome import Contact
from aerobat.simulation.plants.plant import PLANTS, Actuation, Plant, PlantScene
from aerobat.vehicle import Rotor, Vehicle

GRAVITY = 9.81  # [m/s²] hard-coded in RotorPy
_GRAVITY_SPREAD = 0.05  # [m/s²] by which gravity differs between places on Earth
_ROTORS = 4  # RotorPy inverts a square allocation
_THRUST_COEFFICIENT = 1e-5  # [N/(rad/s)²] arbitrary: it cancels, since rotors are specified by their thrusts
_MIN_LAG = 1e-3  # [s] RotorPy's integrator needs a lag


def _vehicle_name(value: Any) -> str | None:
    if value is None or (isinstance(value, str) and value.isidentifier()):
        return value
    raise FieldError("", f"must be a name of RotorPy's vehicles, such as hummingbird, got {shown(value)}")


class RotorPy(Plant):
    """RotorPy's multirotor; needs the package rotorpy.

    The rotors' speeds, not their thrusts, follow with a lag. RotorPy has no contacts.
    """

    # one of RotorPy's own with drag, lift and flapping, as hummingbird; left out, made from the vehicle
    vehicle: Annotated[str | None, PlainValidator(_vehicle_name)] = None

    def begin(self, scene: PlantScene, motion: VehicleState) -> RotorPyRun:
        """Return the vehicle of a scene at its start.

        Raises BackendMissing without RotorPy, SpecError unless there are four rotors and Earth's gravity.
        """
        if len(motion.thrusts) != _ROTORS:
            raise SpecError(
                f"the plant rotorpy flies vehicles of 4 rotors, this one has {len(motion.thrusts)}"
            )
        if abs(scene.gravity - GRAVITY) > _GRAVITY_SPREAD:
            raise SpecError(f"the plant rotorpy knows gravity of {GRAVITY} m/s² only, got {scene.gravity:g}")
        own = None if self.vehicle is None else _parameters(self.vehicle)
        return RotorPyRun(own or _parameters_of(scene.airframe), motion)


PLANTS.add("rotorpy", RotorPy)


class RotorPyRun:
    """A vehicle that flies in RotorPy; see `PlantRun`."""

    def __init__(self, parameters: Mapping[str, Any], motion: VehicleState) -> None:
        body = motion.body
        self._thrust_coefficient = parameters["k_eta"]
        w, x, y, z = body.q_world_body
        self._state = {
            "x": np.array(body.position),
            "v": np.array(body.velocity),
            "q": np.array([x, y, z, w]),
            "w": np.array(body.omega_body),
            "wind": np.zeros(3),
            "rotor_speeds": self._speeds(motion.thrusts),
        }
        self._vehicle = _import_multirotor().Multirotor(
            parameters, self._state, "cmd_motor_speeds", integrator_kwargs={"rtol": 1e-7, "atol": 1e-9}
        )

    @property
    def motion(self) -> VehicleState:
        """See `PlantRun.motion`."""
        position, velocity, q, omega = (tuple(self._state[name].tolist()) for name in "xvqw")
        x, y, z, w = q
        thrusts = self._thrust_coefficient * self._state["rotor_speeds"] ** 2
        return VehicleState(Body(position, velocity, (w, x, y, z), omega), tuple(thrusts.tolist()))

    @property
    def contact(self) -> Contact:
        """The contact, always NOTHING: RotorPy has no contacts."""
        return Contact.NOTHING

    def advance(self, actuation: Actuation, duration: float) -> None:
        """See `PlantRun.advance`."""
        self._state["wind"] = np.array(actuation.wind)
        speeds = self._speeds(np.minimum(actuation.commands, actuation.ceilings))
        self._state = self._vehicle.step(self._state, {"cmd_motor_speeds": speeds}, duration)

    def _speeds(self, thrusts: ArrayLike) -> Array:
        """Return the speeds [rad/s] of rotors that give these thrusts [N] at rest."""
        return np.asarray(np.sqrt(np.maximum(thrusts, 0.0) / self._thrust_coefficient))


@validated
def rotorpy_vehicle(name: str) -> Vehicle:
    """Return one of RotorPy's vehicles as ours, its rotor drag linearized at hover, without parasitic drag.

    Args:
        name: of a module of parameters in RotorPy, as "hummingbird" or "crazyflie".

    Raises SpecError for a name that RotorPy does not know, BackendMissing without RotorPy.
    """
    given = _parameters(name)
    coefficient = given["k_eta"]
    hover = np.sqrt(given["mass"] * GRAVITY / (given["num_rotors"] * coefficient))
    drag = given["num_rotors"] * hover * np.array([given["k_d"], given["k_d"], given["k_z"]])
    products = [[given["Ixx"], given["Ixy"], given["Ixz"]], [0.0, given["Iyy"], given["Iyz"]]]
    inertia = np.array([*products, [0.0, 0.0, given["Izz"]]])
    low, high = (coefficient * given[f"rotor_speed_{end}"] ** 2 for end in ("min", "max"))
    rotors = tuple(
        Rotor(
            position_body=position,
            spin=-1 if direction > 0 else 1,
            min_thrust=low,
            max_thrust=high,
            torque_coefficient=given["k_m"] / coefficient,
            lag=given["tau_m"],
            radius=given["rotor_radius"],
        )
        for position, direction in zip(given["rotor_pos"].values(), given["rotor_directions"], strict=True)
    )
    return Vehicle(
        name=name,
        mass=given["mass"],
        inertia=inertia + inertia.T - np.diag(np.diag(inertia)),
        rotors=rotors,
        drag_body=drag,
        description=f"RotorPy's {name}, from its module {name}_params",
    )


def _parameters_of(airframe: Airframe) -> dict[str, Any]:
    """Return RotorPy's parameters of an airframe. Raises SpecError where RotorPy cannot model it."""
    properties, rotors = airframe
    collective, mx, my, mz = np.array(rotors.allocation)
    if min(rotors.min_thrust) < 0.0:
        raise SpecError("the plant rotorpy knows no thrust below 0; give every rotor a min_thrust of 0")
    if (collective != 1.0).any():
        raise SpecError(
            "the plant rotorpy knows rotors of one kind only; leave `rotor` out of the conditions"
        )
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = properties.inertia
    torque = np.abs(mz).max()
    hover = np.sqrt(properties.mass * GRAVITY / (_ROTORS * _THRUST_COEFFICIENT))
    dx, dy, dz = np.array(properties.drag_body) / (_ROTORS * hover)
    return {
        "mass": properties.mass,
        **{"Ixx": xx, "Iyy": yy, "Izz": zz, "Ixy": xy, "Ixz": xz, "Iyz": yz},
        "num_rotors": _ROTORS,
        "rotor_pos": {f"r{i + 1}": np.array([-my[i], mx[i], 0.0]) for i in range(_ROTORS)},
        "rotor_directions": mz / torque,
        "rotor_speed_min": np.sqrt(np.array(rotors.min_thrust) / _THRUST_COEFFICIENT),
        "rotor_speed_max": np.sqrt(np.array(rotors.max_thrust) / _THRUST_COEFFICIENT),
        "k_eta": _THRUST_COEFFICIENT,
        "k_m": torque * _THRUST_COEFFICIENT,
        "k_d": (dx + dy) / 2,
        "k_z": dz,
        "tau_m": np.maximum(1.0 / np.array(rotors.inverse_time_constant), _MIN_LAG),
    }


def _parameters(name: str) -> dict[str, Any]:
    """Return the parameters of a vehicle of RotorPy. Raises SpecError for a vehicle that RotorPy lacks."""
    _import_multirotor()
    try:
        parameters: dict[str, Any] = import_module(f"rotorpy.vehicles.{name}_params").quad_params
    except (ImportError, AttributeError):
        raise SpecError(f"RotorPy has no vehicle {name!r} of four rotors; take hummingbird, say") from None
    return parameters


def _import_multirotor() -> Any:
    return import_extra("rotorpy.vehicles.multirotor", "the plant rotorpy needs RotorPy", "rotorpy")
