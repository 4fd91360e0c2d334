"""Problem → plan: the planners, the search on durations, and the rotors' margin.

The public names stand in `__init__.pyi`; each is imported when first used: no planner waits for another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
