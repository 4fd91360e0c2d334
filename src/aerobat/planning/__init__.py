"""From a problem to a plan: the planners, the search on durations, and the rotors' margin.

The public names are in `__init__.pyi`. Each is imported when first used, so that no planner imports another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
