"""Trajectories in other people's formats, and whichever holds one."""

from aerobat.exporting.csv import read_csv, write_csv
from aerobat.exporting.reading import read_trajectory

__all__ = ["read_csv", "read_trajectory", "write_csv"]
