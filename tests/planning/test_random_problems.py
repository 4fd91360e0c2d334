"""Random problems of the audit: the same for every seed, of all kinds, and what they ask can be met."""

from pathlib import Path

import numpy as np
import pytest

from aerobat.problem import load_problem
from aerobat.vehicle import load_vehicle
from hard_problems import HARDSHIPS, hard_case
from random_problems import KINDS, MIXED, random_case, write_case

CASES = range(60)


def test_a_case_is_the_same_whenever_it_is_made(tmp_path: Path) -> None:
    for name in ("first", "second"):
        write_case(random_case(3, 7), tmp_path / name, "case")
    for file in ("case.toml", "case-vehicle.toml"):
        assert (tmp_path / "first" / file).read_text() == (tmp_path / "second" / file).read_text()


def test_a_case_written_is_the_case_read(tmp_path: Path) -> None:
    case = random_case(0, 9)
    write_case(case, tmp_path, "case")
    assert str(load_problem(tmp_path / "case.toml")) == str(case.problem)
    vehicle = load_vehicle(tmp_path / "case-vehicle.toml")
    np.testing.assert_array_equal(vehicle.allocation, case.vehicle.allocation)


def test_all_kinds_and_many_vehicles_are_drawn() -> None:
    cases = [random_case(0, k) for k in CASES]
    assert {case.kind for case in cases} == set(MIXED)
    assert len({case.vehicle.mass for case in cases}) >= 12
    assert {len(case.vehicle.rotors) for case in cases} == {4, 6, 8}


@pytest.mark.parametrize("kind", KINDS)
def test_one_kind_is_drawn_where_it_is_asked_for(kind: str) -> None:
    assert {random_case(1, k, (kind,)).kind for k in range(5)} == {kind}


def test_every_vehicle_has_drag_and_hovers() -> None:
    for k in CASES:
        case = random_case(0, k)
        case.vehicle.require_hover(case.problem.environment.gravity)
        assert (case.vehicle.drag_body > 0.0).all()


def test_hard_cases_hover_under_several_hardships_at_once() -> None:
    told = set()
    for k in CASES:
        case = hard_case(0, k)
        case.vehicle.require_hover(case.problem.environment.gravity)
        names = case.problem.description.split(", ")
        assert 3 <= len(set(names)) == len(names) <= 5
        told |= set(names)
    assert told == set(HARDSHIPS)
