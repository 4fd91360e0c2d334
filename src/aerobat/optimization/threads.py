"""One thread for linear algebra: for matrices of some hundred rows, more threads are slower."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import scipy.linalg  # noqa: F401 (loaded so that threadpoolctl finds its library)
from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Run the matrix products and factorizations of a block, of NumPy and SciPy, on the calling thread."""
    with _libraries().limit(limits=1):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """Return the linear algebra libraries that are loaded; finding them takes some milliseconds."""
    return ThreadpoolController()
