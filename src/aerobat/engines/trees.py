"""Trees: (named) tuples of (named) tuples whose leaves are arrays or numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import repeat
from typing import Any, TypeAlias

Tree: TypeAlias = Any


def rows(tree: Tree, leaf: Callable[[Any], Iterator[Any]]) -> Iterator[Tree]:
    """One tree for each row: `leaf` iterates over the leading axis of a leaf."""
    if not isinstance(tree, tuple):
        return leaf(tree)
    if not tree:
        return repeat(tree)
    children = [rows(child, leaf) for child in tree]
    return map(type(tree), *children) if hasattr(tree, "_fields") else zip(*children)  # noqa: B905


def stacked(trees: Sequence[Tree], join: Callable[[Sequence[Any]], Any]) -> Tree:
    """The tree whose leaves are `join` of the leaves of alike trees."""
    first = trees[0]
    if isinstance(first, tuple):
        return _like(first, [stacked(children, join) for children in zip(*trees, strict=True)])
    return join(trees)


def leaves(tree: Tree) -> list[Any]:
    """The leaves of a tree, from left to right."""
    return [leaf for child in tree for leaf in leaves(child)] if isinstance(tree, tuple) else [tree]


def refilled(tree: Tree, values: Iterator[Any]) -> Tree:
    """The tree with other leaves, from left to right."""
    if isinstance(tree, tuple):
        return _like(tree, [refilled(child, values) for child in tree])
    return next(values)


def _like(tree: tuple[Any, ...], children: list[Any]) -> Tree:
    return type(tree)(*children) if hasattr(tree, "_fields") else tuple(children)
