"""Plans, trajectories and vehicles in other systems' formats, and whichever file holds a plan."""

from aerobat.interchange.columns import column_groups, write_columns
from aerobat.interchange.csv import read_csv, read_rows, write_csv
from aerobat.interchange.flight_log import read_flight_log
from aerobat.interchange.read import read_plan, read_trajectory
from aerobat.interchange.tables import read_table, write_table

__all__ = [
    "column_groups",
    "read_csv",
    "read_flight_log",
    "read_plan",
    "read_rows",
    "read_table",
    "read_trajectory",
    "write_columns",
    "write_csv",
    "write_table",
]
