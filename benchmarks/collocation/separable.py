"""Partially separable programs (Griewank and Toint 1982): a few functions of few unknowns, at many places.

    f(x) = Σ φ(x_e),    g(x) = Σ S_e ψ(x_e)

The derivatives are those of φ and ψ, derived once however many places there are, evaluated in one batch, and
added in where they belong. That is several times cheaper to derive and to evaluate than what CasADi makes of
the whole program by colouring its Jacobian and its Hessian.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aerobat.arrays import Array, Indices
from collocation.nonlinear import NonlinearProgram, import_casadi


@dataclass(frozen=True, eq=False)
class ElementFunction:
    """A function of CasADi's scalars SX, (z (n,), parameters (q,)) -> values (m,), with its derivatives."""

    value: Any

    @cached_property
    def jacobian(self) -> Any:
        """(z, parameters) -> ∂values/∂z, sparse (m, n)."""
        z, parameters, values = self._symbols
        return self._function("jacobian", [z, parameters], import_casadi().jacobian(values, z))

    @cached_property
    def hessian(self) -> Any:
        """(z, parameters, multipliers (m,)) -> ∂²(multipliers · values)/∂z², sparse (n, n)."""
        ca, (z, parameters, values) = import_casadi(), self._symbols
        multipliers = ca.SX.sym("multipliers", values.numel())
        hessian = ca.hessian(ca.dot(multipliers, values), z)[0]
        return self._function("hessian", [z, parameters, multipliers], hessian)

    @cached_property
    def _symbols(self) -> tuple[Any, Any, Any]:
        sx = import_casadi().SX
        z, parameters = (sx.sym(name, self.value.numel_in(i)) for i, name in enumerate(("z", "parameters")))
        return z, parameters, self.value(z, parameters)

    def _function(self, name: str, inputs: list[Any], output: Any) -> Any:
        return import_casadi().Function(name, inputs, [output])


@dataclass(frozen=True, eq=False)
class Element:
    """A function at B places: of which unknowns, with which parameters, its values added to which rows."""

    function: ElementFunction
    unknowns: Indices  # (B, n)
    parameters: Array  # (B, q)
    rows: Indices  # (B, m)


@dataclass(frozen=True, eq=False)
class SeparableFunction:
    """The sum of elements, x (unknowns,) -> (rows,), in CasADi's symbols MX."""

    elements: Sequence[Element]
    unknowns: int
    rows: int

    def values(self, x: Any) -> Any:
        """All rows, (rows,)."""
        total = import_casadi().MX.zeros(self.rows)
        for element in self.elements:
            values = _mapped(element, element.function.value, x)
            scatter = _Scatter(element.rows.ravel(), np.zeros(element.rows.size, dtype=int), (self.rows, 1))
            total += scatter(values)
        return total

    def jacobian(self, x: Any) -> Any:
        """∂/∂x, sparse (rows, unknowns)."""
        parts, rows, columns = [], [], []
        for element in self.elements:
            i, j = _pattern(element.function.jacobian)
            parts.append(_mapped(element, element.function.jacobian, x))
            rows.append(element.rows[:, i].ravel())
            columns.append(element.unknowns[:, j].ravel())
        return _scattered(parts, rows, columns, (self.rows, self.unknowns))

    def hessian(self, x: Any, multipliers: Any) -> Any:
        """∂²(multipliers · rows)/∂x², its upper triangle, sparse (unknowns, unknowns)."""
        parts, rows, columns = [], [], []
        for element in self.elements:
            i, j = _pattern(element.function.hessian)
            at, to = element.unknowns[:, i].ravel(), element.unknowns[:, j].ravel()
            upper = np.flatnonzero(at <= to).tolist()
            values = _mapped(element, element.function.hessian, x, _taken(multipliers, element.rows))
            parts.append(values[upper])
            rows.append(at[upper])
            columns.append(to[upper])
        return _scattered(parts, rows, columns, (self.unknowns, self.unknowns))


def separable_program(
    objective: SeparableFunction, constraints: SeparableFunction, **bounds: Array
) -> NonlinearProgram:
    """The program of minimizing one sum of elements within bounds on another.

    Args:
        objective: Of one row.
        constraints: Of the same unknowns.
        bounds: `lower`, `upper`, `x_min` and `x_max` of `NonlinearProgram`.
    """
    ca = import_casadi()
    x, p = ca.MX.sym("x", objective.unknowns), ca.MX.sym("p", 0)
    weight, multipliers = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", constraints.rows)
    f, g = objective.values(x), constraints.values(x)
    hessian = objective.hessian(x, weight) + constraints.hessian(x, multipliers)
    derivatives = {
        "grad_f": ca.Function("grad_f", [x, p], [f, ca.densify(objective.jacobian(x).T)]),
        "jac_g": ca.Function("jac_g", [x, p], [g, constraints.jacobian(x)]),
        "hess_lag": ca.Function("hess_lag", [x, p, weight, multipliers], [hessian]),
    }
    return NonlinearProgram(x, f, g, derivatives=derivatives, **bounds)


class _Scatter:
    """Values in a row, added to the nonzeros of a sparse matrix at given places."""

    def __init__(self, rows: Indices, columns: Indices, shape: tuple[int, int]) -> None:
        ca = import_casadi()
        places, index = np.unique(columns * shape[0] + rows, return_inverse=True)
        pattern = ca.Sparsity.triplet(len(places), len(index), index.tolist(), list(range(len(index))))
        self._sums = ca.DM(pattern, 1.0)
        self._sparsity = ca.Sparsity.triplet(
            *shape, (places % shape[0]).tolist(), (places // shape[0]).tolist()
        )

    def __call__(self, values: Any) -> Any:
        return import_casadi().MX(self._sparsity, self._sums @ values)


def _scattered(parts: list[Any], rows: list[Indices], columns: list[Indices], shape: tuple[int, int]) -> Any:
    return _Scatter(np.concatenate(rows), np.concatenate(columns), shape)(import_casadi().vertcat(*parts))


def _mapped(element: Element, function: Any, x: Any, *others: Any) -> Any:
    """The nonzeros of a function's output, place by place."""
    batch = function.map(len(element.unknowns))
    output = batch(_taken(x, element.unknowns), import_casadi().DM(element.parameters.T), *others)
    return import_casadi().reshape(output.nz[:], output.nnz(), 1)


def _taken(column: Any, indices: Indices) -> Any:
    """Entries of a column, (indices.shape[1], indices.shape[0])."""
    places, size = indices.shape
    return import_casadi().reshape(column[indices.ravel().tolist()], size, places)


def _pattern(function: Any) -> tuple[Indices, Indices]:
    """The rows and columns of the nonzeros of a function's output."""
    rows, columns = function.sparsity_out(0).get_triplet()
    return np.array(rows, dtype=int), np.array(columns, dtype=int)
