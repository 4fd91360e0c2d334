"""Tune a controller for one maneuver: gains that lower the error of a flip, found by its exact gradient."""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

import aerobat as ab

GAINS = ("position_gain", "velocity_gain", "attitude_frequency", "attitude_damping")
nominal = ab.load_vehicle("agile-quad")
actual = replace(nominal, mass=1.03 * nominal.mass)  # heavier than its controller takes it to be
usual = ab.Controller()
first = np.array([getattr(usual, name) for name in GAINS])
plan = ab.plan(ab.load_problem("flip-roll"), ab.Miqp(), vehicle=nominal)


def tuned(factors: np.ndarray) -> ab.Controller:
    return replace(usual, **dict(zip(GAINS, map(float, first * factors), strict=True)))


def error(factors: np.ndarray) -> tuple[float, np.ndarray]:
    """The mean squared position error [mm²] and its slopes."""
    found = ab.sensitivity(plan, GAINS, actual, controller=tuned(factors), nominal=nominal)
    mean = found.mean_square_position_error
    return 1e6 * float(mean.value), 1e6 * first * np.array([mean.slopes[name] for name in GAINS])


best = minimize(error, np.ones(4), jac=True, bounds=[(0.7, 1.4)] * 4, options={"maxiter": 10})
for name, old, new in zip(GAINS, first, first * best.x, strict=True):
    print(f"{name:20} {old:7.2f} -> {new:7.2f}")
print(f"RMS position error {error(np.ones(4))[0] ** 0.5:.2f} mm -> {best.fun**0.5:.2f} mm")
