"""Error messages about values, each one sentence about a field."""

from __future__ import annotations

import dataclasses
import reprlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydantic import ValidationError

from aerobat.errors import SpecError

_LONGEST = 60  # letters of an unknown name that are compared with known names


class FieldError(SpecError):
    """A value that does not fit its declaration.

    Args:
        field: its place within the checked value, such as "rotors[2].spin"; empty for the whole value.
        complaint: what follows the field in the sentence, such as "must be positive, got -1".
    """

    def __init__(self, field: str, complaint: str) -> None:
        separator = "" if complaint.startswith((":", ",")) or not field else " "
        super().__init__((field + separator + complaint).removeprefix(": "))
        self.field = field
        self.complaint = complaint

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.field, self.complaint)

    def inside(self, place: str) -> FieldError:
        """Return the error with the field's place seen from outside, where this value is at `place`."""
        dot = "" if not place or not self.field or self.field.startswith("[") else "."
        return type(self)(place + dot + self.field, self.complaint)


class UnknownKey(FieldError):
    """An unknown key, reported before other errors, since it often explains why another key is missing."""


def unknown_key(key: str, known: Iterable[str]) -> UnknownKey:
    """Return the error about an unknown key, with the closest known key."""
    known = tuple(known)
    guess = closest(key[:_LONGEST], known)
    remedy = f"did you mean {guess!r}?" if guess else f"known keys are {', '.join(known)}"
    return UnknownKey(_key(key), f"is not a known key; {remedy}")


def _key(key: str) -> str:
    """Return a key as errors show it: quoted and shortened if it is long or not printable."""
    return key if key.isprintable() and len(key) <= _LONGEST else shown(key)


def unknown_name(kind: str, name: str, known: Iterable[str]) -> SpecError:
    """Return the error about an unknown name of a `kind`, with the closest and all known names."""
    known = tuple(known)
    if not known:
        return SpecError(f"no {kind} named {shown(name)}: there is none at all")
    guess = closest(name[:_LONGEST], known)
    hint = f"did you mean {guess!r}? Known: " if guess else "known: "
    return SpecError(f"no {kind} named {shown(name)}; {hint}{', '.join(known)}")


def closest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name closest to `name`, if any is similar."""
    import difflib  # slow import, needed for errors only

    return next(iter(difflib.get_close_matches(name.lower(), known, n=1)), None)


@contextmanager
def within_field(place: str) -> Iterator[None]:
    """Convert any SpecError raised inside into one about the value at `place`."""
    try:
        yield
    except SpecError as error:
        raise as_field_error(error).inside(place) from None


def as_field_error(error: SpecError) -> FieldError:
    """Return the error as a FieldError; a sentence about the whole value follows its place after a colon."""
    return error if isinstance(error, FieldError) else FieldError("", f": {error}")


# Messages by pydantic's types of errors; {} is filled from the error's context.
_COMPLAINTS = {
    "missing": "is missing; add it",
    "float_type": "must be a number",
    "finite_number": "must be a finite number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_too_short": "must not be empty",
    "tuple_type": "must be a list",
    "dict_type": "must be a table",
    "literal_error": "must be {expected}",
    "enum": "must be {expected}",
    "is_instance_of": "must be of the type {class}",
    "too_short": "must have {min_length} or more entries, got {actual_length}",
    "too_long": "must have {max_length} or fewer entries, got {actual_length}",
    "greater_than": "must be greater than {gt:g}",
    "greater_than_equal": "must be {ge:g} or more",
    "less_than": "must be less than {lt:g}",
    "less_than_equal": "must be {le:g} or less",
}
_COMPLETE = {"missing", "too_short", "too_long"}  # messages without "got ..."


def first_complaint(error: ValidationError) -> FieldError:
    """Return the first of pydantic's errors as a FieldError; an unknown key comes before others.

    If the first is a missing field, the message names all missing fields.
    """
    found = [_complaint(detail) for detail in error.errors(include_url=False)]
    unknown = next((each for each in found if isinstance(each, UnknownKey)), None)
    if unknown is None and found[0].complaint == _COMPLAINTS["missing"]:
        return missing_fields([each.field for each in found if each.complaint == _COMPLAINTS["missing"]])
    return unknown or found[0]


def missing_fields(names: Sequence[str], where: str = "") -> FieldError:
    """Return the error that names the missing fields, and where to add them."""
    if len(names) == 1:
        return FieldError(names[0], f"is missing; add it{where}")
    others = "".join(f", {name}" for name in names[1:-1]) + f" and {names[-1]}"
    complaint = f"{others} are missing; add them{where}"
    return FieldError(names[0], complaint if complaint.startswith(",") else complaint[1:])


def _complaint(detail: Any) -> FieldError:
    place = _dotted(detail["loc"])
    kind = detail["type"]
    context = detail.get("ctx", {})
    if kind == "value_error":  # raised by a declaration
        raised = context["error"]
        return as_field_error(raised if isinstance(raised, SpecError) else SpecError(raised)).inside(place)
    complaint = (
        _COMPLAINTS[kind].format_map(context) if kind in _COMPLAINTS else f"is wrong ({detail['msg']})"
    )
    if context.get("gt") == 0:
        complaint = "must be positive"
    return FieldError(place, complaint + ("" if kind in _COMPLETE else f", got {shown(detail['input'])}"))


def _dotted(location: Sequence[str | int]) -> str:
    name = ""
    for part in location:
        name += f"[{part}]" if isinstance(part, int) else f".{_key(part)}" if name else _key(part)
    return name


def with_article(noun: str) -> str:
    """Return the noun with its indefinite article."""
    return f"{'an' if noun[0] in 'AEIOaeio' else 'a'} {noun}"


def one_of(names: Sequence[str]) -> str:
    """Return alternatives as text: "a, b or c"."""
    return " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def shown(value: Any) -> str:
    """Return the value as short text for errors."""
    if dataclasses.is_dataclass(value):
        return (
            f"the class {value.__name__}" if isinstance(value, type) else with_article(type(value).__name__)
        )
    if hasattr(value, "__array__") and np.ndim(value):
        return f"an array of the shape {np.shape(value)}"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    try:
        text = reprlib.repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a huge number"
    return " ".join(text.split())
