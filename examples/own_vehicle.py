"""A vehicle of one's own, made in Python, written as a file, read back, planned for and flown.

From then on every command takes the file: aerobat fly flip-roll --vehicle out/racer.toml
"""

import sys
from dataclasses import replace
from pathlib import Path

import aerobat as ab

out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
out.mkdir(parents=True, exist_ok=True)

ARM = 0.088  # [m] along x and along y: a 250 mm frame
front_left = ab.Rotor(
    position_body=(ARM, ARM, 0.0),
    spin=-1,  # clockwise seen from above
    min_thrust=0.15,
    max_thrust=7.2,  # [N] at full throttle
    torque_coefficient=0.014,
    lag=0.025,
    radius=0.0635,
)
racer = ab.Vehicle(
    name="racer",
    mass=0.61,
    inertia=(0.0016, 0.0018, 0.0029),  # [kg·m²] principal moments; or a matrix
    rotors=(
        front_left,
        replace(front_left, position_body=(ARM, -ARM, 0.0), spin=1),
        replace(front_left, position_body=(-ARM, -ARM, 0.0), spin=-1),
        replace(front_left, position_body=(-ARM, ARM, 0.0), spin=1),
    ),
    drag_body=(0.1, 0.1, 0.05),  # [kg/s]
    description="numbers made up for an example",
)
ab.write_vehicle(racer, out / "racer.toml")
assert ab.load_vehicle(out / "racer.toml") == racer  # exactly
print(racer)

plan = ab.plan(ab.load_problem("flip-roll"), vehicle=racer)
print(plan)
print(ab.score(ab.fly(plan), plan, racer))
