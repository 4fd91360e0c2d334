"""Plan a flip for a vehicle, fly it, score it, draw it: the whole data flow in a page."""

import sys
from pathlib import Path

import aerobat as ab

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)

vehicle = ab.load_vehicle("agile-quad")  # a preset's name, or a TOML file
problem = ab.load_problem("flip-roll")  # the paper's maneuver, or a TOML file
plan = ab.plan(problem, ab.Miqp(), vehicle)  # within its rotors' limits, proven
print(plan)
plan.save(out / "flip.plan")  # everything; ab.load_plan and `aerobat fly flip.plan` read it back

flight = ab.fly(plan, seed=0)  # its vehicle, its environment, its heading
print(ab.score(flight, plan, vehicle))  # with the vehicle, its clearance in the gate too

ab.draw(flight, plan).savefig(out / "flip.pdf")
ab.write_csv(plan.trajectory, out / "flip.csv", rate=100)
