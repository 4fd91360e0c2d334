"""Many flights of one plan under random conditions: errors and shares of outcomes."""

from aerobat.studies.share import Share
from aerobat.studies.sweep.result import Sweep
from aerobat.studies.sweep.sweep import sweep

__all__ = ["Share", "Sweep", "sweep"]
