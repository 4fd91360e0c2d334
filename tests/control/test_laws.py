"""Control laws, ready-made and of one's own: flown by every engine, swept and judged like ours."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat.control import CONTROL_LAWS, Seen
from aerobat.control.laws.lqr import regulator
from aerobat.declaration import Positive
from aerobat.kernels.control_loops import thrust_demand
from aerobat.kernels.quaternions import axes
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.kernels.vectors import ZERO, dot
from command_lines import run, without_pictures
from looping_flights import QUAD, assert_same, loops, near, one
from refusals import complaint
from shared_plans import shared_plan

LAWS = ("lee", "lqr", "indi", "rates")
SHORT = loops(0.3)
GENTLE = ab.Trajectory(SHORT.durations, 0.01 * SHORT.coefficients)


@ab.controller("thrust-alone")
class ThrustAlone(ab.ControlLaw):
    """The reference's thrust, and no moment."""

    part: Positive = 1.0  # [-] of the thrust

    def step(self, ops: Any, model: Any, state: Any, seen: Seen, elapsed: Any) -> tuple[Any, RotorWrench]:
        """Return the force."""
        demand = thrust_demand(model.airframe.mass_properties, model.environment, seen.reference)
        thrust = dot(demand.value, axes(seen.body.q_world_body)[2])
        return state, RotorWrench(self.part * model.airframe.mass_properties.mass * thrust, ZERO)


@ab.controller("thrust-for-floats")
class ThrustForFloats(ThrustAlone):
    """The same, as anybody would write it."""

    def step(self, ops: Any, model: Any, state: Any, seen: Seen, elapsed: Any) -> tuple[Any, RotorWrench]:
        """Return the force."""
        if self.part > 0.0 and seen.body.velocity[2] < 1e6:
            return super().step(ops, model, state, seen, elapsed)
        return state, RotorWrench(0.0, ZERO)


@ab.controller("thrust-by-equality")
class ThrustByEquality(ThrustAlone):
    """More thrust on the plane x = 0, and less off the plane y = 0."""

    def step(self, ops: Any, model: Any, state: Any, seen: Seen, elapsed: Any) -> tuple[Any, RotorWrench]:
        """Return the force."""
        x, y, _ = seen.reference.position
        state, (thrust, moment) = super().step(ops, model, state, seen, elapsed)
        factor = ops.select(x == 0.0, 1.1, 1.0) * ops.select(y != 0.0, 0.9, 1.0)
        return state, RotorWrench(factor * thrust, moment)


@pytest.mark.parametrize("law", [*LAWS, ThrustAlone(0.9), ThrustByEquality()], ids=str)
@pytest.mark.parametrize("engine", ["compiled", pytest.param("jax", marks=pytest.mark.slow)])
def test_every_engine_flies_a_law_to_the_same_numbers(law: Any, engine: str) -> None:
    starts = near(2)
    flights = (ab.fly(SHORT, QUAD, start=starts, controller=law, engine=e) for e in ("floats", engine))
    assert_same(*flights, atol=1e-9)


@pytest.mark.parametrize("law", LAWS)
def test_a_flight_by_a_law_is_the_same_in_a_batch_and_alone(law: str) -> None:
    starts = near(3)
    batch = ab.fly(SHORT, QUAD, start=starts, controller=law, engine="compiled")
    alone = ab.fly(SHORT, QUAD, start=one(starts, 1), controller=law, engine="compiled")
    assert_same(batch[1], alone)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("problem", ["flip-roll", "half-flip"])
def test_the_laws_fly_maneuvers_through_their_gates(problem: str, law: str) -> None:
    plan = shared_plan(problem)
    score = ab.score(ab.fly(plan, controller=law, engine="compiled"), plan)
    assert score.outcome is ab.Outcome.THROUGH_GATES
    assert score.max_position_error_m < (0.005 if law == "rates" else 0.002)  # behind a gyro's filter


def test_a_law_of_ones_own_is_flown_as_itself_and_by_its_name() -> None:
    own, named = (
        ab.fly(GENTLE, QUAD, controller=law, engine="compiled") for law in (ThrustAlone(), "thrust-alone")
    )
    assert own == named
    weaker = ab.fly(GENTLE, QUAD, controller=ThrustAlone(part=0.9), engine="compiled")
    assert weaker != own


def test_the_engine_of_floats_flies_a_law_with_branches() -> None:
    branching = ab.fly(SHORT, QUAD, controller=ThrustForFloats(), engine="floats")
    assert_same(branching, ab.fly(SHORT, QUAD, controller=ThrustAlone(), engine="floats"))


