"""Why a problem has no plan, and tried changes with which it has one."""

from aerobat.studies.why.changes import Request
from aerobat.studies.why.remedies import Remedy, Why, explained, why

__all__ = ["Remedy", "Request", "Why", "explained", "why"]
