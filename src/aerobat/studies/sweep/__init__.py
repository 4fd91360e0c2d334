"""Many flights of one plan under random conditions: errors and shares of outcomes."""

from aerobat.studies.share import Share
from aerobat.studies.sweep.result import ErrorBand, Sweep
from aerobat.studies.sweep.sweep import sweep

__all__ = ["ErrorBand", "Share", "Sweep", "sweep"]
