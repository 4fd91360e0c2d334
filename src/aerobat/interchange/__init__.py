"""Plans, trajectories and vehicles in other systems' formats, and whichever file holds a plan.

The public names stand in `__init__.pyi`; each is imported when first used: no format waits for another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
