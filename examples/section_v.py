"""The paper's Section V: a closed-form path, slowed down until the rotors can fly it (Figs. 8, 9 and 10).

Over 6 m, through a height of -2 m on the way. The search shifts both times by 0.1 s at each iteration and
ends at the first path that keeps every rotor within its limits. Stopped early, its path asks for thrusts that
no rotor gives: they saturate, and the vehicle falls off the path.
"""

import sys
from pathlib import Path

import aerobat as ab
from paper.tracking import tracking_figure

out = Path(sys.argv[1] if len(sys.argv) > 1 else "section-v")
out.mkdir(parents=True, exist_ok=True)

vehicle = ab.load_vehicle("section-v")
problem = ab.load_problem("section-v")


def tracked(planner: ab.MinSnap, picture: str) -> tuple[ab.Plan, ab.Flight]:
    """Plan, fly, say how both went, and draw what was asked against what was flown."""
    plan = ab.plan(problem, planner, vehicle)
    for k, attempt in enumerate(plan.attempts, start=1):
        print(f"{k:4d}  {attempt.duration:.1f} s  {attempt.outcome}")
    flight = ab.fly(plan)
    print(f"{plan.status}; {ab.score(flight, plan, vehicle)}\n")
    tracking_figure(plan, vehicle, flight).savefig(out / picture)
    return plan, flight


plan, flight = tracked(ab.MinSnap(), "fig-9-feasible.png")  # 12 iterations
ab.draw(flight, plan).savefig(out / "fig-8-path.png")
tracked(ab.MinSnap(stop_after=6), "fig-10-stopped-early.png")
