"""The simulation loop of one vehicle over flat ground, stepped with references that come as it flies."""

from __future__ import annotations

from math import cos, sin

import numpy as np

from aerobat.arrays import Array
from aerobat.engines import choose
from aerobat.engines.engine import first_row
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.engines.pytree import Tree, tree_map
from aerobat.environment import Environment
from aerobat.kernels.control_loops import Gains, ReferencePoint, init_position_loop
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.rigid_body import Body
from aerobat.links.goals import yaw_of
from aerobat.simulation.autopilot.braking import point_reference
from aerobat.simulation.autopilot.loop import autopilot_inputs, autopilot_setup
from aerobat.simulation.bodies import bodies
from aerobat.simulation.components import log_row
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle

_MAX_TICKS = 10**6  # ticks, an arbitrary large number, since the length of a live flight is unknown


class LiveBody:
    """A vehicle's body, rotors and controller; initially at rest at the origin of ENU."""

    def __init__(self, vehicle: Vehicle, environment: Environment) -> None:
        vehicle.require_hover(environment.gravity)
        self._idle = tuple(np.array([least]) for least in vehicle.min_thrusts)
        setup = autopilot_setup(_at_rest(np.zeros(2), 0.0), vehicle, environment)
        _, model, _ = setup.parameters.own
        self._gains: tuple[Gains, Gains] = first_numbers((model.tracking.gains, model.upright))
        zero = np.zeros((1, 3))
        hovering = point_reference(zero, zero, zero, zero, 0.0, environment.gravity)
        first = first_row(autopilot_inputs(hovering, False))
        self._loop = setup.compile_for(choose("auto", 1, _MAX_TICKS), first, log_row)
        self._carry: Tree = self._loop.init(first)
        self.stop_rotors()

    @property
    def body(self) -> Body:
        """The true state in plain numbers."""
        body: Body = first_numbers(self._carry[2].body)
        return body

    @property
    def state(self) -> BodyState:
        """The true state, (·,)."""
        return BodyState(*(np.concatenate(leaves) for leaves in self._carry[2].body))

    def fly(self, references: ReferencePoint, by_attitude: bool, upright: bool) -> None:
        """Simulate a tick for each of the references, leaves (T,); see `autopilot_inputs`."""
        self._carry, _ = self._loop.scan(self._carry, autopilot_inputs(references, by_attitude, upright))

    def restart_position_loop(self, references: ReferencePoint, upright: bool) -> None:
        """Restart the outer loop towards the first of the references, without its previous state.

        See `autopilot_inputs` for `upright`.
        """
        observer, controller, motion = self._carry
        body, reference = first_numbers(motion.body), first_numbers(references)
        outer = init_position_loop(FloatOps, self._gains[upright], body, reference)
        restarted = controller._replace(outer=tree_map(lambda leaf: np.array([leaf]), outer))
        self._carry = (observer, restarted, motion)

    def stand(self) -> None:
        """Put the vehicle at rest on the ground below it; the rotors keep their thrusts."""
        state = self.state
        standing = _at_rest(state.position[:2], yaw_of(state.q_world_body))
        observer, controller, motion = self._carry
        self._carry = (observer, controller, VehicleState(standing, motion.thrusts))

    def stop_rotors(self) -> None:
        """Set all rotors to their minimum thrust, in the plant and in the controller's model."""
        observer, controller, motion = self._carry
        commands = controller.commands._replace(thrusts=self._idle)
        stopped = controller._replace(thrusts=self._idle, commands=commands)
        self._carry = (observer, stopped, VehicleState(motion.body, self._idle))


def _at_rest(place: Array, yaw: float) -> Body:
    """Return the state at rest on the ground at a place [m], (2,), and a yaw [rad]; leaves (1,)."""
    q = np.array([[cos(yaw / 2), 0.0, 0.0, sin(yaw / 2)]])
    return bodies(BodyState(np.array([[*place, 0.0]]), np.zeros((1, 3)), q, np.zeros((1, 3))))
