"""Smooth nonlinear programs, stated in CasADi's symbols and solved by IPOPT's interior-point method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module
from math import inf
from time import perf_counter
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from aerobat.arrays import Array, frozen, frozen_bounds
from aerobat.errors import SpecError
from aerobat.optimization.deadline import time_left, wall, work

_WARM = {
    "ipopt.warm_start_init_point": "yes",
    "ipopt.warm_start_bound_push": 1e-9,
    "ipopt.warm_start_bound_frac": 1e-9,
    "ipopt.warm_start_slack_bound_push": 1e-9,
    "ipopt.warm_start_slack_bound_frac": 1e-9,
    "ipopt.warm_start_mult_bound_push": 1e-9,
}
_SHORTEST = 1e-9  # [s] the shortest limit that IPOPT takes
_MAX_VIOLATION = 1e-6  # that a result may have and be called converged
_OPTIONS = {
    "print_time": False,
    "show_eval_warnings": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.constr_viol_tol": _MAX_VIOLATION / 10.0,
}
_CONVERGED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
_MEANING = {
    "Solve_Succeeded": "solved to the tolerance",
    "Solved_To_Acceptable_Level": "solved to a looser tolerance, short of the desired one",
    "Infeasible_Problem_Detected": "converged to a point where no small change lessens the violation",
    "Maximum_Iterations_Exceeded": "stopped at the limit of iterations",
    "Maximum_CpuTime_Exceeded": "stopped at the limit of time",
    "Maximum_WallTime_Exceeded": "stopped at the limit of time",
    "Diverging_Iterates": "diverged",
    "Restoration_Failed": "could not come nearer to satisfying the constraints",
    "Search_Direction_Becomes_Too_Small": "stopped with steps too small to go on",
    "Invalid_Number_Detected": "stopped where a function has no finite value",
}


def import_casadi() -> Any:
    """The casadi module, which is imported when it is needed."""
    return import_module("casadi")


def components(column: Any) -> tuple[Any, ...]:
    """Return the components of a column of CasADi's symbols, as kernels take them."""
    return tuple(column[i] for i in range(column.numel()))


class SymbolicOps:
    """The arithmetic of kernels on CasADi's symbols."""

    def __init__(self) -> None:
        ca = import_casadi()
        self.sqrt, self.exp = ca.sqrt, ca.exp
        self.minimum, self.maximum, self.select = ca.fmin, ca.fmax, ca.if_else


