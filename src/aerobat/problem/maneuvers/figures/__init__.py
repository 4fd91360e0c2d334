"""Figures of aerobatics, each an element of courses and a maneuver of its own.

The public names are in `__init__.pyi`; each is imported at its first use, so that no figure loads another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
