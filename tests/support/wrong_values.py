"""Values that are wrong in most places."""

from __future__ import annotations

import inspect
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np

import aerobat as ab
from public_calls import Door, NoPlan, flight, ignored, plan

NEVER = ("bytes", "complex", "set", "object", "class", "module", "ellipsis", "complexes", "words")
TEXTS = ("text", "line", "up", "nul", "surrogate", "empty", "long")


def zoo() -> dict[str, Any]:
    """Values that few arguments take, by what they are called."""
    return {
        "None": None,
        "True": True,
        "text": "0.85",
        "line": "a\nb",
        "up": "../../up",
        "nul": "a\0b",
        "surrogate": "\ud800",
        "empty": "",
        "long": "x" * 5000,
        "bytes": b"1",
        "complex": 1j,
        "huge": 10**400,
        "nan": np.nan,
        "inf": np.inf,
        "-inf": -np.inf,
        "-1": -1,
        "0": 0,
        "-0.5": -0.5,
        "90": 90,
        "1e15": 1e15,
        "1e300": 1e300,
        "1e-300": 1e-300,
        "list": [],
        "nones": [None],
        "texts": ["1"],
        "ragged": [[1.0], 2.0],
        "dict": {},
        "table": {"name": 1},
        "set": {1.0},
        "object": object(),
        "class": ab.Vehicle,
        "module": ab,
        "function": ignored,
        "ellipsis": ...,
        "decimal": Decimal("1.5"),
        "range": range(3),
        "generator": iter(()),
        "path": Path("no/such/file"),
        "array": np.ones((2, 2)),
        "nothing": np.empty(0),
        "nans": np.full(3, np.nan),
        "complexes": np.ones(3, complex),
        "words": np.array(["a", "b", "c"]),
        "truths": np.ones(3, bool),
        "int64": np.int64(-7),
        "float32": np.float32(np.nan),
        "vehicle": ab.load_vehicle("crazyflie"),
        "problem": ab.load_problem("line"),
        "plan": plan(),
        "trajectory": plan().trajectory,
        "flight": flight(),
        "planner": NoPlan(),
        "envelope": ab.Envelope(),
    }


def must_be_refused(door: Door, argument: str, kind: str) -> bool:
    """True where no reading of the annotation takes a value of this kind."""
    parameter = inspect.signature(door.call).parameters.get(argument)
    annotation = "" if parameter is None else str(parameter.annotation)
    if "Any" in annotation or argument in ("default", "command_default"):
        return False
    right = door.right[argument]
    if kind == "class" and (callable(right) or "Callable" in annotation):  # which can be called too
        return False
    is_number = isinstance(right, int | float | np.ndarray) and not isinstance(right, bool)
    return kind in NEVER or (is_number and kind in (*TEXTS, "True", "truths"))
