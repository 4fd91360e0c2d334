"""A maneuver of one's own as data: a list of stages, some at a given time, some where the solver likes.

A dive: fall with the thrust horizontal somewhere on the way, then pull out through a gate at speed.
"""

import aerobat as ab

vehicle = ab.load_vehicle("agile-quad")
knife_edge = ab.Stage(
    "knife edge",
    (
        ab.Condition("specific_thrust", (0, 0, 1), lower=0.0, upper=0.0),
        ab.Condition("specific_thrust", (1, 0, 0), lower=0.3 * vehicle.max_specific_thrust),
    ),
)
pull_out = ab.Stage("pull out", (ab.Condition("velocity", (1, 0, 0), lower=6.0),), at=0.6, gate="exit")
dive = ab.Problem(
    name="dive",
    start=ab.at_rest((0, 0, 8)),
    goal=ab.at_rest((12, 0, 3)),
    maneuver=ab.CustomManeuver((knife_edge, pull_out)),
    gates=(ab.tilted_gate((7.0, 0.0, 3.0), name="exit"),),
    limits=ab.Limits(lower=(-5, -1, 0.5), upper=(20, 1, 10), velocity=12.0),
)

plan = ab.plan(dive, vehicle=vehicle)
print(plan)
print(ab.score(ab.fly(plan), plan, vehicle))
