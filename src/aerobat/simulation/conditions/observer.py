"""The loop's observer: the filter, fed by each sample of the IMU, and by motion capture as poses arrive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aerobat.arrays import Array
from aerobat.kernels import ekf
from aerobat.kernels.ekf import EkfParameters, EkfState
from aerobat.kernels.imu import ImuState
from aerobat.kernels.ops import Ops, Scalar, select_tree
from aerobat.kernels.rigid_body import Pose
from aerobat.simulation.conditions.sensors import MocapState, MotionCaptureSensor
from aerobat.simulation.loop import Estimate, Signals


class ObserverParameters(NamedTuple):
    """A filter in a loop."""

    ekf: EkfParameters
    tick: Scalar  # [s]


class ObserverInput(NamedTuple):
    """A tick of the observer."""

    elapsed: Scalar  # [s] since the last sample of the IMU, 0 at the first tick
    exposes: Scalar  # 1 if a pose is taken at this tick
    arrives: Scalar  # 1 if one arrives


class FilterState(NamedTuple):
    """A filter, and what it has to carry back."""

    filter: EkfState
    exposures: tuple[Pose, ...]  # the filter's own poses at the latest exposures, the latest first


@dataclass(frozen=True)
class EkfObserver:
    """The error-state Kalman filter; it knows the reference's start, and of the flight what sensors say."""

    exposure_period: int  # ticks
    latency: int  # ticks
    period: int = 1
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: ObserverParameters, inputs: ObserverInput, signals: Signals
    ) -> Estimate:
        """See `Component.init`; the velocity is taken for the reference's."""
        pose = signals.of(MocapState).delivered.pose
        state = ekf.init(parameters.ekf, pose, signals.reference.velocity)
        waiting = self.latency // self.exposure_period + 1
        body = ekf.estimated_body(state, signals.of(ImuState).sample)
        return Estimate(body, FilterState(state, (pose,) * waiting))

    def step(
        self,
        ops: Ops,
        parameters: ObserverParameters,
        state: Estimate,
        inputs: ObserverInput,
        signals: Signals,
    ) -> Estimate:
        """See `Component.step`."""
        sample = signals.of(ImuState).sample
        before = ekf.propagate(ops, parameters.ekf, state.own.filter, sample, inputs.elapsed)
        pushed = (ekf.pose_of(before), *state.own.exposures[:-1])
        exposures = select_tree(ops, inputs.exposes > 0.5, pushed, state.own.exposures)
        fused = self._fused(ops, parameters, before, exposures, signals)
        after, exposures = select_tree(ops, inputs.arrives > 0.5, fused, (before, exposures))
        return Estimate(ekf.estimated_body(after, sample), FilterState(after, exposures))

    def _fused(
        self,
        ops: Ops,
        parameters: ObserverParameters,
        state: EkfState,
        exposures: tuple[Pose, ...],
        signals: Signals,
    ) -> tuple[EkfState, tuple[Pose, ...]]:
        """The filter, and its poses at exposures, after the pose that arrives, if it is valid."""
        measured = signals.of(MocapState).delivered
        before = ekf.predict_covariance(ops, parameters.ekf, state)
        age = self.latency * parameters.tick
        after = ekf.fuse(
            ops, parameters.ekf, before, measured.pose, exposures[-1], age, measured.is_valid > 0.5
        )
        ages = ((self.latency - k * self.exposure_period) * parameters.tick for k in range(len(exposures)))
        known = zip(exposures, reversed([*ages]), strict=True)
        return after, tuple(ekf.carried_back(before, after, past, since) for past, since in known)


@dataclass(frozen=True, eq=False)
class ObserverSource:
    """When poses are taken and arrive."""

    sensor: MotionCaptureSensor
    rate: float  # [1/s] of the ticks
    per_vehicle: bool = False

    def chunk(self, begin: int, end: int) -> ObserverInput:
        """See `Source.chunk`."""
        ticks = np.arange(begin, end)
        numbers: tuple[Array, Array, Array] = (
            np.where(ticks > 0, 1.0 / self.rate, 0.0),
            np.asarray(ticks % self.sensor.period == 0, dtype=np.float64),
            np.asarray(self.sensor.arrives(ticks), dtype=np.float64),
        )
        return ObserverInput(*numbers)
