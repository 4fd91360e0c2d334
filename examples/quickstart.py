"""Plan a flip for a vehicle, fly it, score it, draw it: the whole data flow in a page."""

import sys
from pathlib import Path

import aerobat as ab

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")

vehicle = ab.load_vehicle("agile-quad")  # a preset's name, or a TOML file
problem = ab.load_problem("flip-roll")  # the paper's maneuver, or a TOML file
plan = ab.plan(problem, ab.Miqp(order=4), vehicle=vehicle)  # rotor-feasible
print(plan)

flight = ab.fly(plan.trajectory, vehicle, seed=0)
print(ab.score(flight, problem, vehicle))

out.mkdir(parents=True, exist_ok=True)
ab.draw(flight).savefig(out / "flip.pdf")
ab.write_csv(plan.trajectory, out / "flip.csv", rate=100)
