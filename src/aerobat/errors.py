"""Failures that Aerobat foresees, each with its evidence and a remedy, in one sentence for people."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib import import_module
from typing import Any


class Reason(str):
    """A sentence about something that was not met, with the limits that it is about.

    Args:
        sentence: For people.
        limits: The fields of the vehicle or the problem that say what was not met, or its stage or gate.
    """

    limits: tuple[str, ...]

    def __new__(cls, sentence: str, limits: Iterable[str] = ()) -> Reason:
        """Make one."""
        made = super().__new__(cls, sentence)
        made.limits = tuple(dict.fromkeys(filter(None, limits)))
        return made


def chain_of(error: BaseException) -> Iterator[BaseException]:
    """Yield an error and those in whose handling it was raised, the latest first."""
    following: BaseException | None = error
    while following is not None:
        yield following
        following = following.__context__


def limits_of(sentence: object) -> tuple[str, ...]:
    """Return the limits that a sentence is about; none where it does not say."""
    return sentence.limits if isinstance(sentence, Reason) else ()


class AerobatError(Exception):
    """Any failure that Aerobat foresees; its message is one clear sentence."""

    @property
    def limits(self) -> tuple[str, ...]:
        """The limits that the message is about, by their fields; none where it does not say."""
        return limits_of(self.args[0] if self.args else "")


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
        """The sentence that says which bound binds, without its full stop."""
        if callable(self._sentence):
            self._sentence = self._sentence()
        return self._sentence

    @property
    def limits(self) -> tuple[str, ...]:
        """The limits that bind, by their fields; none where that is not known."""
        return limits_of(self.sentence)

    def with_remedy(self, remedy: str) -> str:
        """The sentence with another remedy, where there is one at all."""
        return f"{self.sentence}; {remedy}" if self.remedy else self.sentence

    def __str__(self) -> str:
        """The sentence with its remedy."""
        return self.with_remedy(self.remedy)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled with its sentence found out."""
        return type(self), (self.sentence, self.attempts, self.remedy)


class OwnCodeError(Exception):
    """Code of one's own failed, with the error that is this one's cause.

    Checks take a ValueError or an AssertionError for a complaint about a field; this error passes them.
    """


class BackendMissing(AerobatError):
    """A solver was asked for by name and is not installed: the message gives the install command."""


def import_extra(module: str, needs: str, requirement: str, otherwise: str = "") -> Any:
    """Return a module that comes with an extra. Raises BackendMissing, with its command, where it is missing.

    Args:
        module: The module's name, as "pyarrow.parquet".
        needs: Who needs what, as "Parquet files need pyarrow".
        requirement: What pip installs, as "aerobat[parquet]".
        otherwise: What else is to be done, as "write CSV".
    """
    try:
        return import_module(module)
    except ImportError:
        remedy = f'install it with pip install "{requirement}"' + (f", or {otherwise}" if otherwise else "")
        raise BackendMissing(f"{needs}; {remedy}") from None
