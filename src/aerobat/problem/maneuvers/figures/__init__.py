"""Figures of aerobatics, each of them an element of courses and a maneuver of its own.

The public names stand in `__init__.pyi`; each is imported when first used: no figure waits for another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