@dataclass(frozen=True, eq=False)
class NonlinearProgram:
    """Minimize f(x) subject to lower ≤ g(x) ≤ upper and x_min ≤ x ≤ x_max.

    Raises SpecError when bounds cross or do not fit the symbols; infinite bounds do not bind.
    """

    variables: Any  # x, a column of n CasADi symbols (SX or MX)
    objective: Any  # f, an expression of them
    constraints: Any  # g, a column of m expressions
    lower: Array  # (m,), or one number for all
    upper: Array
    x_min: Array = field(default_factory=lambda: np.array(-inf))  # (n,), or one number for all
    x_max: Array = field(default_factory=lambda: np.array(inf))
    # CasADi functions in place of CasADi's own derivatives: grad_f, jac_g and hess_lag of its IPOPT
    derivatives: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check and broadcast."""
        for names, symbols in ((("lower", "upper"), self.constraints), (("x_min", "x_max"), self.variables)):
            size = int(symbols.numel())
            for name in names:
                object.__setattr__(self, name, _bound(getattr(self, name), name, size))
            low, high = (getattr(self, name) for name in names)
            if (low > high).any():
                raise SpecError(f"{names[0]} must not exceed {names[1]}; entry {np.argmax(low > high)} does")

    @cached_property
    def values(self) -> Any:
        """The CasADi function x -> (f, g)."""
        return import_casadi().Function("values", [self.variables], [self.objective, self.constraints])

    def cost(self, x: Array) -> float:
        """Return f(x)."""
        return float(self.values(x)[0])

    def violation(self, x: Array) -> float:
        """Return the largest violation of a constraint or bound at x, infinite where x or g is not finite."""
        g = np.asarray(self.values(x)[1], dtype=float).reshape(-1)
        if not (np.isfinite(x).all() and np.isfinite(g).all()):
            return inf
        parts = (self.lower - g, g - self.upper, self.x_min - x, x - self.x_max)
        return max(float(np.max(part, initial=0.0)) for part in parts)


@dataclass(frozen=True, eq=False)
class NonlinearResult:
    """The point that a solve ended at; cost and violation are recomputed from the program."""

    x: Array  # (n,)
    multipliers: tuple[Array, Array]  # of the bounds on x, (n,), and of the constraints, (m,)
    cost: float
    violation: float  # of the worst constraint or bound, in its own unit
    converged: bool  # IPOPT found an optimum, and the violation is within 1e-6
    status: str  # a sentence
    iterations: int
    time: float  # [s], derivatives included


def solve_nonlinear(
    program: NonlinearProgram,
    start: ArrayLike,
    *,
    max_iterations: int = 500,
    tolerance: float = 1e-8,
    initial_barrier: float | None = None,
    multipliers: tuple[Array, Array] | None = None,
    exact_hessian: bool = True,
    options: Mapping[str, Any] = MappingProxyType({}),
) -> NonlinearResult:
    """Return a local minimum near `start`, by IPOPT with CasADi's exact derivatives.

    Args:
        program: what to solve.
        start: the first iterate, (n,).
        max_iterations: of IPOPT.
        tolerance: of IPOPT, on the scaled optimality conditions.
        initial_barrier: the first barrier parameter; None is IPOPT's 0.1, and 1e-4 or less keeps a start that
            is nearly optimal.
        multipliers: of a result near the start, which with a small first barrier parameter saves iterations.
        exact_hessian: False has the Hessian built up by BFGS updates.
        options: of IPOPT beside these, by their names.

    Raises:
        SpecError: `start` has the wrong size.
    """
    began = perf_counter()
    x0 = frozen(start, "start", (int(program.variables.numel()),))
    settings: dict[str, Any] = {**_OPTIONS, "ipopt.max_iter": max_iterations, "ipopt.tol": tolerance}
    settings |= program.derivatives
    settings |= {f"ipopt.{name}": value for name, value in options.items()}
    if (limit := time_left(wall)) is not None:
        settings["ipopt.max_wall_time"] = max(limit, _SHORTEST)
    if (limit := time_left(work)) is not None:
        settings["ipopt.max_cpu_time"] = max(limit, _SHORTEST)
    if not exact_hessian:
        settings["ipopt.hessian_approximation"] = "limited-memory"
    if initial_barrier is not None:
        settings |= {"ipopt.mu_init": initial_barrier, "ipopt.bound_push": 1e-6, "ipopt.bound_frac": 1e-6}
    known = {}
    if multipliers is not None:
        settings |= _WARM
        known = dict(zip(("lam_x0", "lam_g0"), multipliers, strict=True))
    symbols = {"x": program.variables, "f": program.objective, "g": program.constraints}
    bounds = {"lbg": program.lower, "ubg": program.upper, "lbx": program.x_min, "ubx": program.x_max}
    solver = import_casadi().nlpsol("program", "ipopt", symbols, settings)
    answer = solver(x0=x0, **known, **bounds)
    x, *found = (np.asarray(answer[name], dtype=float).reshape(-1) for name in ("x", "lam_x", "lam_g"))
    for array in (x, *found):
        array.flags.writeable = False
    status = str(solver.stats()["return_status"])
    violation = program.violation(x)
    return NonlinearResult(
        x=x,
        multipliers=(found[0], found[1]),
        cost=program.cost(x),
        violation=violation,
        converged=status in _CONVERGED and violation <= _MAX_VIOLATION,
        status=_MEANING.get(status, f"stopped: {status.replace('_', ' ').lower()}"),
        iterations=int(solver.stats()["iter_count"]),
        time=perf_counter() - began,
    )


def _bound(value: ArrayLike, name: str, size: int) -> Array:
    bound = frozen_bounds(value, name)
    if bound.shape not in ((), (size,)):
        raise SpecError(f"{name} must be one number or {size}, got the shape {bound.shape}")
    return frozen_bounds(np.broadcast_to(bound, (size,)), name)
