"""The causes of flights' errors, switched on one at a time and all together."""

from aerobat.studies.error_causes.cause import Cause as Cause
from aerobat.studies.error_causes.cause import Trial as Trial
from aerobat.studies.error_causes.cause import four_causes as four_causes
from aerobat.studies.error_causes.result import Cost as Cost
from aerobat.studies.error_causes.result import ErrorCauses as ErrorCauses
from aerobat.studies.error_causes.result import TrialResult as TrialResult
from aerobat.studies.error_causes.result import error_causes as error_causes
