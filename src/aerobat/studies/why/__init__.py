"""Why a problem has no plan, and the changes with which it is planned, each of them tried."""

from aerobat.studies.why.changes import Request
from aerobat.studies.why.remedies import Remedy, Why, explained, why

__all__ = ["Remedy", "Request", "Why", "explained", "why"]
