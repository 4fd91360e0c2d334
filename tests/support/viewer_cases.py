"""What tests of replays share: flights that are seen, and what a page holds."""

from __future__ import annotations

import json
import re
from base64 import b64decode
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

import aerobat as ab
from reporting_cases import simulated
from shared_plans import shared_plan

NUMBERS = {"f4": np.float32, "i2": np.int16}


@lru_cache
def dispersed(count: int = 50) -> ab.Flight:
    """A batch along the flip through the gate, some of which are too heavy to reach it."""
    agile = ab.load_vehicle("agile-quad")
    masses = agile.mass * np.linspace(0.9, 1.35, count)
    fleet = [replace(agile, mass=float(mass)) for mass in masses]
    return ab.fly(shared_plan("flip-roll"), fleet, rate=200.0)


def header(page: str) -> dict[str, Any]:
    """What a page says of its scene."""
    found = re.search(r'<script id="header" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return dict(json.loads(found[1]))


def array(page: str, place: dict[str, Any]) -> np.ndarray:
    """Numbers of a page as its script reads them."""
    found = re.search(r'<script id="arrays" type="text/plain">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    assert place["offset"] % 4 == 0, "else the browser refuses the view"
    kind = NUMBERS[place["kind"]]
    raw = np.frombuffer(b64decode(found[1]), kind, place["length"], place["offset"])
    return raw * place["scale"]


def flip() -> tuple[ab.Flight, ab.Plan]:
    """The flip in roll through a gate, flown."""
    return simulated("flip-roll"), shared_plan("flip-roll")
