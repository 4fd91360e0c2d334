"""Many flights of one plan under random conditions: errors and shares of outcomes."""

from aerobat.studies.share import Share as Share
from aerobat.studies.sweep.result import Sweep as Sweep
from aerobat.studies.sweep.sweep import sweep as sweep
