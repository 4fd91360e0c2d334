"""Robot descriptions, URDF and SDF, read as vehicles."""

from aerobat.interchange.robots.description import VehicleDescription, import_vehicle, read_robot_description

__all__ = ["VehicleDescription", "import_vehicle", "read_robot_description"]
