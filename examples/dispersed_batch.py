"""Ten thousand vehicles, none quite what the plan takes it to be, fly a flip: how many make it, how well?"""

from collections import Counter
from dataclasses import replace

import numpy as np

import aerobat as ab

nominal = ab.load_vehicle("agile-quad")
plan = ab.plan(ab.load_problem("flip-roll"), vehicle=nominal)

rng = np.random.default_rng(0)
factors = rng.normal(1.0, [0.03, 0.05, 0.05], size=(10_000, 3))  # of mass, inertia and motor lag
vehicles = [
    replace(
        nominal,
        mass=mass * nominal.mass,
        inertia=inertia * nominal.inertia,
        rotors=tuple(replace(rotor, lag=lag * rotor.lag) for rotor in nominal.rotors),
    )
    for mass, inertia, lag in factors.tolist()
]
scores = ab.score_flights(plan, vehicles, nominal=nominal)  # the controller knows the nominal vehicle only

for outcome, count in Counter(scores.outcomes).most_common():
    print(f"{count:6d}  {outcome.name.lower().replace('_', ' ')}")
[passage] = scores.passages  # one for each gate, arrays with one entry a flight
for percent in (50, 95, 99, 100):
    error, miss = (np.percentile(values, percent) for values in (scores.max_position_error_m, passage.miss))
    print(f"{percent:4d} %  at most {100 * error:5.2f} cm off the path, {100 * miss:5.2f} cm off in the gate")
worst = int(np.argmax(scores.max_position_error_m))
print(f"the worst, {factors[worst, 0] - 1:+.1%} in mass: {scores[worst]}")
