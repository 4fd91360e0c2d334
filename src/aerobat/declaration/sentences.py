"""Complaints about a value, each as one sentence about its field."""

from __future__ import annotations

import dataclasses
import reprlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydantic import ValidationError

from aerobat.errors import SpecError

_LONGEST = 60  # letters of a name that is looked for among others


class FieldError(SpecError):
    """A value that does not fit its declaration.

    Args:
        field: its place within what is checked, such as "rotors[2].spin"; empty for the whole of it.
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
        """The same error seen from outside, where this value stands at `place`."""
        dot = "" if not place or not self.field or self.field.startswith("[") else "."
        return type(self)(place + dot + self.field, self.complaint)


class UnknownKey(FieldError):
    """A key that no field has; told before other errors, since it is often why another key is missing."""


def unknown_key(key: str, known: Iterable[str]) -> UnknownKey:
    """The error that says no field has this key, and which known one is closest."""
    known = tuple(known)
    guess = closest(key[:_LONGEST], known)
    remedy = f"did you mean {guess!r}?" if guess else f"known keys are {', '.join(known)}"
    return UnknownKey(_key(key), f"is not a known key; {remedy}")


def _key(key: str) -> str:
    """A key as an error names it: as it is, unless that is no line, or a long one."""
    return key if key.isprintable() and len(key) <= _LONGEST else shown(key)


def unknown_name(kind: str, name: str, known: Iterable[str]) -> SpecError:
    """The error that says no `kind` has this name, which known name is closest, and which there are."""
    known = tuple(known)
    if not known:
        return SpecError(f"no {kind} named {shown(name)}: there is none at all")
    guess = closest(name[:_LONGEST], known)
    hint = f"did you mean {guess!r}? Known: " if guess else "known: "
    return SpecError(f"no {kind} named {shown(name)}; {hint}{', '.join(known)}")


def closest(name: str, known: Iterable[str]) -> str | None:
    """The known name that is most like `name`, if any is like it."""
    import difflib  # only once something is wrong

    return next(iter(difflib.get_close_matches(name.lower(), known, n=1)), None)


@contextmanager
def within_field(place: str) -> Iterator[None]:
    """Say of any SpecError raised inside that it is about the value at `place`."""
    try:
        yield
    except SpecError as error:
        raise as_field_error(error).inside(place) from None


def as_field_error(error: SpecError) -> FieldError:
    """The error with a field; a sentence about the whole value follows its place after a colon."""
    return error if isinstance(error, FieldError) else FieldError("", f": {error}")


# Complaints by pydantic's types of error; {} is filled from the error's context.
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
_COMPLETE = {"missing", "too_short", "too_long"}  # their sentence needs no "got ..."


def first_complaint(error: ValidationError) -> FieldError:
    """The first of pydantic's errors as one about its field; an unknown key comes before others.

    Where the first is a missing field, all are named that are missing.
    """
    found = [_complaint(detail) for detail in error.errors(include_url=False)]
    unknown = next((each for each in found if isinstance(each, UnknownKey)), None)
    if unknown is None and found[0].complaint == _COMPLAINTS["missing"]:
        return missing_fields([each.field for each in found if each.complaint == _COMPLAINTS["missing"]])
    return unknown or found[0]


def missing_fields(names: Sequence[str], where: str = "") -> FieldError:
    """The error that says which fields are missing, and where to add them."""
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
    """The noun with its indefinite article."""
    return f"{'an' if noun[0] in 'AEIOaeio' else 'a'} {noun}"


def one_of(names: Sequence[str]) -> str:
    """Alternatives in words: "a, b or c"."""
    return " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def shown(value: Any) -> str:
    """The value as an error shows it, short."""
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
