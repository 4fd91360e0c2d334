"""Pytrees: (named) tuples of (named) tuples whose leaves are arrays or numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import repeat
from typing import Any, TypeAlias

Tree: TypeAlias = Any


def tree_leaves(tree: Tree) -> list[Any]:
    """The leaves of a tree, from left to right."""
    if not isinstance(tree, tuple):
        return [tree]
    leaves: list[Any] = []
    for child in tree:
        if isinstance(child, tuple):
            leaves.extend(tree_leaves(child))
        else:
            leaves.append(child)
    return leaves


def tree_unflatten(tree: Tree, leaves: Iterable[Any]) -> Tree:
    """The tree with other leaves, from left to right."""
    return _unflatten(tree, iter(leaves))


def tree_map(function: Callable[[Any], Any], tree: Tree) -> Tree:
    """The tree with `function` applied to each leaf."""
    if isinstance(tree, tuple):
        return _like(tree, [tree_map(function, child) for child in tree])
    return function(tree)


def tree_stack(trees: Sequence[Tree], join: Callable[[Sequence[Any]], Any]) -> Tree:
    """The tree whose leaves are `join` of the leaves of alike trees."""
    first = trees[0]
    if isinstance(first, tuple):
        return _like(first, [tree_stack(children, join) for children in zip(*trees, strict=True)])
    return join(trees)


def tree_rows(tree: Tree, iterate: Callable[[Any], Iterator[Any]]) -> Iterator[Tree]:
    """One tree for each row: `iterate` iterates over the leading axis of a leaf."""
    if not isinstance(tree, tuple):
        return iterate(tree)
    if not tree:
        return repeat(tree)
    children = [tree_rows(child, iterate) for child in tree]
    return map(type(tree), *children) if hasattr(tree, "_fields") else zip(*children)  # noqa: B905


def piecewise_constant_leaves(tree: Tree) -> list[bool]:
    """For each leaf, true below a tuple that is `piecewise_constant`."""
    return tree_leaves(_marked(tree, False))


def _marked(tree: Tree, mark: bool) -> Tree:
    if not isinstance(tree, tuple):
        return mark
    mark = mark or getattr(tree, "piecewise_constant", False)
    return tuple(_marked(child, mark) for child in tree)


def _unflatten(tree: Tree, leaves: Iterator[Any]) -> Tree:
    if isinstance(tree, tuple):
        return _like(tree, [_unflatten(child, leaves) for child in tree])
    return next(leaves)


def _like(tree: tuple[Any, ...], children: list[Any]) -> Tree:
    return type(tree)(*children) if hasattr(tree, "_fields") else tuple(children)
