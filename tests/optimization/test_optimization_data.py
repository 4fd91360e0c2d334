"""Programs as data: what is refused, what is recomputed, how solvers are found."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerobat.errors import AerobatError, BackendMissing, SpecError
from aerobat.optimization import (
    BACKENDS,
    AssignmentProgram,
    SlottedStage,
    available_backends,
    backends,
    solver,
)
from aerobat.optimization.result import verified
from paper_program import FLIP_ROLL, flip

GOOD: dict[str, Any] = {
    "equality": np.ones((1, 2)),
    "target": np.ones(1),
    "rows": np.eye(2),
    "lower": np.zeros(2),
    "upper": np.full(2, inf),
    "stages": (SlottedStage("up", (0, 1), np.array([[0], [1]]), 0.75, inf),),
}


def test_a_stage_takes_the_cheaper_slot() -> None:
    result = solver().solve(AssignmentProgram(**GOOD | {"equality": np.array([[1.2, 1.0]])}))
    assert result.slots == (0,)
    np.testing.assert_allclose(result.x, [0.75, 0.1], atol=1e-12)
    assert result.cost == pytest.approx(0.75**2 + 0.1**2)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"rows": np.ones(2)}, "rows"),
        ({"rows": [[np.nan, 1.0]]}, "rows"),
        ({"equality": np.ones((1, 3))}, "equality"),
        ({"rows": np.ones((2, 2, 2))}, "rows must have no more axes than 2"),
        ({"target": np.ones(2)}, "target"),
        ({"target": np.ones((3, 1))}, "target must have no more axes than 1"),
        ({"lower": np.zeros((3, 2))}, "lower must have no more axes than 1"),
        ({"lower": [0.0, np.nan]}, "lower"),
        ({"lower": [0.0, inf]}, "lower must not be inf"),
        ({"upper": [1.0]}, "upper"),
        ({"precedence": ((0, 1),)}, "precedence"),
        ({"stages": (SlottedStage("far", (0,), np.array([[2]]), 0.0, 1.0),)}, "stage 'far': rows"),
    ],
)
def test_a_program_that_does_not_fit_together_is_refused_by_name(change: dict[str, Any], named: str) -> None:
    with pytest.raises(SpecError, match=named):
        AssignmentProgram(**GOOD | change)


@pytest.mark.parametrize(
    ("slots", "rows", "upper", "named"),
    [
        ((), np.zeros((0, 1), dtype=int), 1.0, "slots"),
        ((1, 1), np.zeros((2, 1), dtype=int), 1.0, "slots"),
        ((0, 1), np.zeros((1, 1), dtype=int), 1.0, "rows"),
        ((0,), np.zeros((1, 1)), 1.0, "rows"),
        ((0,), np.zeros((1, 1), dtype=int), [1.0, 2.0], "upper"),
        ((0,), np.zeros((1, 1), dtype=int), np.nan, "upper"),
    ],
)
def test_a_stage_that_does_not_fit_together_is_refused_by_name(
    slots: tuple[int, ...], rows: Any, upper: Any, named: str
) -> None:
    with pytest.raises(SpecError, match=f"stage 'up': {named}"):
        SlottedStage("up", slots, rows, -inf, upper)


def test_what_a_program_holds_cannot_be_changed() -> None:
    rows = np.eye(2)
    program = AssignmentProgram(**GOOD | {"rows": rows})
    rows[0, 0] = 7.0
    assert program.rows[0, 0] == 1.0
    stage = program.stages[0]
    for array in (program.rows, program.lower, program.precedes, stage.rows, stage.upper):
        assert not array.flags.writeable


def test_a_stage_is_not_put_where_it_has_no_slot() -> None:
    with pytest.raises(SpecError, match=r"stage 'up' cannot sit in slot 5; its slots are \(0, 1\)"):
        AssignmentProgram(**GOOD).bounds_for((5,))


def test_programs_with_other_bounds_share_their_matrices() -> None:
    program = AssignmentProgram(**GOOD)
    other = replace(program, upper=[1.0, 1.0])
    for name in ("rows", "equality"):
        assert getattr(other, name) is getattr(program, name)
    assert other.upper.tolist() == [1.0, 1.0]


def test_a_claim_is_checked_against_the_program() -> None:
    program = AssignmentProgram(**GOOD)
    good = solver().solve(program)
    assert good.x is not None
    false = [
        replace(good, x=good.x + np.array([1e-3, 0.0])),  # off the equality
        replace(good, slots=(1 - good.slots[0],)),  # not where it says
        replace(good, slots=(5,)),  # a slot that the stage does not have
        replace(good, x=np.array([1.2, -0.2])),  # off the range
    ]
    for claim in false:
        result = verified(program, claim)
        assert (result.status, result.x, result.cost, result.gap) == ("unknown", None, inf, inf)
    assert verified(program, replace(good, cost=0.0)).cost == good.cost


def test_stages_that_cannot_share_slots_or_be_ordered_are_infeasible() -> None:
    stage = GOOD["stages"][0]
    crowd = AssignmentProgram(**GOOD | {"stages": (stage,) * 3})
    circle = AssignmentProgram(**GOOD | {"stages": (stage,) * 2, "precedence": ((0, 1), (1, 0))})
    for backend in ("builtin", "gurobi"):
        assert solver(backend).solve(crowd).status == "infeasible"
        assert solver(backend).solve(circle).status == "infeasible"


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_start_without_a_slot_for_each_stage_is_refused(backend: str) -> None:
    with pytest.raises(SpecError, match="start must have one slot for each of the 1 stages"):
        solver(backend).solve(AssignmentProgram(**GOOD), start=())


def test_back_ends_declare_the_names_that_they_are_found_by() -> None:
    assert available_backends() == tuple(BACKENDS) == tuple(solver(name).name for name in BACKENDS)


def test_an_unknown_backend_is_answered_with_a_suggestion() -> None:
    with pytest.raises(SpecError, match="did you mean 'gurobi'"):
        solver("gurobbi")
    with pytest.raises(SpecError, match="choose from builtin, gurobi, scip"):
        solver("x")


def test_a_missing_backend_is_answered_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(backends, "find_spec", lambda name: None if name == "pyscipopt" else object())
    assert available_backends() == ("builtin", "gurobi")
    with pytest.raises(BackendMissing, match=r"pip install 'aerobat\[scip\]'"):
        solver("scip")


def test_a_program_beyond_gurobis_free_licence_is_answered_in_a_sentence() -> None:
    with pytest.raises(
        AerobatError, match="200 variables with a quadratic objective and this program has 277"
    ):
        solver("gurobi").solve(flip(FLIP_ROLL, intervals=40, dt=0.05))


def test_a_missing_licence_of_gurobi_is_answered_in_its_own_words(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("GRB_LICENSE_FILE", str(tmp_path / "none.lic"))
    with pytest.raises(AerobatError, match=r"Gurobi failed: .*none\.lic"):
        solver("gurobi").solve(AssignmentProgram(**GOOD))


@pytest.mark.parametrize("backend", ["builtin", "gurobi", "scip"])
def test_solvers_are_silent(backend: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert solver(backend).solve(AssignmentProgram(**GOOD)).status == "optimal"
    assert capfd.readouterr() == ("", "")
