"""One thread for linear algebra: on matrices of some hundred rows more of them cost more than they give."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import scipy.linalg  # noqa: F401  (its library is among those that are found)
from threadpoolctl import ThreadpoolController


@contextmanager
def one_thread() -> Iterator[None]:
    """Run a block's products and factorizations, NumPy's and SciPy's, on the thread that it is called on."""
    with _libraries().limit(limits=1):
        yield


@cache
def _libraries() -> ThreadpoolController:
    """The libraries that are loaded, which takes some milliseconds to find out."""
    return ThreadpoolController()
