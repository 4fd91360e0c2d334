"""Arithmetic of kernels on NumPy arrays: rows of a log, samples and settings, all at once, without a loop."""

from __future__ import annotations

import numpy as np


class ArrayOps:
    """Arithmetic of NumPy arrays."""

    sqrt = staticmethod(np.sqrt)
    exp = staticmethod(np.exp)
    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    select = staticmethod(np.where)
