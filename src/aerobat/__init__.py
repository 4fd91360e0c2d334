"""Aerobat plans, flies and proves aggressive maneuvers for multirotors.

Problem → plan() → Plan.trajectory → fly() → Flight → score() → draw(), write_csv(): every arrow is a frozen
value that can be saved, replayed and tested alone. The public names stand in `__init__.pyi`; each is imported
when it is first used, so that a command waits for nothing that it does not need.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
