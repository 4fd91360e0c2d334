"""Plans that pass with the probability asked: plan, fly, tighten, and prove it on fresh flights.

The public names stand in `__init__.pyi`; each is imported when first used: showing rounds takes no flights.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
