"""A certificate for a path that another program made: rows of position, velocity, acceleration and jerk.

Such a file holds a path and no more. The rest is for the caller to say: heading, vehicle, gravity and wind,
limits. On the command line: aerobat check out/circle.csv --vehicle crazyflie --max-speed 4
"""

import sys
from dataclasses import replace
from math import pi, radians
from pathlib import Path

import numpy as np

import aerobat as ab

file = Path(sys.argv[1] if len(sys.argv) > 1 else "out") / "circle.csv"
file.parent.mkdir(parents=True, exist_ok=True)

# the other program: a circle of 0.5 m radius at 1 m height, 100 rows a second
turn = 2 * pi / 1.05  # [rad/s]
angle = turn * np.arange(106) / 100
circle = [
    0.5 * turn**k * np.array([np.cos(angle + k * pi / 2), np.sin(angle + k * pi / 2)]) for k in range(4)
]
rows = np.vstack([(*xy, np.full(106, float(k == 0))) for k, xy in enumerate(circle)])
np.savetxt(file, rows.T, delimiter=",")

path = ab.read_csv(file, rate=100.0)  # between rows: the polynomial of degree 7 that meets both
path = replace(path, heading=radians(45.0))  # left out, 0
envelope = ab.Envelope(speed=4.0)
for name in ("agile-quad", "crazyflie"):
    for wind in (0.0, 3.0):
        environment = ab.Environment(wind=(wind, 0.0, 0.0))  # left out, calm air; 9.81 m/s²
        certificate = ab.certify(path, ab.load_vehicle(name), environment, envelope)
        print(f"{name}, wind {wind:.0f} m/s: {certificate}")
print("\nthe last in full:", *certificate.findings, sep="\n")
