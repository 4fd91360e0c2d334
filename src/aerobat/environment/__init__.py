"""The surroundings of a vehicle: gravity, wind, ground and obstacles, which belong to the problem.

The package also holds the conditions of a flight: dispersions, disturbances and sensors.

The public names stand in `__init__.pyi`. Each is imported when first used, so that calm air does not import
sensors.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
