"""Many flights of one plan under conditions that vary: how well, and how often."""

from aerobat.studies.share import Share
from aerobat.studies.sweep.result import ErrorBand, Sweep
from aerobat.studies.sweep.sweep import sweep

__all__ = ["ErrorBand", "Share", "Sweep", "sweep"]