FOR_FLOATS_ALONE = {
    "abs": lambda z: abs(z),
    "power": lambda z: z**2,
    "if": lambda z: z if z > 0.0 else -z,
    "max": lambda z: max(z, 0.0),
    "math": lambda z: math.sin(z),
    "ufunc": lambda z: np.tanh(z),
    "norm": lambda z: np.linalg.norm((z, z)),
    "array": lambda z: (np.ones(3) * z)[0],
}


@pytest.mark.parametrize("compute", FOR_FLOATS_ALONE.values(), ids=list(FOR_FLOATS_ALONE))
@pytest.mark.parametrize("method", ["init", "step"])
def test_a_law_that_cannot_be_compiled_is_refused_with_its_line_and_the_remedy(
    compute: Any, method: str
) -> None:
    def computed(law: Any, ops: Any, *others: Any) -> Any:
        seen = next(each for each in others if isinstance(each, Seen))
        compute(seen.body.position[2])
        return getattr(ThrustAlone, method)(law, ops, *others)

    computed.__name__ = method
    law: Any = type("Own", (ThrustAlone,), {method: computed})()
    said = complaint(lambda: ab.fly(GENTLE, QUAD, controller=law, engine="compiled"))
    place = f"{__file__}:{compute.__code__.co_firstlineno}"
    assert said.startswith(f"{place}: controller 'thrust-alone': {method}() cannot be compiled for `")
    assert 'or fly the law by the engine floats (engine="floats")' in said
    compute(1.0)


def test_a_law_is_swept_under_conditions_flight_by_flight_as_it_is_flown() -> None:
    plan, gusty = shared_plan("half-flip"), ab.Dispersion(rotor=0.05, start_position=0.02)
    swept = ab.sweep(plan, gusty, runs=6, workers=1, controller="lqr", engine="compiled")
    flown = ab.fly(plan, conditions=gusty, flights=range(4, 5), controller="lqr", engine="compiled")
    error = ab.score(flown[0], plan).max_position_error_m
    assert swept.table["max_position_error_m"][4] == pytest.approx(error, rel=1e-9)
    assert swept.success.fraction == 1.0


def test_a_slow_vehicle_is_flown_by_gains_that_its_rotors_allow() -> None:
    plan = shared_plan("line", "crazyflie")
    for law in LAWS:
        flight = ab.fly(plan, controller=law, engine="compiled")
        assert flight.position_error.max() < 0.05, law


def test_the_regulator_of_two_integrators_is_the_one_of_the_textbook() -> None:
    k1, k2 = regulator((0.5, np.inf), 2.0)
    assert (k1, k2) == pytest.approx((4.0, np.sqrt(8.0)))
    chain = np.eye(4, k=1)
    chain[-1] = -np.array(regulator((0.1, 0.8, 6.0, 120.0), 3000.0))
    assert np.linalg.eigvals(chain).real.max() < -2.0


def test_what_is_no_controller_is_refused_with_what_would_be_one() -> None:
    plan = shared_plan("line")
    unknown = complaint(lambda: ab.fly(plan, controller="leee"))
    assert "no controller named 'leee'; did you mean 'lee'?" in unknown
    wrong: Any = 3
    assert "must be a Controller, a ControlLaw or the name of one, got 3" in complaint(
        lambda: ab.fly(plan, controller=wrong)
    )
    assert "controller is a law" in complaint(lambda: ab.sensitivity(plan, "mass", controller="lee"))
    assert {"full", "paper"}.isdisjoint(CONTROL_LAWS)


def test_the_command_line_flies_a_law_of_a_file(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    without_pictures(monkeypatch)
    shared_plan("line").save("line.plan")
    Path("mine.py").write_text(
        "import aerobat as ab\nfrom aerobat.control.laws.lee import Lee\n\n\n"
        '@ab.controller("lee-of-mine")\nclass Mine(Lee):\n    position_gain: float = 10.0\n'
    )
    code, out, err = run(capsys, "fly", "line.plan", "--import", "mine.py", "--controller", "lee-of-mine")
    assert (code, err) == (0, "")
    assert "lee-of-mine" in out
    assert Path("out/line-flown-lee-of-mine/report.json").exists()


def test_a_law_stays_as_it_was_when_it_is_replaced_in_part() -> None:
    law = CONTROL_LAWS["lee"]()
    assert replace(law, position_gain=1.0) != law  # type: ignore[call-arg]
    assert replace(law) == law
