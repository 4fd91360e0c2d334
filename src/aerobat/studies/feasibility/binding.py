"""The limits that a certified plan comes nearest to, by the names of their fields."""

from __future__ import annotations

from math import inf

from aerobat.certification import Finding
from aerobat.planning import Plan
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.problem.problem import UNITS

AS_NEAR = 0.01  # of a limit's size: closer than plans that use all of it come to tell apart


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
        if finding.field:
            margin = finding.margin / _size(finding, plan)
            nearest[finding.field] = min(nearest.get(finding.field, inf), margin)
    least = min(nearest.values(), default=inf)
    return tuple(sorted(name for name, margin in nearest.items() if margin <= least + AS_NEAR))


def least_reserve(plan: Plan) -> float | None:
    """The fraction of its range that every rotor is proven to keep from either limit; None where unknown."""
    if plan.certificate is None or plan.certificate.worst is None:
        return None
    return reserve_shortfalls(plan.certificate, 1.0)[0].kept


def _size(finding: Finding, plan: Plan) -> float:
    """The size of what a limit is about, in its unit: of positions how far the path goes."""
    assert finding.limit is not None, "a finding about a limit has one"
    if finding.unit != UNITS[0]:
        return finding.size or abs(finding.limit) or 1.0
    lowest, highest = plan.trajectory.component_range(0)
    return max(float((highest - lowest).max()), abs(finding.limit) * 1e-9, 1e-9)
