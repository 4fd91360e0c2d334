from .replay import Estimates, FilterInput, FilterParameters, estimate, filter_loop
from .sensor_log import SensorLog
from .settings import Ekf, ekf_parameters

__all__ = [
    "Ekf",
    "Estimates",
    "FilterInput",
    "FilterParameters",
    "SensorLog",
    "ekf_parameters",
    "estimate",
    "filter_loop",
]
