"""Random courses, planned by a named planner or the one that is taken where none is named, and flown.

    uv run python benchmarks/random_courses.py [--written] [--planner free-knots] [--count 30] [--cases K ...]

Case k of a seed is always the same: 3 to 12 gates of any heading, slope and tilt in a room of 20 m, some of
them passed anywhere in their opening, some with the thrust along their upright, however they are tilted, from
rest to rest with `agile-quad`. With `--written`, courses are as a person writes them: start and goal on the
ground, 3 to 8 gates of any kind along a tour, for a random vehicle of one's own; case k is written as files,
which `--folder` keeps. Every course is planned as the command line does it, with a reserve for the
controller, certified or refused in words. A plan is flown once as planned, under `lab` as often as the
verdict of `aerobat fly` takes, and 200 times more. Times are of the processor, on one core.
"""

import argparse
import os
import time
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

import aerobat as ab
from aerobat.arrays import Array
from aerobat.environment import load_dispersion
from aerobat.errors import SpecError
from aerobat.planning import Plan
from aerobat.planning.planners import command_settings, planner_class
from aerobat.problem import Gate, Line, PassGate
from aerobat.reporting.report import Report
from aerobat.studies.flights import FlightTask, fly_trials
from aerobat.studies.share import Trials
from aerobat.vehicle import Vehicle
from random_problems import Case, random_vehicle, write_case

LAB = load_dispersion("lab")
FRESH = 200  # flights beside those of the verdict
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


def written_course(seed: int, k: int) -> Case:
    """Case `k` of a seed, in a writer's round numbers: a tour from the ground through gates to the ground."""
    rng = np.random.default_rng([seed, k, 1])
    vehicle = random_vehicle(rng)
    while True:
        heading, place = rng.uniform(-180.0, 180.0), np.zeros(2)
        gates = []
        for number in range(1, int(rng.integers(3, 9)) + 1):
            heading += rng.normal(0.0, 35.0)
            place = place + _leg(rng, heading)
            gates.append(_written_gate(rng, place, heading, number, vehicle))
        goal = np.zeros(2) if rng.uniform() < 0.25 else (place + _leg(rng, heading)).round(1)
        maneuver = Line() if rng.uniform() < 0.3 else ab.Course(tuple(PassGate(gate.name) for gate in gates))
        ends = ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((*goal, 0.0))
        ground = ab.Environment(ground=0.0)
        try:
            problem = ab.Problem(f"written-{seed}-{k}", *ends, maneuver, tuple(gates), environment=ground)
            return Case(problem, vehicle, "course")
        except SpecError:  # a gate in another's opening
            continue


def _leg(rng: np.random.Generator, heading: float) -> Array:
    """A way of 2 to 5 m along a heading [deg]."""
    angle = np.radians(heading)
    return rng.uniform(2.0, 5.0) * np.array([np.cos(angle), np.sin(angle)])


def _written_gate(
    rng: np.random.Generator, place: Array, heading: float, number: int, vehicle: Vehicle
) -> Gate:
    """An upright gate as a rule, some tilted or sloped, at least thrice as wide as the vehicle."""
    least = max(1.0, 6.0 * float(vehicle.bounding_ellipsoid.semi_axes.max()))  # [m]
    wide = float(round(least * rng.uniform(1.0, 1.6), 1))
    tall = float(round(wide * rng.uniform(0.6, 1.0), 1))
    tilt = float(rng.choice([0.0, 0.0, 0.0, 0.0, 30.0, -45.0, 90.0]))
    slope = float(rng.choice([0.0, 0.0, 0.0, 15.0, -15.0]))
    position = (*place.round(1), float(round(0.5 * wide + rng.uniform(0.3, 2.0), 1)))
    angles = np.radians([round(heading / 5.0) * 5.0, slope, tilt])
    corners = np.array([[-0.5 * wide, -0.4 * tall], [0.5 * wide, -0.4 * tall], [0.0, 0.8 * tall]])
    kind = rng.uniform()
    opening = (
        {"radius": 0.5 * wide}
        if kind < 0.2
        else {"polygon": corners}
        if kind < 0.3
        else {"width": wide, "height": tall}
    )
    return ab.tilted_gate(position, *angles, name=f"gate {number}", **opening)


