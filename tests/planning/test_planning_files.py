"""A saved plan is the plan: what is judged, flown and shown from the file is what was planned."""

from __future__ import annotations

import json
import random
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.errors import SpecError
from aerobat.simulation.autopilot import Recoveries
from aerobat.storage import digest_of, read_arrays
from command_lines import run, without_pictures
from damaged_files import change_one_number
from suites import examples

VEHICLE = ab.load_vehicle("agile-quad")
WINDY = replace(
    ab.load_problem("half-flip"),
    heading=1.2,
    environment=ab.Environment(gravity=9.7, wind=(1.0, -0.5, 0.2), ground=-3.0),
)


@pytest.fixture(scope="module")
def plan() -> ab.Plan:
    return ab.plan(WINDY, vehicle=replace(VEHICLE, drag_body=(0.1, 0.1, 0.05)))


def test_a_plan_survives_its_file(plan: ab.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "half.plan")
    again = ab.load_plan(tmp_path / "half.plan")
    np.testing.assert_array_equal(again.trajectory.coefficients, plan.trajectory.coefficients)
    np.testing.assert_array_equal(again.trajectory.durations, plan.trajectory.durations)
    assert again.trajectory.heading == plan.trajectory.heading == 1.2
    assert again.problem == plan.problem
    assert again.vehicle == plan.vehicle
    assert again.certificate == plan.certificate
    assert (again.stages, again.attempts, str(again)) == (plan.stages, plan.attempts, str(plan))


def test_the_certificate_in_the_file_is_that_of_what_the_file_holds(plan: ab.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "half.plan")
    again = ab.load_plan(tmp_path / "half.plan")
    assert again.vehicle is not None
    envelope = again.evidence.task.envelope(again.stages)
    found = ab.certify(again.trajectory, again.vehicle, again.problem.environment, envelope)
    assert found == again.certificate


def test_what_is_flown_from_the_file_is_what_was_planned(plan: ab.Plan, tmp_path: Path) -> None:
    """Bit for bit: its heading, its vehicle, its wind."""
    plan.save(tmp_path / "half.plan")
    before, after = ab.fly(plan, seed=3), ab.fly(ab.load_plan(tmp_path / "half.plan"), seed=3)
    np.testing.assert_array_equal(before.states.q_world_body, after.states.q_world_body)
    np.testing.assert_array_equal(before.thrusts, after.thrusts)
    assert ab.score(before, plan).max_position_error_m < 0.05


def test_a_plan_without_a_vehicle_survives_too(tmp_path: Path) -> None:
    bare = ab.plan(ab.load_problem("line"), vehicle=None)
    bare.save(tmp_path / "line.plan")
    again = ab.load_plan(tmp_path / "line.plan")
    assert again.vehicle is None
    assert again.certificate is None
    assert str(again) == str(bare)


@given(seed=st.integers(0, 10**9))
@examples(60)
def test_a_file_with_any_one_number_changed_is_refused_or_proven_anew(
    plan: ab.Plan, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """With the digest as it was, or made anew."""
    path = tmp_path_factory.mktemp("changed") / "half.plan"
    plan.save(path)
    if not change_one_number(path, random.Random(seed)):
        with pytest.raises(SpecError, match="changed after it was written"):
            ab.load_plan(path)
        return
    with suppress(SpecError):  # a number that makes no sense there
        again = ab.load_plan(path)
        assert again.vehicle is not None
        envelope = again.evidence.task.envelope(again.stages)
        proven = ab.certify(again.trajectory, again.vehicle, again.problem.environment, envelope)
        assert again.certificate == proven


@pytest.mark.parametrize(
    ("begin", "end"), [(0, 1), pytest.param(1, 20, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_commands_call_nothing_certified_that_was_changed_and_is_not(
    plan: ab.Plan, begin: int, end: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    lines = (["check"], ["fly", "--out", "flown"], ["export", "--to", "csv", "--out", "x.csv"])
    for seed in range(begin, end):
        plan.save("half.plan")
        change_one_number(Path("half.plan"), random.Random(seed))
        is_certified = False
        with suppress(SpecError):
            is_certified = ab.load_plan("half.plan").certified
        for command, *options in lines:
            ended, out, err = run(capsys, command, "half.plan", *options)
            assert ended == 0 or not is_certified or command == "fly", (seed, command, err)
            assert ended in (1, 2) or is_certified, (seed, command, out)


def spoilt(path: Path, **changes: object) -> Path:
    content = read_arrays(path, "plan")
    document = json.loads(content["document"].tobytes())
    for key, value in changes.items():
        if key in content:
            content[key] = value
        elif value is None:
            del document[key]
        else:
            document[key] = value
    if "document" not in changes:
        content["document"] = np.frombuffer(json.dumps(document).encode(), dtype=np.uint8)
    del content["digest"]
    np.savez(path.open("wb"), **content, digest=digest_of(content))
    return path


@pytest.mark.parametrize("series", ["times", "heights", "lowest", "durations"])
@pytest.mark.parametrize("length", [0, 3])
def test_recoveries_of_unequal_lengths_are_refused(
    plan: ab.Plan, series: str, length: int, tmp_path: Path
) -> None:
    whole = Recoveries(*np.ones((4, 5)), reaction=0.1, ground=None)
    replace(plan, recoveries=whole).save(tmp_path / "half.plan")
    document = json.loads(read_arrays(tmp_path / "half.plan", "plan")["document"].tobytes())
    evidence = document["evidence"]
    del evidence["recoveries"][series][length:]
    with pytest.raises(SpecError, match="it is damaged"):
        ab.load_plan(spoilt(tmp_path / "half.plan", evidence=evidence))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"format": "aerobat-trajectory-1"}, "it holds aerobat-trajectory-1, not aerobat-plan-1"),
        ({"document": np.frombuffer(b"{", dtype=np.uint8)}, "it is damaged"),
        ({"document": np.frombuffer(b"[1]", dtype=np.uint8)}, "it is damaged"),
        ({"problem": None}, "it has no 'problem'"),
        ({"problem": {"name": "x"}}, "is missing; add it"),
        ({"evidence": {"planner": 3}}, "it is damaged"),
        ({"durations": np.array([-1.0])}, "durations must be"),
        ({"heading": np.array([1.0, 2.0])}, "heading must be a number"),
    ],
)
def test_a_file_that_is_no_plan_is_refused_in_one_sentence(
    plan: ab.Plan, tmp_path: Path, changes: dict, sentence: str
) -> None:
    plan.save(tmp_path / "half.plan")
    with pytest.raises(SpecError, match=sentence) as error:
        ab.load_plan(spoilt(tmp_path / "half.plan", **changes))
    assert "\n" not in str(error.value)


def test_a_truncated_file_is_refused_in_one_sentence(plan: ab.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "half.plan")
    whole = (tmp_path / "half.plan").read_bytes()
    for size in (0, 10, len(whole) // 2, len(whole) - 1):
        (tmp_path / "half.plan").write_bytes(whole[:size])
        with pytest.raises(SpecError, match="plan file"):
            ab.load_plan(tmp_path / "half.plan")
