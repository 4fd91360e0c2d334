"""Settings as declared values: whatever is wrong is one sentence that names the class and the field."""

import pickle
import subprocess
import sys
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from refusals import complaint

SETTINGS = (
    ab.Dispersion,
    ab.MotionCapture,
    ab.Envelope,
    ab.GridSearch,
    ab.BisectionSearch,
    ab.Miqp,
    ab.MinSnap,
    ab.FreeKnots,
    ab.TimeOptimal,
    ab.FlightConfig,
    ab.Controller,
)
FIELDS = [(cls, each.name) for cls in SETTINGS for each in fields(cls)]  # type: ignore[arg-type]
NUMBERS = [where for where in FIELDS if type(getattr(where[0](), where[1])) in (int, float)]
JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.complex_numbers(),
    st.text(max_size=3),
    st.lists(st.floats(), max_size=4),
    st.dictionaries(st.text(max_size=3), st.floats(), max_size=2),
    st.sampled_from([10**400, ab.Miqp(), ab.GridSearch(), ab.Limits(), object()]),
)


@pytest.mark.parametrize(("cls", "field"), NUMBERS, ids=lambda x: getattr(x, "__name__", x))
def test_text_truth_complex_numbers_and_nothing_are_no_numbers(cls: type, field: str) -> None:
    for wrong in ("1", True, 1j, None, np.nan, object(), np.ones(2)):
        said = complaint(lambda: cls(**{field: wrong}))  # noqa: B023
        assert said.startswith(f"{cls.__name__}.{field} must be "), (wrong, said)
        assert said.isprintable()


@given(st.sampled_from(FIELDS), JUNK)
def test_any_value_in_any_field_makes_a_value_or_one_sentence(where: tuple[type, str], junk: Any) -> None:
    cls, field = where
    made: list[Any] = []
    said = complaint(lambda: made.append(cls(**{field: junk})))
    assert said.isprintable()
    named = (
        field,
        "last must be ",
        "imu is missing",
        "motion_capture is missing",
    )  # what a field asks of others, too
    assert made or said.startswith(tuple(f"{cls.__name__}.{each}" for each in named))
    for value in made:
        assert not isinstance(junk, bool | complex) or isinstance(junk, bool) is isinstance(
            getattr(value, field), bool
        )
        assert pickle.loads(pickle.dumps(value)) == value
        assert replace(value) == value


def test_no_limit_is_infinite_and_a_limit_is_positive() -> None:
    assert ab.Envelope(speed=np.inf, tilt=np.float64(1)) == ab.Envelope(tilt=1.0)
    assert complaint(lambda: ab.Envelope(moment=0)) == "Envelope.moment must be positive, got 0"


def test_a_settings_field_that_does_not_exist_is_named_with_the_one_that_was_meant() -> None:
    plan = ab.plan(ab.load_problem("line"), ab.Miqp(intervals=10), vehicle=None)
    said = complaint(lambda: ab.fly(plan, ab.load_vehicle("agile-quad"), sead=1))
    assert said == "FlightConfig.sead is not a known key; did you mean 'seed'?"


def test_a_planner_is_declared_and_registered_in_one_line_or_over_a_dataclass() -> None:
    class Stepwise(ab.Planner):
        """One's own."""

        steps: int = ab.option(3, "The steps.")

        def plan(self, problem: Any, vehicle: Any = None, progress: Any = None) -> ab.Plan:
            return ab.Miqp(intervals=self.steps).plan(problem)

    @dataclass(frozen=True)
    class Plain:
        """One's own, of no base."""

        steps: int = ab.option(3, "The steps.")

        def plan(self, problem: Any, vehicle: Any = None, progress: Any = None) -> ab.Plan:
            return ab.Miqp(intervals=self.steps).plan(problem)

    for cls in (Stepwise, Plain):
        made = ab.planner(f"settings-{cls.__name__.lower()}")(cls)
        assert ab.registered_planners()[made.kind] is made  # type: ignore[attr-defined]
        assert ab.plan(ab.load_problem("line"), made(steps=10), vehicle=None).planner == "miqp"
        assert complaint(lambda: made(steps="3")).endswith(".steps must be a whole number, got '3'")  # noqa: B023


def test_a_class_that_plans_nothing_is_no_planner() -> None:
    class Idle:
        pass

    assert "must inherit from Planner" in complaint(lambda: ab.planner("idle")(Idle))  # type: ignore[type-var]
    assert "idle" not in ab.registered_planners()


@pytest.mark.process
def test_a_planner_without_a_word_about_itself_leaves_the_help_whole() -> None:
    code = (
        "import aerobat as ab; ab.planner('mute')(type('Mute', (), {'plan': lambda self, *_: None}));"
        "from aerobat.cli import options"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
