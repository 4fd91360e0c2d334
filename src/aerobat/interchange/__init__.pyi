from .blackbox import Blackbox, read_blackbox
from .columns import column_groups, write_columns
from .csv import read_csv, read_rows, write_csv
from .flight_log import read_flight_log
from .read import read_plan, read_trajectory
from .tables import read_table, write_table

__all__ = [
    "Blackbox",
    "column_groups",
    "read_blackbox",
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
