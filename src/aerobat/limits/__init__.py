"""Limits along a path, each defined once: a quantity, its bounds, and the fields that set them.

A family of limits is one file with one function, registered in `along.FAMILIES` or by `register_limits`. The
mixed-integer search, the refinement, the checks between samples and the certificate all use these limits. The
clearance of the body in a gate holds near one instant, and is defined for all optimizers in `body_in_gate`.
"""

from aerobat.limits.along import limits_along as limits_along
from aerobat.limits.along import register_limits as register_limits
from aerobat.limits.limit import Asked as Asked
from aerobat.limits.limit import Limit as Limit
from aerobat.limits.quantity import MEASURES as MEASURES
from aerobat.limits.quantity import PathQuantity as PathQuantity
