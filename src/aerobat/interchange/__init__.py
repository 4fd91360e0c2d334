"""Plans, trajectories and vehicles in other systems' formats, and whichever file holds a plan."""

from aerobat.interchange.csv import read_csv, write_csv
from aerobat.interchange.read import read_plan, read_trajectory

__all__ = ["read_csv", "read_plan", "read_trajectory", "write_csv"]
