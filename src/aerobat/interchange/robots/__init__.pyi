from .description import VehicleDescription as VehicleDescription
from .description import import_vehicle as import_vehicle
from .description import read_robot_description as read_robot_description
from .markup import SUFFIXES as SUFFIXES
