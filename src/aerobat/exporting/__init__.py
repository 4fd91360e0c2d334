"""Trajectories in other people's formats."""

from aerobat.exporting.csv import read_csv, write_csv

__all__ = ["read_csv", "write_csv"]