def planned(problem: ab.Problem, vehicle: ab.Vehicle, planner: str | None = None) -> Plan:
    """The plan that the command line makes, by a named planner or the one that it takes itself."""
    if planner is None:
        return ab.plan(problem, vehicle=vehicle)
    cls = planner_class(planner)
    return ab.plan(problem, cls(**command_settings(cls)), vehicle)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=30, help="cases (30)")
    parser.add_argument("--seed", type=int, default=0, help="their seed (0)")
    parser.add_argument("--cases", type=int, nargs="+", help="these alone")
    parser.add_argument("--planner", help="by this one, say free-knots")
    parser.add_argument("--written", action="store_true", help="as a person writes them, from the ground")
    parser.add_argument("--folder", type=Path, help="where files of the cases and plans are kept")
    options = parser.parse_args()
    spent, errors, shares, told = [], [], [], []
    for k in options.cases or range(options.count):
        if options.written:
            case = written_course(options.seed, k)
        else:
            case = Case(random_course(options.seed, k), ab.load_vehicle("agile-quad"), "course")
        if options.folder is not None:
            write_case(case, options.folder, f"{options.seed}-{k}")
        problem, vehicle = case.problem, case.vehicle
        asked = sum(isinstance(each, PassGate) and each.upright for each in _elements(problem))
        facts = [f"{k:>3}", f"{vehicle.name}, {len(problem.gates)} gates, {asked} upright"]
        began = time.process_time()
        try:
            plan = planned(problem, vehicle, options.planner)
        except ab.Infeasible as refusal:
            spent.append(time.process_time() - began)
            print(*facts, f"refused in {spent[-1]:.1f} s: {refusal}", sep="; ", flush=True)
            continue
        spent.append(time.process_time() - began)
        if options.folder is not None:
            plan.save(options.folder / f"{problem.name}.plan")
        facts += [plan.planner, f"{plan.duration:.3f} s in {spent[-1]:.1f} s"]
        facts.append("certified" if plan.certified else f"NOT CERTIFIED: {plan.certificate.why}")
        flight = ab.fly(plan)
        score = ab.score(flight, plan)
        errors.append(float(flight.position_error.max()))
        passed = sum(passage.failure is None for passage in score.passages)
        facts += [f"flown within {100 * errors[-1]:.2f} cm", f"{passed} of {len(problem.gates)} passed"]
        began = time.process_time()
        trials = fly_trials(FlightTask(plan, vehicle, LAB, 0, vehicle.controller))
        told.append(time.process_time() - began)
        report = Report(plan, score, trials=trials)
        fresh = ab.sweep(plan, LAB, runs=FRESH, seed=1, workers=1)
        shares.append((report.is_well, fresh.success.fraction))
        counts = (
            f"{share.count} {end.name.lower().replace('_', ' ')}" for end, share in fresh.outcomes.items()
        )
        facts += [
            f"exit {0 if report.is_well else 1}",
            f"{trials.share} of {trials.share.of} in {told[-1]:.1f} s",
        ]
        facts += [f"fresh {', '.join(counts)}"]
        print(*facts, score.sentence, sep="; ", flush=True)
    well = [share for is_well, share in shares if is_well]
    print(
        f"{len(errors)} of {len(spent)} planned; "
        f"median {np.median(spent):.1f} s, longest {max(spent):.1f} s; "
        f"largest error {100 * max(errors, default=np.nan):.2f} cm; {len(well)} end with 0, of which "
        f"{sum(share >= Trials.NEEDED for share in well)} pass {100 * Trials.NEEDED:g} % of {FRESH} fresh "
        f"flights under lab, the least {100 * min(well, default=np.nan):.1f} %; "
        f"a verdict takes {np.median(told):.1f} s, the longest {max(told, default=np.nan):.1f} s"
    )


def _elements(problem: ab.Problem) -> tuple[object, ...]:
    return getattr(problem.maneuver, "elements", ())


if __name__ == "__main__":
    main()
