"""sensitivity(): exact derivatives of a flight's errors with respect to gains, vehicle and start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from types import MappingProxyType
from typing import Any, NamedTuple, Unpack, get_type_hints

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.control import Controller
from aerobat.control.parameters import max_bandwidth
from aerobat.declaration import by_value, short, unknown_name, validated
from aerobat.engines.duals import Dual, DualOps, differentiated, dual
from aerobat.engines.engine import Init, Step, first_row
from aerobat.engines.floats import ArrayOps
from aerobat.engines.pytree import Tree, components, matrix_components, tree_leaves, tree_map
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness import Planned
from aerobat.kernels.control_loops import Gains
from aerobat.kernels.motors import Airframe
from aerobat.kernels.ops import Ops, Scalar
from aerobat.kernels.rigid_body import Body
from aerobat.kernels.vectors import dot, subtract
from aerobat.simulation.bodies import body_states
from aerobat.simulation.config import FlightChanges, FlightConfig
from aerobat.simulation.fly import prepare
from aerobat.simulation.loop import LoopInput, LoopParameters, compose
from aerobat.simulation.metrics import metrics_row, with_metrics
from aerobat.simulation.setup import FlightSetup
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

# lead_time_constant also sets how far ahead set-points are read, which may jump between pieces
_NUMBERS = (name for name, kind in get_type_hints(Controller).items() if kind is float)
_GAINS = tuple(name for name in _NUMBERS if name not in ("lead_time_constant", "disturbance_filter"))
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


@short
@by_value
class Gradient:
    """A result of a flight, and its derivatives with respect to named quantities.

    For a batch, all arrays have a leading axis of vehicles.
    """

    value: Array  # (...)
    slopes: Mapping[str, Array]  # by name of the quantity, (..., *its shape), per unit of the quantity


@by_value
class Sensitivity:
    """The errors of a flight relative to its set-points, and their derivatives."""

    mean_square_position_error: Gradient  # [m²] over the ticks up to the end or divergence, as in a score
    mean_square_attitude_error: Gradient  # [rad²] likewise
    final_square_position_error: Gradient  # [m²] at the last tick; NaN for a vehicle that has diverged


class _Sums(NamedTuple):
    """The row that the loop returns."""

    square: Scalar  # [m²]
    square_angle: Scalar  # [rad²]
    final_square: Scalar  # [m²]
    ticks: Scalar
    flying: Scalar


@validated
def sensitivity(
    plan: Planned | Trajectory,
    of: str | Sequence[str],
    vehicle: Vehicle | str | Sequence[Vehicle | str] | None = None,
    *,
    environment: Environment | None = None,
    config: FlightConfig = FlightConfig(),  # noqa: B008 - frozen
    **changes: Unpack[FlightChanges],
) -> Sensitivity:
    """Fly as `fly` does with the same arguments, and differentiate the flight's errors.

    Args:
        plan: the plan to fly; a bare trajectory needs a vehicle.
        of: names of quantities. A gain of Controller (of its time constants only jerk_filter). Of the true
            vehicle "mass", "inertia", "drag_body". Of each of its rotors "rotors.position_body",
            "rotors.min_thrust", "rotors.max_thrust", "rotors.torque_coefficient", "rotors.lag". Of the
            initial state "start.position", "start.velocity", "start.attitude" (a rotation [rad] about body
            axes), "start.omega_body".
        vehicle: the vehicle or its name, by default the plan's.
        environment: the environment, by default the problem's.
        config: settings of the flight.
        changes: fields of FlightConfig that replace those of `config`.

    The inertia has one slope for each entry, where a symmetric pair shares its derivative: an error changes
    by Σ slope_ij dJ_ij. The controller's nominal vehicle and the set-points are held constant. The slope in
    the mass is therefore that of a mass error unknown to the controller, as in `fly(..., vehicle,
    nominal=...)` with only `vehicle` changed.

    Slopes are exact derivatives of the discrete simulation, by dual numbers, not differences of two flights.
    At a kink, for instance where a rotor's command just reaches its limit, slopes are one-sided. They do not
    include jumps, for instance of the tick at which a vehicle diverges. SpecError is raised for an unknown
    quantity and for inconsistent arguments, BackendMissing for an engine that is not installed.
    """
    names = _known((of,) if isinstance(of, str) else tuple(of))
    config = config.changed(changes)
    if config.law is not None:
        raise SpecError("controller is a law, of whose gains there are no slopes; leave it out")
    if config.conditions is not None:
        raise SpecError("conditions draw what flies, which leaves no slopes; leave them out, or sweep")
    setup = with_metrics(prepare(plan, vehicle, environment=environment, config=config))
    rotors = setup.fleet.lags.shape[1]
    shapes = {name: tuple(n or rotors for n in _SHAPES[name]) for name in names}
    directions = [
        tree_leaves(_tangent(setup, name, unit))
        for name, shape in shapes.items()
        for unit in np.eye(int(np.prod(shape))).reshape(-1, *shape)
    ]
    values, slopes = _differentiated_flight(setup, directions)
    return _sensitivity(values, slopes, shapes, setup.is_batch)


def _known(names: tuple[str, ...]) -> tuple[str, ...]:
    if not names:
        raise SpecError("of must name at least one quantity, such as 'position_gain' or 'mass'")
    for name in names:
        if name == "lead_time_constant":
            raise SpecError(
                "lead_time_constant has no slope: it also moves where set-points are read, and they jump"
            )
        if name == "disturbance_filter":
            raise SpecError(
                "disturbance_filter has no slope: it counts under conditions only, which have none"
            )
        if name not in _SHAPES:
            raise unknown_name("differentiable quantity", str(name), _SHAPES)
    return tuple(dict.fromkeys(names))


def _differentiated_flight(setup: FlightSetup, directions: Sequence[list[Array]]) -> tuple[_Sums, _Sums]:
    """Return the last row of the loop, and its derivatives; leaves (vehicles, directions).

    Each vehicle flies once for each direction, all side by side.
    """
    count, vehicles = len(directions), len(setup.fleet)
    along = (np.stack(each, axis=-1).ravel() for each in zip(*directions, strict=True))
    tangents = tuple(tangent if tangent.any() else () for tangent in along)
    parameters = (tree_map(lambda leaf: np.repeat(leaf, count), setup.parameters), tangents)

    def paired(inputs: LoopInput) -> Tree:
        """Return inputs without derivatives, repeated for each direction."""
        repeated = tree_map(lambda leaf: leaf if leaf.ndim == 1 else np.repeat(leaf, count, axis=-1), inputs)
        return repeated, tuple(() for _ in tree_leaves(inputs))

    loop = None
    for begin, end in setup.chunks(copies=count):
        inputs = paired(setup.inputs(begin, end))
        if loop is None:
            functions = differentiated(*_error_sums(*compose(setup.components, metrics_row)))
            loop = setup.engine(count).compile(*functions, parameters, first_row(inputs))
            carry = loop.init(first_row(inputs))
        carry, rows = loop.scan(carry, inputs, end)
    values, slopes = (_Sums(*(x[:, -1].reshape(vehicles, count) for x in half)) for half in rows)
    return values, slopes


@lru_cache(maxsize=32)
def _error_sums(init: Init, step: Step) -> tuple[Init, Step]:
    """Return a loop whose rows are error sums, from a loop whose rows are metrics."""

    def advance(ops: Ops, parameters: Tree, carry: Tree, inputs: LoopInput) -> tuple[Tree, _Sums]:
        carry, metrics = step(ops, parameters, carry, inputs)
        error = subtract(metrics.last.position, inputs.reference.position)
        sums = (metrics.sum_square, metrics.sum_square_angle, dot(error, error))
        return carry, _Sums(*sums, metrics.ticks, metrics.flying)

    return init, advance


def _sensitivity(
    values: _Sums, slopes: _Sums, shapes: Mapping[str, tuple[int, ...]], batch: bool
) -> Sensitivity:
    ticks = np.maximum(values.ticks, 1.0)
    ended = np.where(values.flying > 0.5, 1.0, np.nan)
    cuts = np.cumsum([int(np.prod(shape)) for shape in shapes.values()])[:-1]

    def gradient(value: Array, slope: Array) -> Gradient:
        named = zip(shapes.items(), np.split(slope, cuts, axis=1), strict=True)
        by_name = {name: each(x.reshape(-1, *shape)) for (name, shape), x in named}
        return Gradient(each(value[:, 0]), MappingProxyType(by_name))

    def each(array: Array) -> Array:
        own = np.array(array if batch else array[0])
        own.flags.writeable = False  # a diverged vehicle's values may be NaN
        return own

    return Sensitivity(
        gradient(values.square / ticks, slopes.square / ticks),
        gradient(values.square_angle / ticks, slopes.square_angle / ticks),
        gradient(values.final_square * ended, slopes.final_square * ended),
    )


def _tangent(setup: FlightSetup, name: str, unit: Array) -> LoopParameters:
    """Return the derivative of the loop's parameters in a quantity along `unit`; leaves (vehicles,)."""
    zeros: LoopParameters = tree_map(np.zeros_like, setup.parameters)
    observer, controller, plant, metrics = zeros.own
    if name in _GAINS:
        model = controller.model._replace(gains=_gains(setup, name))
        controller = controller._replace(model=model)
    elif name.startswith("start."):
        return zeros._replace(start=_start(zeros.start, setup.parameters.start, name, unit))
    elif name.startswith("rotors."):
        plant = plant._replace(airframe=_rotors(plant.airframe, setup, name, unit))
    else:
        plant = plant._replace(airframe=_mass_properties(plant.airframe, setup, name, unit))
    return zeros._replace(own=(observer, controller, plant, metrics))


