"""What can go wrong, each with its evidence and a remedy, in one sentence for people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any


class AerobatError(Exception):
    """Any failure that Aerobat foresees; its message is one clear sentence."""


class SpecError(AerobatError, ValueError):
    """The input is wrong (a vehicle, a problem, an argument): the message names the field and the remedy."""


class OutOfRange(SpecError, IndexError):
    """There is no entry of that number: the message says how many there are."""


class Infeasible(AerobatError):
    """No plan was found: the message says which bound binds, and what to do next.

    `attempts` holds every duration that was tried, with its outcome; it is empty where the problem was
    refused at once. `sentence` is the message without its remedy.

    Args:
        sentence: Which bound binds; or what finds that out, in up to a second, once it is asked for.
        attempts: The evidence.
        remedy: What to do next, said only where something was attempted; empty where the sentence says it.
    """

    def __init__(
        self,
        sentence: str | Callable[[], str],
        attempts: Sequence[Any] = (),
        remedy: str = "ab.why(problem, vehicle=...) tries changes that would help",
    ) -> None:
        super().__init__(sentence)
        self._sentence = sentence
        self.attempts = tuple(attempts)
        self.remedy = remedy if attempts else ""

    @property
    def sentence(self) -> str:
        """Which bound binds, in a sentence without its full stop."""
        if callable(self._sentence):
            self._sentence = self._sentence()
        return self._sentence

    def with_remedy(self, remedy: str) -> str:
        """The sentence with another remedy, where there is one at all."""
        return f"{self.sentence}; {remedy}" if self.remedy else self.sentence

    def __str__(self) -> str:
        """The sentence with its remedy."""
        return self.with_remedy(self.remedy)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled with its sentence found out."""
        return type(self), (self.sentence, self.attempts, self.remedy)


class BackendMissing(AerobatError):
    """A solver was asked for by name and is not installed: the message gives the install command."""
