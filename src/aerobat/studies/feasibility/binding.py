"""The limit that binds, by the name of its field: of a plan by its certificate, of a refusal by its words."""

from __future__ import annotations

import re
from math import inf

from aerobat.arrays import AXES
from aerobat.certification import Finding, Side
from aerobat.planning import Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.problem.problem import DERIVATIVES

ROTOR_SIDES = {Side.MIN: "min_thrust", Side.MAX: "max_thrust"}
THROUGHOUT = "path_constraints"  # of the maneuver
AS_NEAR = 0.01  # of a limit's size: closer than plans that use all of it come to tell apart
WORDS = (  # of sentences, the first that is there, and the limit that they are about
    (r"limits\.(lower and limits\.upper|\w+)", r"limits.\1"),
    (rf"\b({'|'.join(DERIVATIVES[1:])}) [xyz]\b", r"limits.\1"),
    (r"\bposition [xyz]\b", "limits.lower and limits.upper"),
    (r"\bbody rate\b", "max_body_rate"),
    (r"\brotor|\bhover\b", "rotors"),
    (r"\breserve\b", "reserve"),
    (r"\bspecific thrust\b|what holds at every interval", THROUGHOUT),
    (r"\bthe body of\b|\bframe\b", "gate"),
    (r"(stage '[^']*')", r"\1"),
    (r"(gate '[^']*')", r"\1"),
)


def binding_limits(plan: Plan) -> tuple[str, ...]:
    """The limits that a certified plan comes nearest to, as parts of their sizes, and all that are as near.

    Where it begins and ends does not count: there it is as it was asked to be.
    """
    assert plan.certificate is not None, "a plan for a vehicle has a certificate"
    ends = (0.0, plan.duration)
    nearest: dict[str, float] = {}
    for finding in plan.certificate.findings:
        if finding.margin is None or finding.place is not None or finding.time in ends:
            continue
        name = _field(finding, plan)
        if name:
            nearest[name] = min(nearest.get(name, inf), finding.margin / _size(finding, plan))
    least = min(nearest.values(), default=inf)
    return tuple(sorted(name for name, margin in nearest.items() if margin <= least + AS_NEAR))


def least_reserve(plan: Plan) -> float | None:
    """The fraction of its range that every rotor is proven to keep from either limit; None where unknown."""
    if plan.certificate is None or plan.certificate.worst is None:
        return None
    return reserve_shortfalls(plan.certificate, 1.0)[0].kept


def limits_in(sentence: str) -> tuple[str, ...]:
    """The limit that a refusal is about; none where it names none that is known."""
    for pattern, name in WORDS:
        found = re.search(pattern, sentence)
        if found:
            return (found.expand(name),)
    return ()


def _field(finding: Finding, plan: Plan) -> str:
    """The name of the field that has a finding's limit; nothing for the sum of all rotors' limits."""
    quantity, is_low = finding.quantity, finding.side is Side.MIN
    if quantity.startswith("rotor "):
        return ROTOR_SIDES[finding.side]
    if quantity == "body rate":
        return "max_body_rate"
    if " along " in quantity:
        return THROUGHOUT
    derivative, axis = quantity.split()[0], quantity[-1]
    if derivative != DERIVATIVES[0]:
        return f"limits.{derivative}" if derivative in DERIVATIVES else ""
    if axis == "z" and is_low and finding.limit == plan.problem.environment.ground:
        return "environment.ground"
    return "limits.lower" if is_low else "limits.upper"


def _size(finding: Finding, plan: Plan) -> float:
    """The size of what a limit is about, in its unit."""
    assert plan.vehicle is not None, "limits of rotors are a vehicle's"
    assert finding.limit is not None, "a finding about a limit has one"
    quantity = finding.quantity
    if quantity.startswith("rotor "):
        rotor = plan.vehicle.rotors[int(quantity.split()[1])]
        return rotor.max_thrust - rotor.min_thrust
    if quantity.startswith(DERIVATIVES[0]):
        lowest, highest = (end[AXES.index(quantity[-1])] for end in plan.trajectory.component_range(0))
        return max(float(highest - lowest), abs(finding.limit) * 1e-9, 1e-9)
    if " along " in quantity and finding.unit == "m/s²":
        return plan.vehicle.max_specific_thrust
    return abs(finding.limit) or 1.0
