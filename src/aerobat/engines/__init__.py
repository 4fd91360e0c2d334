"""How kernels are run: one vehicle after another in plain floats, or many as arrays or machine code."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from aerobat.engines.batch import NUMPY
from aerobat.engines.engine import Engine, told
from aerobat.engines.floats import FLOATS
from aerobat.errors import BackendMissing, SpecError

NAMES = ("floats", "numpy", "compiled", "jax", "jax-float32")
_OPTIONAL = {  # the library that an engine needs, the extra that installs it, and where the engine is
    "compiled": ("llvmlite", "fast", "compiled", "ENGINE"),
    "jax": ("jax", "jax", "jax", "ENGINE"),
    "jax-float32": ("jax", "jax", "jax", "SINGLE"),
}
_FEW = 8  # vehicles: more of them fly faster as arrays
_MOMENT = 4000  # vehicle-ticks that floats fly in the time that it takes to compile

__all__ = ["FLOATS", "NAMES", "NUMPY", "Engine", "choose", "told"]


def choose(name: str, vehicles: int, ticks: int) -> Engine:
    """The engine of that name; "auto" takes the fastest that is installed for so many vehicles and ticks.

    Raises SpecError for an unknown name, BackendMissing for one whose library is not installed.
    """
    if name == "auto":
        name = _fastest(vehicles, ticks)
    if name not in NAMES:
        raise SpecError(f"engine must be one of auto, {', '.join(NAMES)}, got {name!r}")
    if name in _OPTIONAL:
        return _optional(name, *_OPTIONAL[name])
    return FLOATS if name == FLOATS.name else NUMPY


def _fastest(vehicles: int, ticks: int) -> str:
    if vehicles * ticks <= _MOMENT:
        return "floats"
    if find_spec("llvmlite") is not None:
        return "compiled"
    return "floats" if vehicles <= _FEW else "numpy"


def _optional(name: str, library: str, extra: str, module: str, value: str) -> Engine:
    """An engine that needs a library which may not be there, and is imported only when asked for."""
    if find_spec(library) is None:
        remedy = f'pip install "aerobat[{extra}]"'
        raise BackendMissing(f"the {name} engine needs {library}; install it with {remedy}")
    engine: Engine = getattr(import_module(f"aerobat.engines.{module}"), value)
    return engine
