"""Trajectories in other people's formats, and whichever holds one."""

from aerobat.interchange.csv import read_csv, write_csv
from aerobat.interchange.read import read_trajectory

__all__ = ["read_csv", "read_trajectory", "write_csv"]
