"""Pytrees: nested tuples and named tuples with arrays or numbers as leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import repeat
from typing import Any, TypeAlias

import numpy as np

from aerobat.arrays import Array

Tree: TypeAlias = Any


def components(array: Array) -> Tree:
    """Return an array (..., n) as a tuple of n leaves (...)."""
    last = array.ndim - 1
    return tuple(np.ascontiguousarray(array.transpose(last, *range(last))))


def matrix_components(matrices: Array) -> Tree:
    """Return matrices (..., rows, columns) as rows of columns of leaves (...)."""
    return tuple(components(matrices[..., k, :]) for k in range(matrices.shape[-2]))


def from_components(leaves: Tree) -> Array:
    """Return n leaves (...) as an array (..., n)."""
    return np.stack(leaves, axis=-1)


def tree_leaves(tree: Tree) -> list[Any]:
    """Return the leaves of a tree, from left to right."""
    leaves: list[Any] = []
    _collect((tree,), leaves)
    return leaves


def tree_unflatten(tree: Tree, leaves: Iterable[Any]) -> Tree:
    """Return the tree with other leaves, from left to right."""
    return _unflatten((tree,), iter(leaves))[0]


def tree_map(function: Callable[[Any], Any], tree: Tree) -> Tree:
    """Return the tree with `function` applied to each leaf."""
    return tree_unflatten(tree, map(function, tree_leaves(tree)))


def tree_replace(tree: Tree, kind: type | tuple[type, ...], function: Callable[[Any], Tree]) -> Tree:
    """Return the tree with `function` applied to each tuple of the given types."""
    if isinstance(tree, kind):
        return function(tree)
    if not isinstance(tree, tuple):
        return tree
    return tree_like(tree, [tree_replace(child, kind, function) for child in tree])


def tree_like(tree: tuple[Any, ...], children: Iterable[Tree]) -> Tree:
    """Return a tuple of the same type with other children."""
    # also for named tuples, without the cost of their constructors
    return tuple.__new__(type(tree), children)


def tree_stack(trees: Sequence[Tree], join: Callable[[Sequence[Any]], Any]) -> Tree:
    """Return the tree whose leaves are `join` of the corresponding leaves of trees of one structure."""
    first = trees[0]
    if isinstance(first, tuple):
        return tree_like(first, [tree_stack(children, join) for children in zip(*trees, strict=True)])
    return join(trees)


def tree_rows(tree: Tree, iterate: Callable[[Any], Iterator[Any]]) -> Iterator[Tree]:
    """Yield one tree for each row; `iterate` iterates over the leading axis of a leaf."""
    if not isinstance(tree, tuple):
        return iterate(tree)
    if not tree:
        return repeat(tree)
    children = [tree_rows(child, iterate) for child in tree]
    return map(type(tree), *children) if hasattr(tree, "_fields") else zip(*children)  # noqa: B905


def piecewise_constant_leaves(tree: Tree) -> list[bool]:
    """Return, for each leaf, whether it is below a `piecewise_constant` tuple."""
    return tree_leaves(_marked(tree, False))


def _marked(tree: Tree, mark: bool) -> Tree:
    if not isinstance(tree, tuple):
        return mark
    mark = mark or getattr(tree, "piecewise_constant", False)
    return tuple(_marked(child, mark) for child in tree)


def _collect(tree: tuple[Any, ...], leaves: list[Any]) -> None:
    for child in tree:
        if isinstance(child, tuple):
            _collect(child, leaves)
        else:
            leaves.append(child)


def _unflatten(tree: tuple[Any, ...], leaves: Iterator[Any]) -> Tree:
    children = [_unflatten(child, leaves) if isinstance(child, tuple) else next(leaves) for child in tree]
    return tree_like(tree, children)
