"""Results as JSON: their facts by key, units in the keys."""

from __future__ import annotations

import json
from collections.abc import Mapping
from enum import Enum
from math import isfinite
from typing import Any

import numpy as np

from aerobat.reporting.facts import Columns, Fact, Facts, facts


def plain(value: Any) -> Any:
    """A result, or a value of a fact, as numbers, strings, lists and dictionaries.

    None stands for what is not known or not limited, as JSON has neither NaN nor infinity.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Enum):
        return value.value if isinstance(value, str) else value.name.lower()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple) and not isinstance(value, Facts):
        return [plain(each) for each in value]
    return {fact.key: plain(fact.value) for fact in facts(value) if is_filed(fact)}


def is_filed(fact: Fact) -> bool:
    """True for a fact that stands in files."""
    return bool(fact.key) and not isinstance(fact.value, Columns)


def to_json(result: Any) -> str:
    """A result, or a list of results, as JSON text."""
    return json.dumps(plain(result), indent=2, ensure_ascii=False, allow_nan=False)
