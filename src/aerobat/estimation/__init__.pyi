from .replay import Estimates as Estimates
from .replay import FilterInput as FilterInput
from .replay import FilterParameters as FilterParameters
from .replay import estimate as estimate
from .replay import filter_loop as filter_loop
from .sensor_log import SensorLog as SensorLog
from .settings import Ekf as Ekf
from .settings import ekf_parameters as ekf_parameters
