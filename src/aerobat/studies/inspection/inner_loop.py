"""Faults of a flight controller's inner loop, found by regression on its logged inputs and commands.

The nominal inner loop commands the moment J (p (r − ω) + i ∫(r − ω) − d ω'). With motors in another order,
other rotors receive these commands; with other rates the commands are p (s r − ω) + …; with other gains, p
differs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import exp

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.signal import lfilter

from aerobat.arrays import Array
from aerobat.control.parameters import airframe_parameters, controller_parameters
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.kernels import rate_loop
from aerobat.kernels.rate_loop import RateLoopModel, RateSetpoint, rate_gains
from aerobat.simulation import Flight
from aerobat.simulation.law_controller import DERIVATIVE, GYRO
from aerobat.studies.inspection.result import Fault
from aerobat.studies.inspection.rotors import lag_fault
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

_SMOOTHED = 0.008  # [s] of each of two low-pass lags, which suppress noise and the effect of filters
_ORDER_MISFIT = 0.6  # [-] misfit with permuted rotors over that without, at most, for a fault of order
_RATES_RESIDUAL = 0.5  # [-] residual with scaled rates over that without, at most, for a fault of rates
_RATE_ERROR = 0.15  # [-] smallest deviation of the rate scale from 1 that is a fault
_GAIN_ERROR = 0.4  # [-] smallest deviation of a gain that is a fault: rounding, filters and delays cause 0.2
_STANDARD_ERRORS = 4.0  # standard errors of a gain that are added to _GAIN_ERROR
_MIN_EXCITATION = 0.05  # [rad/s] RMS rate error from which a gain can be identified
_MIN_ROWS = 20  # rows without saturation from which a gain can be identified
_AXES = ("roll", "pitch", "yaw")


def inner_loop_fault(flight: Flight, vehicle: Vehicle) -> Fault | None:
    """Return the fault of the inner loop configured for a vehicle, as a log shows it; None for no fault."""
    if not flight.has_inner_loop:
        return None
    log = _InnerLoopLog.of(flight, vehicle)
    return log.order() or log.rates() or log.gains() or lag_fault(flight, vehicle)


@dataclass(frozen=True, eq=False)
class _InnerLoopLog:
    """A log with the nominal model of its inner loop."""

    flight: Flight
    vehicle: Vehicle
    fleet: Fleet
    period: float  # [s] between rows
    free: Array  # True in rows unaffected by saturation, (T,)

    @classmethod
    def of(cls, flight: Flight, vehicle: Vehicle) -> _InnerLoopLog:
        period = float(np.median(np.diff(flight.times)))
        window = np.ones(max(1, round(4.0 * _SMOOTHED / period)))
        free = lfilter(window, [1.0], flight.saturated.astype(np.float64)) < 0.5
        return cls(flight, vehicle, Fleet.of([vehicle]), period, free)

    def order(self) -> Fault | None:
        """Return a fault if other rotors than the model's carry out its commands."""
        expected = self._model_commands()
        misfit = np.mean((self.flight.commands[:, :, None] - expected[:, None, :]) ** 2, axis=0)
        rotors, meant = linear_sum_assignment(misfit)
        if misfit[rotors, meant].sum() > _ORDER_MISFIT**2 * np.trace(misfit) or (rotors == meant).all():
            return None
        swapped = (
            f"rotor {k} obeys what rotor {m} should" for k, m in zip(rotors, meant, strict=True) if k != m
        )
        return Fault("motor order", f"motors are in another order: {', '.join(swapped)}")

    def rates(self) -> Fault | None:
        """Return a fault if the commands fit a multiple of the commanded rates."""
        setpoint = self._proportional_integral(self.flight.rate_setpoint)
        rest = self._commanded + self._model_feedback
        factors, unexplained, before = [], 0.0, 0.0
        for axis in range(len(_AXES)):
            columns = np.stack([setpoint[:, axis], np.ones(len(setpoint))], axis=1)[self.free]
            goal = rest[self.free, axis]
            if len(goal) < _MIN_ROWS:
                return None
            found = np.linalg.lstsq(columns, goal, rcond=None)[0]
            factors.append(float(found[0]))
            unexplained += float(np.sum((goal - columns @ found) ** 2))
            off = goal - columns[:, 0]
            before += float(np.sum((off - off.mean()) ** 2))
        strongest = int(np.argmax(np.std(setpoint[self.free], axis=0)))
        factor = factors[strongest]
        if unexplained > _RATES_RESIDUAL**2 * before or abs(factor - 1.0) < _RATE_ERROR:
            return None
        axis_name = _AXES[strongest]
        return Fault("rates", f"the inner loop turns at {factor:.2f} of the rates asked in {axis_name}")

    def gains(self) -> Fault | None:
        """Return a fault if the commands fit another proportional gain."""
        off = [
            f"{factor:.1f} times as large in {axis}"
            for axis, (factor, error) in zip(_AXES, self._gain_factors(), strict=False)
            if abs(factor - 1.0) > _GAIN_ERROR + _STANDARD_ERRORS * error
        ]
        return Fault("rate gains", f"the inner loop's gain is {', '.join(off)}") if off else None

    def _gain_factors(self) -> Iterator[tuple[float, float]]:
        """Yield the proportional gain over the model's, and its standard error, by axis."""
        omega, setpoint = self.flight.omega_body, self.flight.rate_setpoint
        error = setpoint - omega
        terms = (error, self._integral(error), np.gradient(omega, self.period, axis=0))
        smoothed = [self._smoothed(term) for term in (*terms, self._commanded)]
        correlated = 8.0 * _SMOOTHED / self.period  # rows per independent sample
        for axis, gain in enumerate(self._gains.proportional):
            *columns, goal = (term[self.free, axis] for term in smoothed)
            if len(goal) < max(_MIN_ROWS, 2.0 * correlated):
                return
            matrix = np.stack([*columns, np.ones(len(goal))], axis=1)
            found = np.linalg.lstsq(matrix, goal, rcond=None)[0]
            if np.std(columns[0]) < _MIN_EXCITATION:
                yield 1.0, np.inf
                continue
            spread = float(np.var(goal - matrix @ found)) * correlated
            variance = np.linalg.pinv(matrix.T @ matrix)[0, 0] * spread
            yield float(found[0]) / gain, float(np.sqrt(variance)) / gain

    @cached_property
    def _gains(self) -> rate_loop.RateGains:
        return rate_gains(FloatOps, first_numbers(airframe_parameters(self.fleet)))

    @property
    def _commanded(self) -> Array:
        """The angular acceleration [rad/s²] of the nominal vehicle under the logged commands, (T, 3)."""
        moment = self.flight.commands @ self.fleet.allocation[0, 1:].T
        return np.asarray(moment @ np.linalg.inv(self.fleet.inertia[0]).T)

    @property
    def _model_feedback(self) -> Array:
        """The part of the model's commands from the measured rates, with opposite sign [rad/s²], (T, 3)."""
        omega = self.flight.omega_body
        slope = np.asarray(self._gains.derivative) * np.gradient(omega, self.period, axis=0)
        return np.asarray(self._proportional_integral(omega) + slope)

    def _proportional_integral(self, rates: Array) -> Array:
        """Return the part of the model's commands from rates without their slope [rad/s²], (T, 3)."""
        gains = self._gains
        integral = np.asarray(gains.integral) * self._integral(rates)
        return np.asarray(np.asarray(gains.proportional) * rates + integral)

    def _integral(self, rates: Array) -> Array:
        return np.asarray(self.period * np.cumsum(rates, axis=0))

    def _smoothed(self, values: Array) -> Array:
        left = exp(-self.period / _SMOOTHED)
        lags = [(1.0 - left) ** 2], [1.0, -2.0 * left, left * left]
        return np.asarray(lfilter(*lags, values - values[:1], axis=0))

    def _model_commands(self) -> Array:
        """Return the model's commands [N] for the logged set-points and measurements, (T, n)."""
        known = controller_parameters(self.vehicle.controller, self.fleet, self.flight.environment)
        airframe, mixer = first_numbers(airframe_parameters(self.fleet)), first_numbers(known.mixer)
        model = RateLoopModel(airframe, mixer, GYRO, DERIVATIVE)
        rows = (self.flight.rate_setpoint, self.flight.thrust_setpoint, self.flight.omega_body)
        first = self.flight.commands[0].tolist(), self.flight.omega_body[0].tolist()
        state = rate_loop.init(*map(tuple, first))
        commands = []
        steps = np.diff(self.flight.times, prepend=self.flight.times[0] - self.period)
        for omega, thrust, gyro, elapsed in zip(*(row.tolist() for row in (*rows, steps)), strict=True):
            setpoint = RateSetpoint(tuple(omega), thrust)
            state = rate_loop.step(FloatOps, model, state, setpoint, tuple(gyro), elapsed)
            commands.append(state.commands.thrusts)
        return np.asarray(np.array(commands))
