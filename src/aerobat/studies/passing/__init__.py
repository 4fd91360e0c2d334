"""Plans whose flights pass with a required probability: plan, fly, tighten, and prove on fresh flights.

The public names are in `__init__.pyi`; each is imported at its first use, so that showing rounds does not
import flights.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
