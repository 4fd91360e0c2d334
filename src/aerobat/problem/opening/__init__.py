"""Openings of gates: convex shapes in a gate's plane, by points (left, up) [m] from the gate's position.

Code that plans, judges or draws an opening uses this interface: depth of points inside, the part left at a
clearance from the edges, directions along which a passing body is measured, outline and edges.
"""

from aerobat.problem.opening.circle import Circle as Circle
from aerobat.problem.opening.polygon import Corners as Corners
from aerobat.problem.opening.polygon import Polygon as Polygon
from aerobat.problem.opening.polygon import Rectangle as Rectangle
from aerobat.problem.opening.shape import Edge as Edge
from aerobat.problem.opening.shape import EdgeProbe as EdgeProbe
from aerobat.problem.opening.shape import LinearBounds as LinearBounds
from aerobat.problem.opening.shape import OpeningShape as OpeningShape
from aerobat.problem.opening.shape import edge_name as edge_name
