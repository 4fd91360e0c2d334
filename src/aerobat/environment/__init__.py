"""The surroundings of a vehicle: gravity, wind and ground, owned by the problem and by nobody else.

The package also holds the conditions of a flight there: what varies, disturbs, and is measured how.

The public names stand in `__init__.pyi`; each is imported when first used: calm air waits for no sensor.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
