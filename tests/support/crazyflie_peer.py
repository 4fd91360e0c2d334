"""An export for the Crazyflie against cflib, which packs the CSV's numbers to the bytes beside them.

    uv run --no-project --with cflib python tests/support/crazyflie_peer.py FOLDER

in an environment of its own: cflib's licence, GPL, keeps it out of ours.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from cflib.crazyflie.mem.trajectory_memory import Poly4D


def packed(table: Path) -> bytes:
    """The bytes that cflib makes of a table in the layout of uav_trajectories."""
    with table.open(newline="") as file:
        rows = [[float(number) for number in row] for row in list(csv.reader(file))[1:]]
    pieces = (
        Poly4D(row[0], *(Poly4D.Poly(row[first : first + 8]) for first in (1, 9, 17, 25))) for row in rows
    )
    return b"".join(bytes(piece.pack()) for piece in pieces)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    written = (folder / "trajectory.bin").read_bytes()
    if packed(folder / "trajectory.csv") != written:
        sys.exit("cflib packs other bytes")
    print(f"{len(written)} bytes equal cflib's")
