"""The causes of flights' errors, switched on one at a time and all together."""

from aerobat.studies.error_causes.cause import Cause, Trial, four_causes
from aerobat.studies.error_causes.result import Cost, ErrorCauses, TrialResult, error_causes

__all__ = ["Cause", "Cost", "ErrorCauses", "Trial", "TrialResult", "error_causes", "four_causes"]
