"""A flight stepped tick by tick, and branched: what if a rotor gets weak at this very instant?"""

from dataclasses import replace
from typing import Any

import numpy as np

import aerobat as ab

vehicle = ab.load_vehicle("agile-quad")
plan = ab.plan(ab.load_problem("flip-roll"), vehicle=vehicle)
first, *others = vehicle.rotors
weak = replace(vehicle, rotors=(replace(first, max_thrust=0.75 * first.max_thrust), *others))

setup = ab.prepare(plan)  # everything that a flight takes; ab.fly(plan) is one scan over all its ticks
loop = setup.compile()
branch = ab.prepare(plan, weak, nominal=vehicle).compile()  # its controller does not know
ticks = len(setup.times)


def error(row: Any, tick: int) -> float:
    """Return the distance [cm] from the path."""
    position = np.ravel(row.motion.body.position)
    return float(100 * np.linalg.norm(position - plan.trajectory.evaluate(setup.times[tick])))


carry = loop.init(setup.first_tick)
for tick in range(ticks):
    if tick % 200 == 0:
        elsewhere = carry  # a tree of read-only arrays: to be kept, and gone on from as often as one likes
        errors = []
        for later in range(tick, ticks):
            elsewhere, row = branch.step(elsewhere, setup.tick(later))
            errors.append(error(row, later))
        print(
            f"weak from {setup.times[tick]:.2f} s: {max(errors):.1f} cm off at most, {errors[-1]:.1f} at last"
        )
    carry, row = loop.step(carry, setup.tick(tick))
print(f"never weak: {error(row, ticks - 1):.2f} cm off at the end")
assert np.ravel(row.motion.body.position).tolist() == ab.fly(plan).position[-1].tolist()  # the same bits
