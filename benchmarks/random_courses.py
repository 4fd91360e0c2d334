"""Random courses, planned by a named planner or the one that is taken where none is named, and flown.

    uv run python benchmarks/random_courses.py [--planner free-knots] [--count 30] [--seed 0] [--cases K ...]

Case k of a seed is always the same: 3 to 12 gates of any heading, slope and tilt in a room of 20 m, some of
them passed anywhere in their opening, some with the thrust along their upright, however they are tilted, from
rest to rest with `agile-quad`. Every course is planned as the command line does it, with a reserve for the
controller, certified or refused in words, and what is certified is flown. Times are of the processor, on one
core.
"""

import argparse
import os
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

import aerobat as ab
from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.planning.planners import planner_class, planner_options
from aerobat.problem import Gate, PassGate

ROOM = 20.0  # [m] its sides
WALL = 2.0  # [m] from the walls to places, at least
APART = 3.0  # [m] from one place to another, at least
GATES = (3, 12)
WIDTH, HEIGHT = (1.0, 2.0), (0.8, 1.6)  # [m] of openings
UPRIGHT = 0.25  # of the gates: they are passed with the thrust along their upright
ANYWHERE = 0.5  # of the gates: they are passed anywhere in their opening
MARGIN = 0.1  # [m] from its edges to the body there


def random_course(seed: int, k: int) -> ab.Problem:
    """Case `k` of a seed."""
    rng = np.random.default_rng([seed, k])
    while True:
        count = int(rng.integers(GATES[0], GATES[1] + 1))
        places = _places(rng, count + 2)
        gates = tuple(_gate(rng, place, number) for number, place in enumerate(places[1:-1], 1))
        course = ab.Course(tuple(_passage(rng, gate) for gate in gates))
        room = ab.Limits(lower=np.zeros(3), upper=np.full(3, ROOM))
        ends = ab.at_rest(places[0]), ab.at_rest(places[-1])
        try:
            return ab.Problem(f"course-{seed}-{k}", *ends, course, gates, room)
        except SpecError:  # a gate in another's opening
            continue


def _places(rng: np.random.Generator, count: int) -> Array:
    """Places in the room, each at a distance from all others."""
    places = [rng.uniform(WALL, ROOM - WALL, 3)]
    while len(places) < count:
        place = rng.uniform(WALL, ROOM - WALL, 3)
        if np.linalg.norm(np.array(places) - place, axis=1).min() > APART:
            places.append(place)
    return np.array(places)


def _gate(rng: np.random.Generator, place: Array, number: int) -> Gate:
    heading, tilt = rng.uniform(-np.pi, np.pi, 2)
    slope = np.arcsin(rng.uniform(-1.0, 1.0))  # directions of passage all over the sphere
    sides = rng.uniform(*WIDTH), rng.uniform(*HEIGHT)
    return ab.tilted_gate(place, heading, slope, tilt, *sides, name=f"gate {number}")


def _passage(rng: np.random.Generator, gate: Gate) -> PassGate:
    upright, anywhere = bool(rng.uniform() < UPRIGHT), bool(rng.uniform() < ANYWHERE)
    point, margin = ("free", MARGIN) if anywhere else ("centre", 0.0)
    return PassGate(gate.name, crossing_point=point, margin=margin, upright=upright)


def planned(problem: ab.Problem, vehicle: ab.Vehicle, planner: str | None = None) -> Plan:
    """The plan that the command line makes, by a named planner or the one that it takes itself."""
    if planner is None:
        return ab.plan(problem, vehicle=vehicle)
    cls = planner_class(planner)
    options = {o.name: o.command_default for o in planner_options(cls) if o.command_default is not None}
    return ab.plan(problem, cls(**options), vehicle)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=30, help="cases (30)")
    parser.add_argument("--seed", type=int, default=0, help="their seed (0)")
    parser.add_argument("--cases", type=int, nargs="+", help="these alone")
    parser.add_argument("--planner", help="by this one, say free-knots")
    options = parser.parse_args()
    vehicle = ab.load_vehicle("agile-quad")
    spent, errors = [], []
    for k in options.cases or range(options.count):
        problem = random_course(options.seed, k)
        asked = sum(element.upright for element in problem.maneuver.elements)
        facts = [f"{k:>3}", f"{len(problem.gates):>2} gates, {asked} upright"]
        began = time.process_time()
        try:
            plan = planned(problem, vehicle, options.planner)
        except ab.Infeasible as refusal:
            spent.append(time.process_time() - began)
            print(*facts, f"refused in {spent[-1]:.1f} s: {refusal}", sep="; ", flush=True)
            continue
        spent.append(time.process_time() - began)
        facts += [plan.planner, f"{plan.duration:.3f} s in {spent[-1]:.1f} s"]
        facts.append("certified" if plan.certified else f"NOT CERTIFIED: {plan.certificate.why}")
        flight = ab.fly(plan)
        score = ab.score(flight, plan)
        errors.append(float(flight.position_error.max()))
        passed = sum(passage.failure is None for passage in score.passages)
        facts += [f"flown within {100 * errors[-1]:.2f} cm", f"{passed} of {len(problem.gates)} passed"]
        print(*facts, score.sentence, sep="; ", flush=True)
    print(
        f"{len(errors)} of {len(spent)} planned; "
        f"median {np.median(spent):.1f} s, longest {max(spent):.1f} s; "
        f"largest error {100 * max(errors, default=np.nan):.2f} cm"
    )


if __name__ == "__main__":
    main()
