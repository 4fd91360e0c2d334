"""How kernels are run: plain floats, one vehicle after another, or NumPy arrays of vehicles."""

from __future__ import annotations

from aerobat.engines.batch import NUMPY
from aerobat.engines.engine import Engine
from aerobat.engines.floats import FLOATS
from aerobat.errors import SpecError

_FEW = 8  # vehicles: more of them fly faster as arrays
_ENGINES = {engine.name: engine for engine in (FLOATS, NUMPY)}

__all__ = ["FLOATS", "NUMPY", "Engine", "choose"]


def choose(name: str, vehicles: int) -> Engine:
    """The engine of that name; "auto" takes the faster one for so many vehicles. Raises SpecError."""
    if name == "auto":
        return FLOATS if vehicles <= _FEW else NUMPY
    if name not in _ENGINES:
        raise SpecError(f"engine must be one of auto, {', '.join(_ENGINES)}, got {name!r}")
    return _ENGINES[name]
