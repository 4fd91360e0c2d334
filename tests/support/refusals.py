"""The sentence by which a wrong value is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from aerobat.errors import SpecError


def complaint(make: Callable[[], Any]) -> str:
    """What is wrong, if anything; an error of any other kind passes through."""
    try:
        make()
    except SpecError as error:
        return str(error)
    return ""
