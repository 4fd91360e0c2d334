"""Captions: lines on a plan, a flight and its score, which stand under the title of a page."""

from __future__ import annotations

import numpy as np

from aerobat.evaluation.score import Score
from aerobat.planning import Plan
from aerobat.simulation import Flight
from aerobat.simulation.outcome import length


def plan_caption(plan: Plan) -> str:
    """Return a line on how a plan was found."""
    dt = "" if plan.dt is None else f" of {plan.dt:.4f} s"
    order = "" if plan.order is None else f", order {plan.order}"
    cost = "" if plan.cost in (None, plan.duration) else f", cost {plan.cost:.6g}"
    solver = f"{plan.backend}, {plan.nodes} nodes, {1000 * plan.solve_time:.0f} ms".removeprefix(", ")
    return f"{plan.planner}: {plan.duration:.3f} s in {plan.pieces}{dt}{order}{cost} ({solver})"


def plan_captions(plan: Plan) -> list[str]:
    """Return lines on how a plan was found, its proof, and its flyability."""
    found = (plan.certificate, plan.flyability)
    return [plan_caption(plan), *(str(each) for each in found if each is not None)]


def score_caption(score: Score) -> str:
    """Return a line on a flight's outcome and errors."""
    error = (
        "" if score.outcome.is_success else f"position error at most {length(score.max_position_error_m)}, "
    )
    return (
        f"{score.sentence}; {error}"
        f"attitude error at most {score.max_attitude_error_deg:.2f}°, "
        f"{score.rms_attitude_error_deg:.2f}° RMS, "
        f"saturated {100 * score.saturated_fraction:.1f} % of the time"
    )


def error_caption(flight: Flight) -> str:
    """Return a line on the largest errors of a flight, or of a batch."""
    many = f"{len(flight.vehicles)} flights: " if flight.is_batch else ""
    return (
        f"{many}position error at most {length(float(flight.position_error.max()))}, "
        f"attitude error at most {np.rad2deg(flight.attitude_error.max()):.2f}°"
    )
