"""Live links to vehicles, each with a clock of its own: what they share, a simulated vehicle, and MAVLink.

The public names stand in `__init__.pyi`; each is imported when first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
