"""The four causes of error that the paper's authors name (IV-B), for any conditions and controller."""

from __future__ import annotations

from dataclasses import replace
from math import radians

from aerobat.control import Controller
from aerobat.environment import Dispersion, HandOff
from aerobat.errors import SpecError
from aerobat.studies.error_causes.cause import Cause

OFFSET, TURN = 0.05, radians(2.0)  # [m], [rad] of the second camera system, as an old calibration leaves it
SLOWER = 1.5  # times as slow as tuned are the loops of the detuned controller


def four_causes(conditions: Dispersion, controller: Controller) -> tuple[Cause, ...]:
    """Rotors that the plan does not know, a bad hand-off, jerk as the input, gains that are not tuned.

    They suit a planner with an order, 4 or more without them. Raises SpecError for conditions without motion
    capture, which hands nothing over.
    """
    capture = conditions.motion_capture
    if capture is None:
        raise SpecError(
            f"conditions '{conditions.name}' have no motion capture, whose hand-off is a cause; take lab"
        )
    hand_off = replace(capture.hand_off or HandOff(), translation=OFFSET, rotation=TURN)
    return (
        Cause("rotors not known", {"vehicle_known": False}),
        Cause("hand-off 5 cm, 2°", {"conditions.motion_capture.hand_off": hand_off}),
        Cause("jerk as input", {"planner.order": 3}),
        Cause(
            "gains not tuned",
            {
                "controller.position_gain": controller.position_gain / SLOWER**2,
                "controller.velocity_gain": controller.velocity_gain / SLOWER,
                "controller.integral_gain": controller.integral_gain / SLOWER**3,
                "controller.attitude_frequency": controller.attitude_frequency / SLOWER,
                "controller.attitude_integral_gain": controller.attitude_integral_gain / SLOWER**3,
            },
        ),
    )
