"""The same flip on Earth, in wind and on the Moon: gravity and wind belong to the problem's environment."""

from dataclasses import replace

import aerobat as ab

vehicle = replace(ab.load_vehicle("agile-quad"), drag_body=(0.2, 0.2, 0.1))  # [kg/s]
problem = ab.load_problem("flip-roll")
places = {
    "a calm day": ab.Environment(),
    "a wind of 5 m/s from the right": ab.Environment(wind=(0.0, 5.0, 0.0)),
    "the Moon": ab.Environment(gravity=1.62),
}
for place, environment in places.items():
    plan = ab.plan(
        replace(problem, environment=environment), vehicle=vehicle
    )  # planned, proven and flown there
    print(f"{place}: {plan.duration:.3f} s, rotors {plan.margin}; {ab.score(ab.fly(plan), plan)}")

calm = ab.plan(problem, vehicle=vehicle)
gust = places["a wind of 5 m/s from the right"]
print(f"\nplanned for calm air, in that wind: {ab.certify(calm.trajectory, vehicle, gust)}")
print(f"flown all the same: {ab.score(ab.fly(calm, environment=gust), calm)}")
