"""gradient(): how the errors of a flight change with gains, vehicle and start, exact to rounding."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from itertools import repeat
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from aerobat import engines, so3
from aerobat.arrays import Array
from aerobat.closed_loop import Given, Judged, Prepared, added_up, prepare
from aerobat.documents import unknown_name
from aerobat.engines.batch import ArrayOps
from aerobat.engines.duals import Dual, DualOps, differentiated, dual
from aerobat.engines.engine import Init, Step
from aerobat.engines.packing import body_states, components, controller_models
from aerobat.engines.trees import Tree, leaves, refilled
from aerobat.errors import SpecError
from aerobat.kernels.controller import Controller, Gains
from aerobat.kernels.integrator import Airframe
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import dot, subtract
from aerobat.simulation import StateNoise
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

# the lead's filter also sets how far ahead set-points are read, which may jump from piece to piece
_GAINS = tuple(f.name for f in fields(Controller) if f.type == "float" and f.name != "lead_time_constant")
_EACH_ROTOR = 0
_SHAPES: Mapping[str, tuple[int, ...]] = {
    **dict.fromkeys(_GAINS, ()),
    "mass": (),
    "inertia": (3, 3),
    "drag_body": (3,),
    "rotors.position_body": (_EACH_ROTOR, 3),
    "rotors.min_thrust": (_EACH_ROTOR,),
    "rotors.max_thrust": (_EACH_ROTOR,),
    "rotors.torque_coefficient": (_EACH_ROTOR,),
    "rotors.lag": (_EACH_ROTOR,),
    "start.position": (3,),
    "start.velocity": (3,),
    "start.attitude": (3,),
    "start.omega_body": (3,),
}


@dataclass(frozen=True, eq=False)
class Gradient:
    """A number that a flight comes to, and its slopes in named quantities.

    Of a batch, all arrays have a leading axis of vehicles.
    """

    value: Array  # (...)
    slopes: Mapping[str, Array]  # by the quantity's name, (..., *its shape), in its unit


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """The errors of a flight against its set-points, and how they change."""

    mean_square_position_error: Gradient  # [m²] over the ticks up to the end or divergence, as in a score
    mean_square_attitude_error: Gradient  # [rad²] likewise
    final_square_position_error: Gradient  # [m²] at the last tick; NaN for a vehicle that has diverged


class _Sums(NamedTuple):
    """What the loop tells."""

    square: Scalar  # [m²]
    square_angle: Scalar  # [rad²]
    final_square: Scalar  # [m²]
    ticks: Scalar
    flying: Scalar


def gradient(
    trajectory: Trajectory,
    vehicle: Vehicle | Sequence[Vehicle],
    of: str | Sequence[str],
    *,
    yaw: float = 0.0,
    controller: Controller = Controller(),  # noqa: B008 - frozen
    rate: float = 500.0,
    start: BodyState | None = None,
    noise: StateNoise | None = None,
    seed: int | np.random.SeedSequence = 0,
    engine: str = "auto",
    model: Vehicle | None = None,
) -> Sensitivity:
    """Fly as `fly` does with the same arguments, and differentiate the flight's errors.

    `of` names quantities: a gain of Controller (all but lead_time_constant); of the vehicle that flies "mass",
    "inertia", "drag_body"; of each of its rotors "rotors.position_body", "rotors.min_thrust",
    "rotors.max_thrust", "rotors.torque_coefficient", "rotors.lag"; "start.position", "start.velocity",
    "start.attitude" (a rotation [rad] about body axes), "start.omega_body". Slopes in the inertia are for
    its entries one by one, half for each of a mirrored pair: an error changes by Σ slope_ij dJ_ij.

    The controller's model and the set-points are held: the slope in the mass is what a mass does that the
    controller does not know of, as in `fly(..., vehicle, model=...)` with `vehicle` alone changed.

    Slopes are those of the simulation as it is computed, by dual numbers, not differences of two flights.
    Where it has a kink, as where a rotor's command just meets its limit, they are those of one side. They say
    nothing of jumps, as of the tick at which a vehicle diverges. Raises SpecError for an unknown quantity
    and for arguments that do not fit together, BackendMissing for an engine that is not installed.
    """
    names = _known((of,) if isinstance(of, str) else tuple(of))
    flight = prepare(
        trajectory,
        vehicle,
        yaw=yaw,
        controller=controller,
        rate=rate,
        start=start,
        noise=noise,
        seed=seed,
        model=model,
    )
    shapes = [tuple(n or len(flight.vehicles[0].rotors) for n in _SHAPES[name]) for name in names]
    moves = [
        leaves(_moved(flight, controller, name, unit))
        for name, shape in zip(names, shapes, strict=True)
        for unit in _units(shape)
    ]
    values, slopes = _flown(flight, moves, engine)
    return _sensitivity(values, slopes, dict(zip(names, shapes, strict=True)), flight.batch)


def _known(names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        raise SpecError("of must name at least one quantity, such as 'position_gain' or 'mass'")
    for name in names:
        if name == "lead_time_constant":
            raise SpecError(
                "lead_time_constant has no slope: it also moves where set-points are read, and they jump"
            )
        if name not in _SHAPES:
            raise unknown_name("differentiable quantity", str(name), _SHAPES)
    return tuple(dict.fromkeys(names))


def _units(shape: tuple[int, ...]) -> Iterator[Array]:
    """Each entry of a quantity by itself."""
    size = int(np.prod(shape))
    return (row.reshape(shape) for row in np.eye(size))


def _flown(flight: Prepared, moves: Sequence[list[Array]], engine: str) -> tuple[_Sums, _Sums]:
    """What the loop tells in the end, and its slopes; leaves (vehicles, directions).

    Each vehicle flies once for each direction, side by side.
    """
    directions, vehicles = len(moves), len(flight.vehicles)
    parameters, inputs = flight.judged(None)
    along = [np.stack(each, axis=-1).ravel() for each in zip(*moves, strict=True)]
    no_slopes = tuple(() for _ in leaves(inputs))
    held = tuple(() for _ in leaves(parameters[1]))
    chosen = engines.choose(engine, vehicles * directions, len(flight.times))
    told = chosen.scan(
        *differentiated(*_summed(*added_up(*flight.loop))),
        (_repeated(parameters, directions), (*(x if x.any() else () for x in along), *held)),
        (_repeated(inputs, directions), no_slopes),
        len(flight.times),
    )
    values, slopes = (_Sums(*(x[:, -1].reshape(vehicles, directions) for x in half)) for half in told)
    return values, slopes


def _repeated(tree: Tree, directions: int) -> Tree:
    """Leaves (vehicles,) and (ticks, vehicles) with each vehicle as often as there are directions."""
    shared = isinstance(tree, Judged)
    every = (x if shared and x.ndim == 1 else np.repeat(x, directions, axis=-1) for x in leaves(tree))
    return refilled(tree, every)


@lru_cache(maxsize=32)
def _summed(init: Init, step: Step) -> tuple[Init, Step]:
    """The loop that tells sums, of one that tells tallies."""

    def advance(ops: Ops, parameters: Tree, carry: Tree, tick: Judged) -> tuple[Tree, _Sums]:
        carry, tally = step(ops, parameters, carry, tick)
        # of a flight without a gate, the offset is from the origin
        error = subtract(tally.last.offset, tick.asked.position)
        sums = (tally.sum_square, tally.sum_square_angle, dot(error, error), tally.ticks, tally.flying)
        return carry, _Sums(*sums)

    return init, advance


def _sensitivity(
    values: _Sums, slopes: _Sums, shapes: Mapping[str, tuple[int, ...]], batch: bool
) -> Sensitivity:
    ticks = np.maximum(values.ticks, 1.0)
    ended = np.where(values.flying > 0.5, 1.0, np.nan)
    cuts = np.cumsum([int(np.prod(shape)) for shape in shapes.values()])[:-1]

    def part(value: Array, slope: Array) -> Gradient:
        named = zip(shapes.items(), np.split(slope, cuts, axis=1), strict=True)
        by_name = {name: each(x.reshape(-1, *shape)) for (name, shape), x in named}
        return Gradient(each(value[:, 0]), MappingProxyType(by_name))

    def each(array: Array) -> Array:
        own = np.array(array if batch else array[0])
        own.flags.writeable = False  # a diverged vehicle's may be no numbers
        return own

    return Sensitivity(
        part(values.square / ticks, slopes.square / ticks),
        part(values.square_angle / ticks, slopes.square_angle / ticks),
        part(values.final_square * ended, slopes.final_square * ended),
    )


def _moved(flight: Prepared, controller: Controller, name: str, unit: Array) -> Given:
    """How what is given to the loop changes with a quantity, along `unit`; leaves (vehicles,)."""
    vehicles = len(flight.vehicles)
    still: Given = refilled(flight.given, map(np.zeros, repeat(vehicles)))
    if name in _GAINS:
        gains = _gains(controller, flight.believed, name)
        return still._replace(model=still.model._replace(gains=gains))
    if name.startswith("start."):
        return still._replace(start=_start(still.start, flight.given.start, name, unit))
    if name.startswith("rotors."):
        return still._replace(airframe=_rotors(still.airframe, flight.vehicles, name, unit))
    return still._replace(airframe=_inertial(still.airframe, flight.vehicles, name, unit))


def _gains(controller: Controller, believed: Sequence[Vehicle], name: str) -> Gains:
    number: Any = Dual(getattr(controller, name), 1.0)
    gains = controller_models(replace(controller, **{name: number}), believed, DualOps(ArrayOps)).gains
    slopes = (dual(gain).slope for gain in gains)
    return Gains(*(np.zeros(len(believed)) if x is None else x + np.zeros(len(believed)) for x in slopes))


def _start(still: Body, start: Body, name: str, unit: Array) -> Body:
    if name == "start.attitude":  # q ⊗ exp(φ) ≈ q + ½ q ⊗ (0, φ)
        q = body_states(start).q_world_body
        change = 0.5 * so3.multiply(q, np.append(0.0, unit))
        return still._replace(q_world_body=components(change))
    return still._replace(**{name.removeprefix("start."): _alike(unit, len(start.position[0]))})


def _inertial(still: Airframe, vehicles: Sequence[Vehicle], name: str, unit: Array) -> Airframe:
    inertial = still.mass_properties
    if name == "inertia":  # d(J⁻¹) = −J⁻¹ dJ J⁻¹
        change = 0.5 * (unit + unit.T)
        inverse = np.linalg.inv([vehicle.inertia for vehicle in vehicles])
        moved = inertial._replace(
            inertia=tuple(_alike(row, len(vehicles)) for row in change),
            inverse_inertia=tuple(map(components, np.moveaxis(-inverse @ change @ inverse, 1, 0))),
        )
    elif name == "mass":
        moved = inertial._replace(mass=np.ones(len(vehicles)))
    else:
        moved = inertial._replace(drag_body=_alike(unit, len(vehicles)))
    return still._replace(mass_properties=moved)


def _rotors(still: Airframe, vehicles: Sequence[Vehicle], name: str, unit: Array) -> Airframe:
    rotors, count = still.rotors, len(vehicles)
    match name:
        case "rotors.lag":
            lags = np.array([vehicle.lags for vehicle in vehicles])
            rates = np.divide(-unit, lags**2, out=np.zeros_like(lags), where=lags > 0.0)
            moved = rotors._replace(inverse_time_constant=components(rates))
        case "rotors.position_body":
            total, _, _, yaw = rotors.allocation
            x, y, _ = unit.T
            moved = rotors._replace(allocation=(total, _alike(y, count), _alike(-x, count), yaw))
        case "rotors.torque_coefficient":
            spins = np.array([[rotor.spin for rotor in vehicle.rotors] for vehicle in vehicles])
            moved = rotors._replace(allocation=(*rotors.allocation[:3], components(-spins * unit)))
        case _:
            moved = rotors._replace(**{name.removeprefix("rotors."): _alike(unit, count)})
    return still._replace(rotors=moved)


def _alike(vector: Array, vehicles: int) -> Tree:
    """Components (vehicles,) of a vector that is the same for all."""
    return components(np.broadcast_to(vector, (vehicles, len(vector))))
