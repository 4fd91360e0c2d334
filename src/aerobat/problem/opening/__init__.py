"""Openings of gates: convex shapes in a gate's plane, by points (left, up) [m] from the gate's position.

Code that plans, judges or draws an opening uses this interface: depth of points inside, the part left at a
clearance from the edges, directions along which a passing body is measured, outline and edges.
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
