"""Ten thousand vehicles, none quite what the plan takes it to be, fly a flip: how many make it, how well?"""

from collections import Counter

import numpy as np

import aerobat as ab

plan = ab.plan(ab.load_problem("flip-roll"), vehicle=ab.load_vehicle("agile-quad"))

varied = ab.Dispersion(
    mass=0.03, inertia=0.05, lag=0.05
)  # 1σ, relative; the controller knows the nominal one
scores = ab.score_flights(plan, conditions=varied, flights=10_000, seed=0)

for outcome, count in Counter(scores.outcomes).most_common():
    print(f"{count:6d}  {outcome.name.lower().replace('_', ' ')}")
[passage] = scores.passages  # one for each gate, arrays with one entry a flight
for percent in (50, 95, 99, 100):
    error, miss = (np.percentile(values, percent) for values in (scores.max_position_error_m, passage.miss))
    print(f"{percent:4d} %  at most {100 * error:5.2f} cm off the path, {100 * miss:5.2f} cm off in the gate")
worst = int(np.argmax(scores.max_position_error_m))
print(f"the worst, flight {worst}: {scores[worst]}")