def _gains(setup: FlightSetup, name: str) -> Gains:
    controller = setup.controller
    number: Any = Dual(getattr(controller, name), 1.0)
    bandwidth = max_bandwidth(setup.nominal, setup.environment)
    gains = controller.gains(bandwidth, DualOps(ArrayOps), **{name: number})
    none = np.zeros(len(setup.fleet))
    slopes = (dual(gain).tangent for gain in gains)
    return Gains(*(none if slope is None else slope + none for slope in slopes))


def _start(zeros: Body, start: Body, name: str, unit: Array) -> Body:
    if name == "start.attitude":  # q ⊗ exp(φ) ≈ q + ½ q ⊗ (0, φ)
        q = body_states(start).q_world_body
        change = 0.5 * so3.multiply(q, np.append(0.0, unit))
        return zeros._replace(q_world_body=components(change))
    return zeros._replace(**{name.removeprefix("start."): _alike(unit, len(start.position[0]))})


def _mass_properties(zeros: Airframe, setup: FlightSetup, name: str, unit: Array) -> Airframe:
    count = len(setup.fleet)
    if name == "inertia":  # d(J⁻¹) = −J⁻¹ dJ J⁻¹
        change = 0.5 * (unit + unit.T)
        inverse = np.linalg.inv(setup.fleet.inertia)
        tangent = zeros.mass_properties._replace(
            inertia=tuple(_alike(row, count) for row in change),
            inverse_inertia=matrix_components(-inverse @ change @ inverse),
        )
    elif name == "mass":
        tangent = zeros.mass_properties._replace(mass=np.ones(count))
    else:
        tangent = zeros.mass_properties._replace(drag_body=_alike(unit, count))
    return zeros._replace(mass_properties=tangent)


def _rotors(zeros: Airframe, setup: FlightSetup, name: str, unit: Array) -> Airframe:
    rotors, fleet, count = zeros.rotors, setup.fleet, len(setup.fleet)
    match name:
        case "rotors.lag":
            rates = np.divide(-unit, fleet.lags**2, out=np.zeros_like(fleet.lags), where=fleet.lags > 0.0)
            tangent = rotors._replace(inverse_time_constant=components(rates))
        case "rotors.position_body":
            total, _, _, yaw = rotors.allocation
            x, y, _ = unit.T
            tangent = rotors._replace(allocation=(total, _alike(y, count), _alike(-x, count), yaw))
        case "rotors.torque_coefficient":
            tangent = rotors._replace(allocation=(*rotors.allocation[:3], components(-fleet.spins * unit)))
        case _:
            tangent = rotors._replace(**{name.removeprefix("rotors."): _alike(unit, count)})
    return zeros._replace(rotors=tangent)


def _alike(vector: Array, vehicles: int) -> Tree:
    """Return the components (vehicles,) of a vector that is the same for all vehicles."""
    return components(np.broadcast_to(vector, (vehicles, len(vector))))
