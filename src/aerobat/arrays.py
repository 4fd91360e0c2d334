"""Read-only float64 arrays: values are immutable for real."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from aerobat.errors import SpecError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
AXES = "xyz"  # the names of a vector's components
ORDERS = (AXES, "wxyz")  # the order of components that have these labels


def round_step(length: float) -> float:
    """Return the largest of 1, 2 or 5 times a power of ten that is at most `length`."""
    steps = 10.0 ** np.floor(np.log10(length)) * np.array([1.0, 2.0, 5.0])
    return float(steps[steps <= length * (1 + 1e-9)].max())


def xyz(vectors: Any) -> tuple[Any, Any, Any]:
    """Return the components of vectors (..., 3), as kernels take them."""
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]


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
    labelled = by_labels(value, name)
    try:
        array = np.asarray(labelled)
    except (ValueError, TypeError, OverflowError):  # ragged, or nothing of the kind
        raise SpecError(f"{name} must be numbers, got {_shown(value)}") from None
    if array.dtype.kind not in "fiu":  # text, truth and complex numbers are none
        raise SpecError(f"{name} must be numbers, got {_shown(value)}")
    return array.astype(np.float64, copy=False)


def text_labels(value: object) -> list[str]:
    """Return the labels of a series, or of a table's columns, as pandas have them; none but text counts."""
    labels = getattr(value, "columns", getattr(value, "index", None))
    if not hasattr(value, "__array__") or not isinstance(labels, Iterable):
        return []
    found = list(labels)
    return found if all(isinstance(label, str) for label in found) else []


def by_labels(value: Any, name: str = "") -> Any:
    """Return the value, a series labelled x, y, z (or w, x, y, z) in that order of its components.

    Columns of a table are ordered likewise, those of other names left as they are. Raises SpecError for a
    series with other labels.
    """
    labels = text_labels(value)
    if not labels or "".join(labels) in ORDERS:
        return value
    for order in ORDERS:
        if sorted(labels) == sorted(order):
            return np.asarray(value)[..., [labels.index(axis) for axis in order]]
    if np.ndim(value) == 1:
        names = _shown(labels)
        raise SpecError(f"{name} must be labelled x, y, z, got the labels {names}; give .to_numpy()".lstrip())
    return value


def _shown(value: object) -> str:
    """A value in a few words on one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _fits(shape: tuple[int, ...], wanted: Sequence[int | None]) -> bool:
    trailing = shape[len(shape) - len(wanted) :]
    return len(shape) >= len(wanted) and all(
        w is None or s == w for s, w in zip(trailing, wanted, strict=True)
    )
