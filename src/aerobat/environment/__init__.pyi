from .dispersion import Battery, Dispersion, Gusts
from .environment import Environment
from .files import as_dispersion, dispersion_names, load_dispersion, write_dispersion
from .obstacles import Obstacle, obstacle
from .obstacles.shapes import Box, Capsule, Cylinder, HalfSpace, Polytope, Sphere
from .sensors import HandOff, Imu, MotionCapture, Outage

__all__ = [
    "Battery",
    "Box",
    "Capsule",
    "Cylinder",
    "Dispersion",
    "Environment",
    "Gusts",
    "HalfSpace",
    "HandOff",
    "Imu",
    "MotionCapture",
    "Obstacle",
    "Outage",
    "Polytope",
    "Sphere",
    "as_dispersion",
    "dispersion_names",
    "load_dispersion",
    "obstacle",
    "write_dispersion",
]
