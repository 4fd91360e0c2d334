"""The input of planning: gates, maneuvers as lists of stages, problems. No optimization happens here.

The public names are in `__init__.pyi`; each is imported at its first use, so that no maneuver
loads another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
