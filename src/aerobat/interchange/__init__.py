"""Plans, trajectories and vehicles in other systems' formats, and readers for all files that hold a plan.

The public names are in `__init__.pyi`; each is imported at its first use, without the other formats.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
