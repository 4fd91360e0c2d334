"""Engines that run kernels: plain floats, machine code, or arrays on a GPU."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from aerobat.declaration import shown
from aerobat.engines.engine import CompiledLoop, Engine, logged_ticks, run_whole
from aerobat.engines.floats import FLOATS
from aerobat.errors import BackendMissing, SpecError

_MODULES = {  # modules and names; each is imported when it is chosen
    "floats": ("floats", "FLOATS"),
    "compiled": ("llvm.engine", "ENGINE"),
    "jax": ("jax", "ENGINE"),
    "jax-float32": ("jax", "SINGLE"),
}
ENGINE_NAMES = tuple(_MODULES)
_TRACE_COST = 300  # vehicle-ticks that the engine `floats` computes in the time of a trace

__all__ = ["ENGINE_NAMES", "FLOATS", "CompiledLoop", "Engine", "choose", "logged_ticks", "run_whole"]


def choose(name: str, vehicles: int, ticks: int) -> Engine:
    """Return the engine of that name; "auto" chooses the fastest for this number of vehicles and ticks.

    SpecError is raised for an unknown name, BackendMissing for an engine whose library is not installed.
    """
    if name == "auto":
        name = "floats" if vehicles * ticks <= _TRACE_COST else "compiled"
    if name not in _MODULES:
        raise SpecError(f"engine must be one of auto, {', '.join(ENGINE_NAMES)}, got {shown(name)}")
    if name.startswith("jax") and find_spec("jax") is None:
        raise BackendMissing(f'the {name} engine needs jax; install it with pip install "aerobat[jax]"')
    module, value = _MODULES[name]
    engine: Engine = getattr(import_module(f"aerobat.engines.{module}"), value)
    return engine
