"""Plans through published courses, time-optimal or polynomials, beside the numbers published for them.

    uv run python benchmarks/courses.py [--planner free-knots] [--cases balls hover flown squares lap closed]

Times are of the processor, on one core, from the problem to the certified plan, imports left out. The course
is that of Foehn, Romero and Scaramuzza, Science Robotics 6 (56), 2021, as the presets hold it; headings and
sizes of the square openings are those of TOGT-Planner's race_uzh_19g.yaml. `flown` is with the vehicle's
rotor lag and a reserve of 3 %, upright at the end, and flown by its controller; the others have neither lag
nor reserve, as there. `closed` is a lap that ends as it begins.
"""

import argparse
import os
import time
from dataclasses import replace

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # one thread for everyone, before NumPy starts its own

import numpy as np

import aerobat as ab
from aerobat.planning import Plan
from aerobat.problem import EndState
from aerobat.vehicle import Vehicle

PRESET = ab.load_problem("split-s-19")
LAP = tuple(tuple(element.position.tolist()) for element in PRESET.maneuver.elements)
HEADINGS = (0.0, -20.0, -130.0, 180.0, 0.0, 70.0, 200.0)  # [deg]
RADIUS = PRESET.maneuver.elements[0].radius  # [m] of waypoints
SIDE = 2.4  # [m] of gates, whose centre of mass may pass within
OPENING = 1.6  # [m]
PLANNERS = {"time-optimal": ab.TimeOptimal, "free-knots": ab.FreeKnots}
WINDOW = 0.1  # [s] about the planned instant
PUBLISHED = {
    "balls": "CPC 17.56 s in 50 min, AOS 17.93 s in 6 s",
    "hover": "the same, upright at the end",
    "flown": "",
    "squares": "AOS-TOGT 16.83 s",
    "lap": "a prototype of ours 7.346 s",
    "closed": "",
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--cases", nargs="+", choices=PUBLISHED, default=list(PUBLISHED), help="which (all)")
    parser.add_argument("--planner", choices=PLANNERS, default="time-optimal", help="which (time-optimal)")
    options = parser.parse_args()
    planner = PLANNERS[options.planner]
    lagging = ab.load_vehicle("agile-quad")
    vehicle = replace(lagging, rotors=tuple(replace(rotor, lag=0.0) for rotor in lagging.rotors))
    for case in options.cases:
        began = time.process_time()
        if case == "flown":
            plan = planner(reserve=0.03).plan(problem_of(case, lagging), lagging)
        else:
            plan = planner().plan(problem_of(case, vehicle), vehicle)
        spent = time.process_time() - began
        proof = "certified" if plan.certified else f"NOT CERTIFIED: {plan.certificate.why}"
        facts = [
            f"{plan.duration:.3f} s in {spent:.1f} s",
            proof,
            f"{plan.intervals} intervals",
            PUBLISHED[case],
        ]
        print(f"{case:>8}: " + "; ".join(filter(None, facts)), flush=True)
        if case == "flown":
            print(f"{'':>8}  {flown(plan)}", flush=True)


def problem_of(case: str, vehicle: Vehicle) -> ab.Problem:
    """The problem of a case."""
    if case == "closed":
        return ab.load_problem("lap-7")
    preset = ab.load_problem("race-7") if case == "lap" else PRESET
    goal = EndState(preset.goal.position, free_attitude=case not in ("hover", "flown"))
    if case != "squares":
        return replace(preset, name=case, goal=goal)
    gates = tuple(
        ab.tilted_gate(point, np.radians(heading), width=SIDE, height=SIDE, name=f"gate {number}")
        for number, (point, heading) in enumerate(zip(LAP, HEADINGS, strict=True), 1)
    )
    margin = (SIDE - OPENING) / 2 - vehicle.body_radius
    through = tuple(
        ab.Waypoint(gate=gate.name, crossing_point="free", margin=margin) for gate in (gates * 3)[:19]
    )
    return replace(preset, name=case, goal=goal, maneuver=ab.Waypoints(through), gates=gates)


def flown(plan: Plan) -> str:
    """The plan's own flight in words: its error, and how near to their centres it meets the balls."""
    flight = ab.fly(plan)
    position, velocity = flight.states.position, flight.states.velocity
    nearest = []
    for placed, stage in zip(plan.stages, plan.problem.stages(1.0).stages, strict=True):
        near = np.abs(flight.times - placed.time) < WINDOW
        offset = position[near] - stage.ball.centre
        # between two ticks the path is straight
        along = velocity[near] / np.linalg.norm(velocity[near], axis=-1, keepdims=True)
        across = offset - np.sum(offset * along, axis=-1, keepdims=True) * along
        nearest.append(float(np.linalg.norm(across, axis=-1)[np.argmin(np.linalg.norm(offset, axis=-1))]))
    error = float(np.max(flight.position_error))
    return f"flown within {100 * error:.4f} cm; balls of {RADIUS} m met within {max(nearest):.5f} m"


if __name__ == "__main__":
    main()
