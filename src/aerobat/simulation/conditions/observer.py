"""Observers of the loop: the Kalman filter of IMU and motion capture, and the disturbance observer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aerobat.kernels import ekf, motors, rigid_body
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.ekf import EkfParameters, EkfState
from aerobat.kernels.imu import ImuState
from aerobat.kernels.ops import Scalar, select_tree
from aerobat.kernels.rigid_body import Pose
from aerobat.kernels.vectors import ZERO, add_scaled, low_passed, scale, subtract
from aerobat.simulation.components import Disturbance
from aerobat.simulation.conditions.sensors import MocapState, MotionCaptureSensor
from aerobat.simulation.loop import Component, Estimate, Signals, Source, due_ticks


class DisturbanceParameters(NamedTuple):
    """The nominal model of a disturbance observer, and its time constants."""

    model: ControllerModel
    time_constant: Scalar  # [s] of the filter
    delay: Scalar  # [s] from the controller's step to its commands' effect


@dataclass(frozen=True)
class DisturbanceObserver(Component):
    """The low-pass filtered difference between measurement and nominal model, of force and of moment.

    The nominal model has the rotor thrusts that the controller assumes, drag at the estimated state, and the
    gyroscopic moment. The angular acceleration is measured as the difference of the gyro's successive rates.
    """

    def init(self, parameters: DisturbanceParameters, signals: Signals) -> Disturbance:
        """See `Component.init`."""
        return Disturbance(ZERO, ZERO, ZERO, 0.0)

    def step(self, parameters: DisturbanceParameters, state: Disturbance, signals: Signals) -> Disturbance:
        """See `Component.step`."""
        ops, model, elapsed = signals.ops, parameters.model, signals.clock.elapsed
        mass_properties, rotors = model.airframe
        observer, controller = signals.observer, signals.controller
        decay = motors.decay_factors(ops, rotors, ops.maximum(elapsed - parameters.delay, 0.0))
        thrusts = motors.first_order_response(controller.thrusts, controller.commands.thrusts, decay)
        load = motors.wrench(rotors, thrusts)
        nominal = rigid_body.derivative(mass_properties, model.environment, observer.body, load)
        specific_force = rigid_body.specific_force(
            mass_properties, model.environment, observer.body, load.thrust
        )
        bias = observer.own.filter.nominal.accelerometer_bias
        measured = subtract(signals.of(ImuState).sample.specific_force, bias)
        omega = observer.body.omega_body
        turned = scale(1.0 / elapsed, subtract(omega, state.omega_body))
        fraction = elapsed / (parameters.time_constant + elapsed)
        angular = subtract(subtract(turned, nominal.omega_body), state.angular_acceleration)
        return Disturbance(
            low_passed(state.force, subtract(measured, specific_force), parameters.time_constant, elapsed),
            add_scaled(state.angular_acceleration, state.has_omega * fraction, angular),
            omega,
            1.0,
        )


class ObserverParameters(NamedTuple):
    """The parameters of a filter in a loop."""

    ekf: EkfParameters
    tick: Scalar  # [s]


class ObserverInput(NamedTuple):
    """The inputs of the observer at a tick."""

    elapsed: Scalar  # [s] since the last sample of the IMU, 0 at the first tick
    exposes: Scalar  # 1 if a pose is taken at this tick
    arrives: Scalar  # 1 if a pose arrives at this tick


class FilterState(NamedTuple):
    """The state of a filter, and its past poses that delayed measurements are compared with."""

    filter: EkfState
    exposures: tuple[Pose, ...]  # the filter's own poses at the latest exposures, the latest first


@dataclass(frozen=True)
class EkfObserver(Component):
    """The error-state Kalman filter; it knows the reference's start and what sensors measure."""

    exposure_period: int  # ticks
    latency: int  # ticks

    def init(self, parameters: ObserverParameters, signals: Signals) -> Estimate:
        """See `Component.init`; the initial velocity estimate is that of the reference."""
        pose = signals.of(MocapState).delivered.pose
        state = ekf.init(parameters.ekf, pose, signals.reference.velocity)
        waiting = self.latency // self.exposure_period + 1
        body = ekf.estimated_body(state, signals.of(ImuState).sample)
        return Estimate(body, FilterState(state, (pose,) * waiting))

    def step(self, parameters: ObserverParameters, state: Estimate, signals: Signals) -> Estimate:
        """See `Component.step`."""
        inputs: ObserverInput = signals.inputs
        ops, sample = signals.ops, signals.of(ImuState).sample
        before = ekf.propagate(ops, parameters.ekf, state.own.filter, sample, inputs.elapsed)
        pushed = (ekf.pose_of(before), *state.own.exposures[:-1])
        exposures = select_tree(ops, inputs.exposes > 0.5, pushed, state.own.exposures)
        fused = self._fused(parameters, before, exposures, signals)
        after, exposures = select_tree(ops, inputs.arrives > 0.5, fused, (before, exposures))
        return Estimate(ekf.estimated_body(after, sample), FilterState(after, exposures))

    def _fused(
        self, parameters: ObserverParameters, state: EkfState, exposures: tuple[Pose, ...], signals: Signals
    ) -> tuple[EkfState, tuple[Pose, ...]]:
        """Return the filter and its poses at exposures after fusing the pose that arrives, if valid."""
        ops, measured = signals.ops, signals.of(MocapState).delivered
        before = ekf.predict_covariance(ops, parameters.ekf, state)
        age = self.latency * parameters.tick
        is_valid = measured.is_valid > 0.5
        after = ekf.fuse(ops, parameters.ekf, before, measured.pose, exposures[-1], age, is_valid)
        ages = ((self.latency - k * self.exposure_period) * parameters.tick for k in range(len(exposures)))
        known = zip(exposures, reversed([*ages]), strict=True)
        return after, tuple(ekf.carried_back(before, after, past, since) for past, since in known)


def observer_source(sensor: MotionCaptureSensor, rate: float) -> Source:
    """Return the source of the ticks at which a sensor's poses are taken and arrive, at a tick rate [1/s]."""

    def inputs(begin: int, end: int) -> ObserverInput:
        return ObserverInput(
            np.where(np.arange(begin, end) > 0, 1.0 / rate, 0.0),
            due_ticks(sensor.period, begin, end),
            due_ticks(sensor.period, begin, end, sensor.latency),
        )

    return inputs
