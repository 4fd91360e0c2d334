from .filter_loop import FilterInput, FilterParameters, filter_loop
from .replay import Estimates, estimate
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
