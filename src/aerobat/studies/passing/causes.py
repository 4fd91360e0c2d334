"""The main cause of failures: each cause is switched off alone, for the same flights."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

from aerobat.environment import Dispersion
from aerobat.simulation import FlightConfig
from aerobat.studies.share import Share

SWITCHED_OFF: Mapping[str, Mapping[str, Any]] = MappingProxyType(  # conditions without each cause
    {
        "the spread of mass": {"mass": 0.0},
        "the spread of inertia": {"inertia": 0.0},
        "the spread of the rotors' thrust": {"rotor": 0.0},
        "the spread of the rotors' lag": {"lag": 0.0},
        "unmodelled drag": {"drag": 0.0},
        "the start": {"start_position": 0.0, "start_velocity": 0.0, "start_attitude": 0.0},
        "the control rate": {"control_rate": None},
        "the computation delay": {"computation_delay": 0.0},
        "what the sensors say": {"imu": None, "motion_capture": None},
        "gusts": {"gusts": None},
        "the battery": {"battery": None},
    }
)


def main_failure_cause(
    conditions: Dispersion, probability: float, share: Callable[[Dispersion], Share]
) -> str:
    """Return a sentence on the cause without which most flights pass; empty where nothing varies.

    `share` flies the same flights under other conditions, and returns the share that passes.
    """
    shares: dict[str, Share] = {}
    for cause, off in SWITCHED_OFF.items():
        without = replace(conditions, **off)
        period = 1.0 / (without.control_rate or FlightConfig().rate)
        without = replace(without, computation_delay=min(without.computation_delay, period))
        if without != conditions:
            shares[cause] = share(without)
    if not shares:
        return ""
    most = max(shares, key=lambda cause: shares[cause].count)
    found = f"without it {shares[most]} pass"
    if shares[most].fraction >= probability:
        return f"{most} stands in the way: {found}"
    return f"no single cause stands in the way, {most} the most: {found}"
