"""Engines: kernels run as they stand in plain floats, or traced, as arrays or as machine code."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from aerobat.declaration import shown
from aerobat.engines.bytecode import BYTECODE
from aerobat.engines.engine import CompiledLoop, Engine, logged_ticks, run_whole
from aerobat.engines.floats import FLOATS
from aerobat.engines.numpy import NUMPY
from aerobat.errors import BackendMissing, SpecError

ENGINE_NAMES = ("floats", "bytecode", "numpy", "compiled", "jax", "jax-float32")
_OPTIONAL = {  # the library that an engine needs, the extra that installs it, and where the engine is
    "compiled": ("llvmlite", "fast", "llvm", "ENGINE"),
    "jax": ("jax", "jax", "jax", "ENGINE"),
    "jax-float32": ("jax", "jax", "jax", "SINGLE"),
}
_FEW = 30  # vehicles: more of them fly faster as arrays than as bytecode
_TRACING = 300  # vehicle-ticks that floats fly in the time that it takes to trace
_COMPILING = 9000  # vehicle-ticks that bytecode flies in the time that it takes to compile

__all__ = [
    "BYTECODE",
    "ENGINE_NAMES",
    "FLOATS",
    "NUMPY",
    "CompiledLoop",
    "Engine",
    "choose",
    "logged_ticks",
    "run_whole",
]


def choose(name: str, vehicles: int, ticks: int) -> Engine:
    """The engine of that name; "auto" takes the fastest that is installed for so many vehicles and ticks.

    Raises SpecError for an unknown name, BackendMissing for one whose library is not installed.
    """
    if name == "auto":
        name = _fastest(vehicles, ticks)
    if name not in ENGINE_NAMES:
        raise SpecError(f"engine must be one of auto, {', '.join(ENGINE_NAMES)}, got {shown(name)}")
    if name not in _OPTIONAL:
        return {"floats": FLOATS, "bytecode": BYTECODE, "numpy": NUMPY}[name]
    library, extra, module, value = _OPTIONAL[name]
    if find_spec(library) is None:
        remedy = f'pip install "aerobat[{extra}]"'
        raise BackendMissing(f"the {name} engine needs {library}; install it with {remedy}")
    engine: Engine = getattr(import_module(f"aerobat.engines.{module}"), value)
    return engine


def _fastest(vehicles: int, ticks: int) -> str:
    if vehicles * ticks <= _TRACING:
        return "floats"
    if vehicles * ticks <= _COMPILING:
        return "bytecode"
    if find_spec("llvmlite") is not None:
        return "compiled"
    return "bytecode" if vehicles <= _FEW else "numpy"
