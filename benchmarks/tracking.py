"""Tracking of every maneuver: rotor-feasible plans of order 4 and 5, and the paper's plans of order 3.

uv run python benchmarks/tracking.py
"""

from collections.abc import Iterator

import aerobat as ab

COLUMNS = (
    "vehicle",
    "problem",
    "plan",
    "duration s",
    "position error cm",
    "attitude error ° RMS",
    "gate miss mm",
    "gate speed m/s",
)


def main() -> None:
    print(f"| {' | '.join(COLUMNS)} |")
    print("|" + " --- |" * len(COLUMNS))
    for vehicle, problem, plan, kind in plans():
        result = ab.score(ab.fly(plan, vehicle), problem, vehicle)
        gate = "– | –"
        if result.passages:
            gate = f"{1000 * result.passages[0].miss:.1f} | {result.passages[0].speed:.1f}"
        print(
            f"| {vehicle.name} | {problem.name} | {kind} | {plan.duration:.2f} "
            f"| {100 * result.max_position_error_m:.2f} | {result.rms_attitude_error_deg:.2f} | {gate} |"
        )


PROBLEMS = ("flip-pitch", "flip-roll", "flip-roll-translation", "half-flip", "line", "section-v")


def plans() -> Iterator[tuple[ab.Vehicle, ab.Problem, ab.Plan, str]]:
    for name in ("crazyflie", "agile-quad", "hexarotor"):
        vehicle = ab.load_vehicle(name)
        for problem in map(ab.load_problem, PROBLEMS):
            for order in (4, 5):
                yield vehicle, problem, ab.plan(problem, ab.Miqp(order=order), vehicle), f"order {order}"
    for problem in map(ab.load_problem, PROBLEMS):
        paper = problem.as_in_paper()
        yield vehicle, paper, ab.plan(paper, ab.Miqp(order=3), vehicle=None), "paper"


if __name__ == "__main__":
    main()
