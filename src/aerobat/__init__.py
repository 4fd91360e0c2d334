"""Aerobat plans, flies and proves aggressive maneuvers for multirotors.

Problem → plan() → Plan.trajectory → fly() → Flight → score() → draw(), write_csv(): every arrow is a frozen
value that can be saved, replayed and tested alone. The public names stand in `__init__.pyi`; each is imported
when it is first used, so that a command waits for nothing that it does not need.
"""

from typing import Any

import lazy_loader

_imported, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    """Import a public name. Raises AttributeError with the closest one for a name that there is not."""
    try:
        return _imported(name)
    except AttributeError:
        if name.startswith("_") or name in __all__:  # the latter failed as its module was imported
            raise
        from difflib import get_close_matches  # only once something is wrong

        guess = get_close_matches(name, __all__, n=1)
        hint = f"; did you mean {guess[0]!r}?" if guess else ""
        raise AttributeError(f"aerobat has no {name!r}{hint}", name=name) from None
