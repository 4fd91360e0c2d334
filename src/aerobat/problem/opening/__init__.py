"""Openings of gates: convex shapes in a gate's plane, by points (left, up) [m] from the gate's position.

All that plans, judges or draws an opening reads it here: which points lie inside and how deep, what is left
at a clearance from the edges, along which directions a body that passes is measured, the outline, the edges.
"""

from aerobat.problem.opening.circle import Circle
from aerobat.problem.opening.polygon import Corners, Polygon, Rectangle
from aerobat.problem.opening.shape import Edge, EdgeProbe, LinearBounds, OpeningShape, edge_name

__all__ = [
    "Circle",
    "Corners",
    "Edge",
    "EdgeProbe",
    "LinearBounds",
    "OpeningShape",
    "Polygon",
    "Rectangle",
    "edge_name",
]
