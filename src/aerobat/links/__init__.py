"""Live links to vehicles, each with its own clock: shared parts, a simulated vehicle, and MAVLink.

The public names are in `__init__.pyi`; each is imported at its first use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
