"""Limits along a path, each said once: a quantity, the interval that it must stay in, and who asks for it.

A family of limits is one file with one function, registered in `along.FAMILIES` or by `register_limits`: the
mixed-integer search, the refinements, the look between samples and the certificate hold its limits. The room
of the body in a gate holds at one instant, and is said once for all optimizers in `body_in_gate`.
"""

from aerobat.limits.along import limits_along, register_limits
from aerobat.limits.limit import Asked, Limit
from aerobat.limits.quantity import MEASURES, PathQuantity

__all__ = ["MEASURES", "Asked", "Limit", "PathQuantity", "limits_along", "register_limits"]
