"""Why nothing feasible was found: which bound binds, and what would free it.

Nothing is advised that was not tried.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf

import numpy as np

from aerobat.optimization import solver
from aerobat.planning.miqp.formulation import Formulation
from aerobat.planning.recorder import Attempt
from aerobat.problem.problem import DERIVATIVES, UNITS
from aerobat.vehicle import Vehicle

OUT_OF_TIME = "no solution was found in time"
NOT_CONVERGED = "the solver did not converge"
PROBES = 4  # durations at which a relaxed problem is tried


def why_infeasible(formulation: Formulation, attempts: Sequence[Attempt], vehicle: Vehicle | None) -> str:
    """One sentence: the vehicle, when some program had a solution, otherwise the bounds that exclude all."""
    tried = [a.duration / formulation.chain.intervals for a in attempts]
    said = f"'{formulation.problem.name}' has no plan at any dt from {min(tried):.3g} to {max(tried):.3g} s"
    solved = [a for a in attempts if a.cost is not None]
    if solved and vehicle is not None:
        best = max(solved, key=lambda a: -inf if a.margin is None else a.margin).outcome
        return f"{said} that {vehicle.name} can fly: at best, {best}"
    binding = list(_binding(formulation, tried))
    unanswered = sum(a.status == "unknown" for a in attempts)
    if not binding and unanswered:
        return (
            f"no plan of '{formulation.problem.name}' was found at any dt from {min(tried):.3g} to "
            f"{max(tried):.3g} s; {unanswered} of {len(attempts)} programs were left without an answer, so "
            "that there may be one"
        )
    if not binding:
        return (
            f"{said}: its stages, goal and limits exclude each other, and dropping any one of them does not "
            "help"
        )
    return f"{said}: {' or '.join(binding)} binds; without it the program has a solution"


def _binding(formulation: Formulation, dts: Sequence[float]) -> Iterator[str]:
    """Each bound whose removal, alone, makes some duration feasible."""
    probes = np.unique(np.quantile(dts, np.linspace(0.0, 1.0, PROBES), method="nearest"))
    for name, relaxed in _relaxations(formulation):
        search = solver("builtin")
        if any(search.solve(relaxed.program(float(dt))).x is not None for dt in probes):
            yield name


def _relaxations(formulation: Formulation) -> Iterator[tuple[str, Formulation]]:
    problem, sequence = formulation.problem, formulation.sequence
    for derivative in range(formulation.chain.order + 1):
        bound = problem.path_limits.of(derivative)[1]
        if np.isfinite(np.concatenate(problem.path_limits.of(derivative))).any():
            name = f"limits.{DERIVATIVES[derivative]} ({np.min(bound):g} {UNITS[derivative]})"
            if derivative == 0:
                name = "the volume between limits.lower and limits.upper"
            yield (
                name,
                replace(
                    formulation, problem=replace(problem, limits=problem.path_limits.without(derivative))
                ),
            )
    for i, stage in enumerate(sequence.stages):
        others = sequence.stages[:i] + sequence.stages[i + 1 :]
        yield f"the stage '{stage.name}'", replace(formulation, sequence=replace(sequence, stages=others))
    if sequence.path_constraints:
        yield (
            "what holds at every interval",
            replace(formulation, sequence=replace(sequence, path_constraints=())),
        )
