"""Maneuvers, one file each; a new one is a file, a line in `__init__.pyi` and one in `maneuver.MANEUVERS`.

The public names are in `__init__.pyi`; each is imported at its first use, so that no maneuver loads another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
