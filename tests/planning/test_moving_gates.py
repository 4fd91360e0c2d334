"""Gates that move: planned where they are when they are passed, and judged there by all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.certification import Envelope, Verdict, certify
from aerobat.planning import PlacedStage
from aerobat.problem.planned_passage import PlannedPassage
from aerobat.simulation import Outcome

QUAD = replace(ab.load_vehicle("agile-quad"), drag_body=np.zeros(3))
ENDS = ab.at_rest((0.0, 0.0, 1.5)), ab.at_rest((6.0, 0.0, 1.5))
LINE = ab.load_problem("line").maneuver
MOTIONS = {
    "velocity": {"velocity": (0.3, 0.8, 0.0)},
    "path": {"path": ((0.0, 3.0, -0.4, 1.5), (0.5, 3.0, 0.0, 1.6), (1.5, 3.2, 0.3, 1.5))},
}


def moving(kind: str, **fields: object) -> ab.Gate:
    return replace(ab.tilted_gate((3.0, -0.4, 1.5)), **MOTIONS[kind], **fields)


@pytest.mark.slow
@pytest.mark.parametrize("kind", MOTIONS)
def test_a_gate_that_moves_is_planned_and_passed_where_it_is_then(kind: str, tmp_path: Path) -> None:
    gate = moving(kind)
    plan = ab.plan(ab.Problem("moving", *ENDS, LINE, (gate,)), ab.MinSnap(), QUAD)
    assert plan.certified
    assert plan.flies
    (place,) = plan.stages
    assert np.linalg.norm(plan.trajectory.evaluate(place.time) - gate.places(np.array(place.time))) < 0.01
    for plant in (None, "mujoco"):
        score = ab.score(ab.fly(plan, plant=plant), plan)
        assert score.outcome is Outcome.THROUGH_GATES
        assert score.passages[0].miss < 0.02
    plan.save(tmp_path / "moving.plan")
    assert ab.load_plan(tmp_path / "moving.plan").certificate == plan.certificate


@pytest.mark.parametrize("clear", [-0.02, 0.02])
@pytest.mark.parametrize("by_rows", [False, True])
def test_a_frame_that_moves_is_judged_where_it_is_by_proof_by_flight_and_by_mujoco(
    clear: float, by_rows: bool
) -> None:
    """A gate that goes aside is 2 cm too early aside, or not, for the body that goes straight through."""
    path = ab.Trajectory([1.0], [[[0.0, 0.0, 1.0], [4.0, 0.0, 0.0]]])
    velocity = np.array([-1.0, 1.5, 0.0])
    # what a round body sweeps of a plane is its shadow along the velocity relative to that
    shadow = float(QUAD.bounding_ellipsoid.semi_axes[1]) * np.hypot(1.0, 1.5 / 5.0)
    start = np.array([2.0, 0.6 - clear - shadow, 1.0 + QUAD.bounding_ellipsoid.centre[2]]) - 0.5 * velocity
    rows = [[t, *(start + t * velocity)] for t in (0.0, 0.2, 0.7, 1.0)]
    gate = ab.tilted_gate(start, width=1.2, height=1.0)
    gate = replace(gate, **({"path": rows} if by_rows else {"velocity": velocity}))
    passage = PlannedPassage(gate, 0.5, gate.up)
    certificate = certify(path, QUAD, envelope=Envelope(passages=(passage,)))
    (frame,) = certificate.frames
    problem = ab.Problem("past", *ENDS, ab.CustomManeuver((ab.Stage("gate", gate="gate"),)), (gate,))
    plan = ab.Plan(problem, path, "by hand", stages=(PlacedStage("gate", 0, 0.5, "gate"),), vehicle=QUAD)
    ours = ab.score(ab.fly(plan), plan).passages[0]
    felt = ab.score(ab.fly(plan, plant="mujoco"), plan)
    assert frame.value == pytest.approx(clear, abs=2e-3)
    assert ours.clearance == pytest.approx(clear, abs=2e-3)
    assert (frame.verdict is Verdict.HOLDS) == (clear > 0.0)
    assert (felt.outcome is Outcome.THROUGH_GATES) == (clear > 0.0)


def test_a_gate_that_moves_and_is_passed_twice_is_refused_in_a_sentence() -> None:
    course = ab.Course((ab.PassGate("gate"),), laps=2)
    problem = ab.Problem("laps", *ENDS, course, (moving("velocity"),))
    with pytest.raises(ab.SpecError, match="gate 'gate' moves, and is not passed once; let it stand still"):
        ab.plan(problem, vehicle=QUAD)
