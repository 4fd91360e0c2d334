"""Memory for large arrays that come and go: fresh pages of it cost more than what is written to them."""

from __future__ import annotations

import sys
from math import prod
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

_ONLY_HERE = 3  # references to a buffer that no array looks at: the list's, the loop's, the question's


class Scratch:
    """Arrays of float64 in memory that is used again once no array looks at it any more."""

    def __init__(self) -> None:
        self._buffers: list[NDArray[np.float64]] = []
        self._lock = Lock()

    def empty(self, shape: tuple[int, ...]) -> NDArray[np.float64]:
        """An array of any content that shares memory with no other one that is still in use."""
        size = prod(shape)
        with self._lock:
            for buffer in self._buffers:
                if len(buffer) >= size and sys.getrefcount(buffer) == _ONLY_HERE:
                    return buffer[:size].reshape(shape)
            self._buffers = [kept for kept in self._buffers if sys.getrefcount(kept) > _ONLY_HERE]
            fresh: NDArray[Any] = np.empty(size)
            self._buffers.append(fresh)
            return fresh[:size].reshape(shape)
