from .dispersion import Battery, Dispersion, Gusts
from .environment import Environment
from .files import as_dispersion, dispersion_names, load_dispersion, write_dispersion
from .sensors import HandOff, Imu, MotionCapture, Outage

__all__ = [
    "Battery",
    "Dispersion",
    "Environment",
    "Gusts",
    "HandOff",
    "Imu",
    "MotionCapture",
    "Outage",
    "as_dispersion",
    "dispersion_names",
    "load_dispersion",
    "write_dispersion",
]
