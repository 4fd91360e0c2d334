"""What can go wrong, each with its evidence and a remedy, in one sentence for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


class AerobatError(Exception):
    """Any failure that Aerobat foresees; its message is one clear sentence."""


class SpecError(AerobatError, ValueError):
    """The input is wrong (a vehicle, a problem, an argument): the message names the field and the remedy."""


class OutOfRange(SpecError, IndexError):
    """There is no entry of that number: the message says how many there are."""


class Infeasible(AerobatError):
    """No plan satisfies the problem: the message says which bound binds and what would free it.

    `attempts` holds every duration that was tried, with its outcome.
    """

    def __init__(self, message: str, attempts: Sequence[Any] = ()) -> None:
        super().__init__(message)
        self.attempts = tuple(attempts)


class BackendMissing(AerobatError):
    """A solver was asked for by name and is not installed: the message gives the install command."""
