"""Where a vehicle flies: gravity, wind and ground, owned by the problem and by nobody else.

And the conditions of a flight there: what varies, disturbs, and is measured how.
"""

from aerobat.environment.dispersion import Battery, Dispersion, Gusts
from aerobat.environment.environment import Environment
from aerobat.environment.files import as_dispersion, dispersion_names, load_dispersion, write_dispersion
from aerobat.environment.sensors import HandOff, Imu, MotionCapture, Outage

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
