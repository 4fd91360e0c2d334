"""One convex quadratic program, by DAQP's dual active-set method."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array

SOLVED = 1  # DAQP's exit flag


def quadratic_minimum(
    hessian: Array, gradient: Array, reach: Array, rows: Array, upper: Array
) -> Array | None:
    """Minimize ½ x'Hx + g'x subject to |x| <= reach and A x <= upper; None where DAQP finds no minimum.

    Args:
        hessian: H, positive definite, (n, n).
        gradient: g, (n,).
        reach: Bound of each variable's magnitude, (n,).
        rows: A, (m, n).
        upper: Upper bounds of A x, (m,).
    """
    import daqp  # importing takes as long as solving

    below = np.full(len(rows), -np.inf)
    ends = np.append(reach, upper), np.append(-reach, below)
    x, _, flag, _ = daqp.solve(hessian, gradient, np.ascontiguousarray(rows), *ends)
    return np.asarray(x) if flag == SOLVED else None
