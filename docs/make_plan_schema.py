"""Write docs/plan.schema.json, of a .plan file's document: `uv run python docs/make_plan_schema.py`."""

from __future__ import annotations

import json
from math import isfinite
from pathlib import Path
from typing import Any

from aerobat.planning.plan_file import FORMAT, FRAMES, REVISION, facts_adapter

SCHEMA = Path(__file__).parent / "plan.schema.json"
FILES = "as in its file, where what is usual may be left out: see files.md"
NUMBERS = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}

PIECE = {
    "type": "object",
    "description": "a convex piece of an obstacle: hull of points, each with L y, |y| ≤ 1, L the rounding",
    "properties": {
        "name": {"type": "string"},
        "points": {"type": "array", "items": NUMBERS, "minItems": 1},
        "rounding": {"type": "array", "items": NUMBERS, "minItems": 3, "maxItems": 3},
    },
    "required": ["name", "points", "rounding"],
}


def schema() -> str:
    """The whole file."""
    evidence = in_short(facts_adapter().json_schema(mode="serialization"))
    definitions = evidence.pop("$defs")
    environment = {
        "type": "object",
        "description": "[m/s²], [m/s] and [m]",
        "properties": {
            "gravity": {"type": "number"},
            "wind": NUMBERS,
            "ground": {"type": ["number", "null"]},
            "obstacles": {"type": "array", "items": PIECE, "description": "since revision 5"},
        },
        "required": ["gravity", "wind", "ground"],
    }
    properties = {
        "revision": {"type": "integer", "minimum": 1, "description": f"missing in 0, this is {REVISION}"},
        "aerobat": {"type": "string", "description": "the version that wrote it"},
        "frames": {"type": "object", "properties": {key: {"const": text} for key, text in FRAMES.items()}},
        "environment": environment,
        "problem": {"type": "object", "description": FILES},
        "vehicle": {"type": ["object", "null"], "description": FILES},
        "evidence": evidence,
    }
    document = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"document of {FORMAT}",
        "type": "object",
        "required": ["aerobat", "problem", "vehicle", "evidence"],
        "properties": properties,
        "$defs": definitions,
    }
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def in_short(described: Any) -> Any:
    """A schema with descriptions of a line, without names that repeat keys or defaults that JSON lacks."""
    if isinstance(described, list):
        return [in_short(each) for each in described]
    if not isinstance(described, dict):
        return described
    return {
        key: value.partition("\n")[0] if key == "description" else in_short(value)
        for key, value in described.items()
        if not (key == "title" and isinstance(value, str))
        and not (key == "default" and isinstance(value, float) and not isfinite(value))
    }


if __name__ == "__main__":
    SCHEMA.write_text(schema(), encoding="utf-8")
