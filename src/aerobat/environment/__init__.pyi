from .dispersion import Battery, Dispersion, Gusts
from .environment import Environment
from .files import as_dispersion, dispersion_names, load_dispersion, write_dispersion
from .obstacles import Obstacle, obstacle
from .obstacles.grid import Grid, occupied_boxes
from .obstacles.mesh import Mesh
from .obstacles.mesh_file import mesh_parts
from .obstacles.shapes import Box, Capsule, Cylinder, HalfSpace, Polytope, Sphere
from .sensors import HandOff, Imu, MotionCapture, Outage

__all__ = [
    "Battery",
    "Box",
    "Capsule",
    "Cylinder",
    "Dispersion",
    "Environment",
    "Grid",
    "Gusts",
    "HalfSpace",
    "HandOff",
    "Imu",
    "Mesh",
    "MotionCapture",
    "Obstacle",
    "Outage",
    "Polytope",
    "Sphere",
    "as_dispersion",
    "dispersion_names",
    "load_dispersion",
    "mesh_parts",
    "obstacle",
    "occupied_boxes",
    "write_dispersion",
]
