"""A thousand wrong calls: every public function, method and class, with one argument that is wrong."""

from __future__ import annotations

import inspect
import random
import warnings
from pathlib import Path
from typing import Any

import pytest

import aerobat as ab
from public_calls import ENUMS, NOT_CALLED, RESULTS, Door, doors
from wrong_values import must_be_refused, zoo

CALLS = 1000
LONGEST = 700  # letters of a sentence, names that are known included
LONG = (
    "comparison_figure",
    "error_causes",
    "min_requirements",
    "plan_to_pass",
    "recoveries",
    "smallest_opening",
    "sweep_figure",
    "tune",
    "write_video",
)  # right, and studies or pictures
EXPENSIVE = {("compare", "planners", "None")}  # right, and all planners at work


@pytest.fixture(scope="module")
def public(tmp_path_factory: pytest.TempPathFactory) -> list[Door]:
    return list(doors(tmp_path_factory.mktemp("files")))


@pytest.fixture
def inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder so deep that what goes up from it stays in the test's."""
    folder = tmp_path / "a" / "b" / "c"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)


def refusal(door: Door, arguments: dict[str, Any]) -> str | None:
    """The sentence by which a call is refused, None where it is not; warnings are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            door.call(**arguments)
        except ab.AerobatError as error:
            return str(error)
    return None


def test_every_public_name_is_called(public: list[Door]) -> None:
    called = {door.name for door in public}
    assert set(ab.__all__) - called == {*RESULTS, *NOT_CALLED, *ENUMS}


@pytest.mark.parametrize("at_length", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_right_calls_are_right(at_length: bool, public: list[Door], inside: None) -> None:
    called = [door for door in public if (door.name in LONG) is at_length]
    refused = {door.name: said for door in called if (said := refusal(door, door.right)) is not None}
    assert refused.keys() <= {"plan", "compare", "Miqp.plan", "MinSnap.plan"}  # whose problems have no plan
    assert not {said for said in refused.values() if "must be" in said}


@pytest.mark.parametrize(("begin", "end"), [(0, 200), pytest.param(200, CALLS, marks=pytest.mark.slow)])
def test_a_thousand_wrong_calls_are_each_met_with_a_sentence(
    begin: int, end: int, public: list[Door], inside: None
) -> None:
    wrong = zoo()
    calls = [(door, name, kind) for door in public for name in door.right for kind in wrong]
    count = 0
    for door, name, kind in random.Random(11).sample(calls, CALLS)[begin:end]:
        if (door.name, name, kind) in EXPENSIVE:
            continue
        case = f"{door.name}, {name}={kind}"
        said = refusal(door, door.right | {name: wrong[kind]})
        if must_be_refused(door, name, kind):
            assert said is not None, case
            assert name.split(".")[-1] in said, (case, said)
        if said is not None:
            count += 1
            assert said.isprintable(), (case, said)
            assert len(said) < LONGEST + 5000 * (kind == "long"), (case, said)
    assert count > (end - begin) * 2 // 3


def test_missing_and_unknown_arguments_are_named(public: list[Door], inside: None) -> None:
    for door in (each for each in public if each.name in ab.__all__ and each.right):
        said = refusal(door, door.right | {"nonsense": 1})
        assert said is not None, door.name
        assert "nonsense" in said, (door.name, said)
        if needed := required(door):
            said = refusal(door, {})
            assert said is not None, door.name
            assert needed[0].name in said, (door.name, said)


def required(door: Door) -> list[inspect.Parameter]:
    """The arguments without a default."""
    parameters = inspect.signature(door.call).parameters.values()
    return [each for each in parameters if each.default is each.empty and each.kind is not each.VAR_KEYWORD]
