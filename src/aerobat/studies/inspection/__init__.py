"""The position error of a recorded flight, split into its causes."""

from aerobat.studies.inspection.inspect_flight import inspect_flight
from aerobat.studies.inspection.result import CAUSES, ErrorShare, Inspection

__all__ = ["CAUSES", "ErrorShare", "Inspection", "inspect_flight"]
