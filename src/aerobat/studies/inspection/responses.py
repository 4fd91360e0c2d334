"""The error that each cause leaves in the closed position loop; being linear, they add up to the whole."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from aerobat.arrays import Array
from aerobat.studies.inspection.disturbances import Disturbances, PositionLoop, ShortfallCause

_DIGITS = 9  # of a row's duration [s], so that rows alike are stepped alike
_ANSWERED = 1e-3  # [m/s²] of feedback, below which it answers nothing but rounding
NAMES = ("start", "hand-off", "vehicle", "saturation", "delay", "gains")  # of every flight


def responses(
    times: Array,
    start: tuple[Array, Array],
    found: Disturbances,
    loop: PositionLoop,
    unsaturated: str,
    fault: str | None = None,
) -> dict[str, Array]:
    """Errors [m] by their causes, (T, 3) each.

    What is missing in a saturation that the plan did not ask for goes to the cause whose error was the
    largest when it began: that error is what the controller was answering. Where the inner loop has a fault,
    all that is missing goes to it, but for what the plan asked too much.

    Args:
        times: Of the rows [s], (T,).
        start: The error of position [m] and of velocity [m/s] in the first row, (3,) each.
        found: Accelerations held between rows.
        loop: The position loop.
        unsaturated: The cause of what is missing without a saturation, of NAMES.
        fault: The cause that is the inner loop's, if it has a fault.
    """
    names = NAMES if fault is None else (*NAMES, fault)
    state = np.zeros((3, len(names), 3))  # position, velocity, integral
    state[0, 0], state[1, 0] = start
    errors = [state[0]]
    durations = np.round(np.diff(times), _DIGITS)
    steps = {float(h): _step(float(h), loop) for h in np.unique(durations)}
    usual = names.index(fault or unsaturated)
    answered, before = usual, ShortfallCause.UNSATURATED
    for row, h in enumerate(durations):
        kind = ShortfallCause(found.kinds[row])
        if kind is not before:
            is_faults = fault is not None and kind is ShortfallCause.LED_TO
            answered = usual if is_faults else _cause(kind, state, loop, usual)
        before = kind
        push = np.zeros((len(names), 3))
        push[names.index("hand-off")] = found.observer[row]
        push[names.index("vehicle")] = found.vehicle[row]
        push[answered] += found.missing[row]
        forward, gain = steps[float(h)]
        state = np.einsum("ij,jck->ick", forward, state) + gain[:, None, None] * push
        errors.append(state[0])
    series = np.stack(errors)
    return {name: series[:, k] for k, name in enumerate(names)}


def _cause(kind: ShortfallCause, state: Array, loop: PositionLoop, unsaturated: int) -> int:
    """The number of the cause of what is missing from now on."""
    if kind is ShortfallCause.ASKED_BY_PLAN:
        return NAMES.index("saturation")
    if kind is ShortfallCause.UNSATURATED:
        return unsaturated
    off, rate = np.linalg.norm(state[:2], axis=-1)
    sizes = loop.position * off + loop.velocity * rate
    return int(np.argmax(sizes)) if sizes.max() > _ANSWERED else unsaturated


def _step(h: float, loop: PositionLoop) -> tuple[Array, Array]:
    """The closed loop over one row: x → A x + b d."""
    rates = np.zeros((4, 4))
    rates[0, 1] = rates[1, 3] = rates[2, 0] = 1.0
    rates[1, :3] = -loop.position, -loop.velocity, -loop.integral
    whole = expm(h * rates)
    return whole[:3, :3], whole[:3, 3]
