"""The position error of a recorded flight, split into its causes."""

from aerobat.studies.inspection.inspect_flight import inspect_flight as inspect_flight
from aerobat.studies.inspection.result import CAUSES as CAUSES
from aerobat.studies.inspection.result import ErrorShare as ErrorShare
from aerobat.studies.inspection.result import Inspection as Inspection
