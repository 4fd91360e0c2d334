from .description import VehicleDescription, import_vehicle, read_robot_description
from .markup import SUFFIXES

__all__ = ["SUFFIXES", "VehicleDescription", "import_vehicle", "read_robot_description"]
