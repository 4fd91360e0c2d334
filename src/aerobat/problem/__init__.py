"""The input of planning: gates, maneuvers as lists of stages, problems. No optimization happens here.

The public names stand in `__init__.pyi`; each is imported when first used: no maneuver waits
for others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
