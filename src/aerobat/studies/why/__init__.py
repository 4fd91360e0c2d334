"""Why a problem has no plan, and tried changes with which it has one."""

from aerobat.studies.why.changes import Request as Request
from aerobat.studies.why.remedies import Remedy as Remedy
from aerobat.studies.why.remedies import Why as Why
from aerobat.studies.why.remedies import explained as explained
from aerobat.studies.why.remedies import why as why
