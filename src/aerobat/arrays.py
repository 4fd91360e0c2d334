"""Read-only float64 arrays: values are immutable for real."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from math import prod
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerobat.errors import SpecError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
_ONLY_HERE = 3  # references to a buffer that no array looks at: the list's, the loop's, the question's
AXES = "xyz"  # the names of a vector's components


def frozen(value: ArrayLike, name: str, shape: Sequence[int | None] | None = None) -> Array:
    """A write-protected float64 copy of `value`; refuses NaN, infinities and any shape but `shape`.

    `shape` gives the trailing axes, None standing for any size: (None, 3) wants (..., n, 3), and
    None for the whole of it takes any shape. Raises SpecError, naming `name`.
    """
    array = frozen_bounds(value, name, shape)
    if not np.isfinite(array).all():
        raise SpecError(f"{name} must be finite numbers; it contains a NaN or an infinity")
    return array


def frozen_bounds(value: ArrayLike, name: str, shape: Sequence[int | None] | None = None) -> Array:
    """As `frozen`, but infinities may stand for bounds that do not bind. Raises SpecError."""
    array = np.array(numbers(value, name))
    if shape is not None and not _fits(array.shape, shape):
        wanted = ", ".join("n" if size is None else str(size) for size in shape)
        raise SpecError(f"{name} must have the shape ({wanted}), got {array.shape}")
    if np.isnan(array).any():
        raise SpecError(f"{name} must be numbers; it contains a NaN")
    array.flags.writeable = False
    return array


def numbers(value: ArrayLike, name: str) -> Array:
    """The numbers, NaN among them, copied only where they are no float64 array. Raises SpecError."""
    try:
        array = np.asarray(value)
    except (ValueError, TypeError, OverflowError):  # ragged, or nothing of the kind
        raise SpecError(f"{name} must be numbers, got {_shown(value)}") from None
    if array.dtype.kind not in "fiu":  # text, truth and complex numbers are none
        raise SpecError(f"{name} must be numbers, got {_shown(value)}")
    return array.astype(np.float64, copy=False)


def _shown(value: object) -> str:
    """A value in a few words on one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _fits(shape: tuple[int, ...], wanted: Sequence[int | None]) -> bool:
    trailing = shape[len(shape) - len(wanted) :]
    return len(shape) >= len(wanted) and all(
        w is None or s == w for s, w in zip(trailing, wanted, strict=True)
    )


class Scratch:
    """Memory of arrays that come and go, used again once no array looks at it any more.

    Fresh pages of memory cost more than what is written to them.
    """

    def __init__(self) -> None:
        self._buffers: list[Array] = []
        self._lock = Lock()

    def empty(self, shape: tuple[int, ...]) -> Array:
        """An array of any content that shares memory with no other one that is still in use."""
        size = prod(shape)
        with self._lock:
            for buffer in self._buffers:
                if len(buffer) >= size and sys.getrefcount(buffer) == _ONLY_HERE:
                    return buffer[:size].reshape(shape)
            self._buffers = [kept for kept in self._buffers if sys.getrefcount(kept) > _ONLY_HERE]
            fresh: Array = np.empty(size)
            self._buffers.append(fresh)
            return fresh[:size].reshape(shape)
