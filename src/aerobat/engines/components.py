"""Between arrays with a last axis of components and the kernels' tuples of components."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.pytree import Tree


def components(array: Array) -> Tree:
    """(..., n) -> a tuple of n leaves of shape (...)."""
    last = array.ndim - 1
    return tuple(np.ascontiguousarray(array.transpose(last, *range(last))))


def matrix_components(matrices: Array) -> Tree:
    """(..., rows, columns) -> rows of columns of leaves (...)."""
    return tuple(components(matrices[..., k, :]) for k in range(matrices.shape[-2]))


def from_components(leaves: Tree) -> Array:
    """n leaves of shape (...) -> (..., n)."""
    return np.stack(leaves, axis=-1)
