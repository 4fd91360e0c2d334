"""The decorator of public functions: arguments are checked by their annotations before the function runs.

A number must be finite and neither text nor bool; an array must hold numbers; a class takes its instances; a
path must be a possible one. Where the name of a declared value is taken, the path of its file is, too. Wrong
arguments raise SpecError, one sentence that names the argument and, if the value fits another argument, that
one. Annotations are read at the first call, so that imports stay fast.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache, wraps
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike
from pydantic import TypeAdapter, ValidationError

from aerobat.arrays import numbers
from aerobat.declaration.field_types import CONFIG, plain
from aerobat.declaration.sentences import FieldError, closest, first_complaint, one_of, shown, with_article
from aerobat.errors import SpecError

F = TypeVar("F", bound=Callable[..., Any])
Suggest = Callable[[str], str]  # from the name of an unknown argument to a suggestion; "" where there is none
Check = Callable[[Any], Any]  # returns the checked value; raises FieldError

_NUMBERS = (bool, int, float, complex)  # types that Python converts into one another
_ARRAYS = frozenset(get_args(ArrayLike))


def validated(function: F) -> F:
    """Make a function or a class raise SpecError for arguments that do not fit its annotations.

    The function and its type stay otherwise unchanged.
    """
    if isinstance(function, type):
        made: Any = function
        made.__init__ = _checked(made.__init__, made.__name__, made)
        return function
    name = function.__qualname__.rpartition("<locals>.")[2]
    return cast(F, _checked(function, name, function))


_SUGGESTIONS: dict[Any, Suggest] = {}


def suggest_for(function: Callable[..., Any], suggest: Suggest) -> None:
    """Add suggestions to a validated function's error about unknown arguments.

    Args:
        function: The validated function.
        suggest: Returns the suggestion for an argument's name; empty where there is none.
    """
    _SUGGESTIONS[inspect.unwrap(function)] = suggest


def _checked(function: Callable[..., Any], name: str, annotated: Any) -> Callable[..., Any]:
    arguments = cache(lambda: _Arguments(function, name, annotated))

    @wraps(function)
    def checked(*args: Any, **kwargs: Any) -> Any:
        fitting = arguments().fitting(args, kwargs)
        return function(*fitting.args, **fitting.kwargs)

    return checked


class _Arguments:
    """The arguments of one function, with the check of each."""

    def __init__(self, function: Callable[..., Any], name: str, annotated: Any) -> None:
        self._name = name
        self._function = function
        self._signature = inspect.signature(function)
        parameters = self._signature.parameters.values()
        self._names = [p.name for p in parameters if p.name != "self"]
        named = {p.name for p in parameters if p.kind is not p.VAR_KEYWORD}
        hints = _hints(annotated, named)
        self._classes = {name: _classes(hint) for name, hint in hints.items()}
        self._checks = {name: check_of(hint) for name, hint in hints.items()}

    def fitting(self, args: Sequence[Any], kwargs: Mapping[str, Any]) -> inspect.BoundArguments:
        """Return the checked arguments. Raises SpecError."""
        try:
            bound = self._signature.bind(*args, **kwargs)
        except TypeError as error:
            raise SpecError(f"{self._name}: {error}; {self._takes(kwargs)}") from None
        for name, check in self._checks.items():
            if name not in bound.arguments:
                continue
            value = bound.arguments[name]
            if isinstance(value, self._classes[name]):
                continue
            try:
                bound.arguments[name] = check(value)
            except FieldError as error:
                hint = self._meant(value, name)
                raise SpecError(f"{self._name}: {error.inside(name)}{hint}") from None
        return bound

    def _takes(self, kwargs: Mapping[str, Any]) -> str:
        """Return a suggestion for an unknown argument, or else the names of all arguments."""
        strange = next((name for name in kwargs if name not in self._names), "")
        suggest = _SUGGESTIONS.get(self._function)
        suggestion = suggest(strange) if strange and suggest else ""
        guess = closest(strange, self._names)
        if not suggestion and guess:
            suggestion = f"did you mean {guess}?"
        return suggestion or f"it takes {', '.join(self._names) or 'nothing'}"

    def _meant(self, value: Any, wrong: str) -> str:
        """Return the argument that the value fits; for the name of a plan, how to make the plan."""
        if isinstance(value, str) and wrong == "plan":
            return f"; plan it first, as ab.plan({shown(value)})"
        if isinstance(value, str | NoneType):
            return ""
        others = (name for name, classes in self._classes.items() if name != wrong)
        fits = next((name for name in others if isinstance(value, self._classes[name])), None)
        return "" if fits is None else f"; did you mean {fits}=...?"


def _hints(annotated: Any, names: set[str]) -> dict[str, Any]:
    """Return the annotations of the arguments; the result's may be known to type checkers only."""
    if isinstance(annotated, type):
        return {
            name: hint
            for name, hint in get_type_hints(annotated, include_extras=True).items()
            if name in names
        }
    own = {name: hint for name, hint in annotated.__annotations__.items() if name in names}
    holder: Any = type(annotated.__name__, (), {"__annotations__": own})
    try:
        return get_type_hints(holder, annotated.__globals__, include_extras=True)
    except NameError:  # a user's annotations with names that only type checkers know
        return {}


def _alternatives(hint: Any) -> Iterator[Any]:
    """Yield the members of a union; the members of ArrayLike are combined into ArrayLike."""
    members = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    if _ARRAYS and set(members) >= _ARRAYS:
        yield ArrayLike
        members = tuple(member for member in members if member not in _ARRAYS)
    yield from members


def _classes(hint: Any) -> tuple[type, ...]:
    """Return the classes whose instances an argument accepts without a check."""
    found = (each for each in _alternatives(hint) if isinstance(each, type))
    return tuple(each for each in found if each is not Any and each not in _NUMBERS)


def check_of(hint: Any) -> Check:
    """Return the check of values by an annotation."""
    alternatives = list(_alternatives(hint))
    checks = [_check_of_one(each) for each in alternatives]
    has_file = str in alternatives and any(
        isinstance(each, type) and is_dataclass(each) for each in alternatives
    )

    def check(value: Any) -> Any:
        complaints = []
        if has_file and isinstance(value, os.PathLike):
            value = os.fspath(value)
        for one in checks:
            try:
                return one(value)
            except FieldError as error:
                complaints.append(error)
        told = [c for c, each in zip(complaints, alternatives, strict=True) if each is not NoneType]
        inner = [each for each in told if each.field]
        if len(told) == 1 or inner:
            raise (inner or told)[0]
        names = one_of([_described(each) for each in alternatives if each is not NoneType])
        raise FieldError("", f"must be {names}, got {shown(value)}")

    return check


def _check_of_one(hint: Any) -> Check:
    origin = get_origin(hint)
    if hint is Any or isinstance(hint, TypeVar):
        return lambda value: value
    if hint is ArrayLike or origin is np.ndarray:
        return _array
    if origin in (Sequence, tuple):
        return _sequence_of(*get_args(hint))
    if origin is Callable:
        return _callable
    if origin is Mapping:
        return _instance_of(Mapping)
    if isinstance(hint, type) and hint not in _NUMBERS:
        return _instance_of(hint)
    return _declared_as(hint)


def _declared_as(hint: Any) -> Check:
    """Return the check by a type of fields, as in declared classes."""
    adapter = cache(lambda: TypeAdapter(hint, config=CONFIG))

    def check(value: Any) -> Any:
        try:
            return adapter().validate_python(plain(value))
        except ValidationError as error:
            raise first_complaint(error) from None

    return check


def _instance_of(cls: type) -> Check:
    def check(value: Any) -> Any:
        if not isinstance(value, cls):
            raise FieldError("", f"must be {_described(cls)}, got {shown(value)}")
        return value

    return check


def _sequence_of(*members: Any) -> Check:
    """Return the check of a sequence: of one kind of entries, or of a fixed number of entries."""
    is_fixed = len(members) > 1 and members[-1] is not ...
    checks = [check_of(member) for member in members if member is not ...]

    def check(value: Any) -> Any:
        if not isinstance(value, Sequence) or isinstance(value, str | bytes):
            raise FieldError("", f"must be a list, got {shown(value)}")
        if is_fixed and len(value) != len(checks):
            raise FieldError("", f"must have {len(checks)} entries, got {shown(value)}")
        fitting = []
        for i, each in enumerate(value):
            try:
                fitting.append(checks[i if is_fixed else 0](each))
            except FieldError as error:
                raise error.inside(f"[{i}]") from None
        has_paths = any(isinstance(each, os.PathLike) for each in value)
        return tuple(fitting) if has_paths else value

    return check


def _array(value: Any) -> Any:
    """Return the value if NumPy can make one array of its numbers. Raises FieldError otherwise."""
    try:
        numbers(value, "")
    except SpecError:
        raise FieldError("", f"must be numbers, got {shown(value)}") from None
    return value


def _callable(value: Any) -> Any:
    if not callable(value):
        raise FieldError("", f"must be a function, got {shown(value)}")
    return value


def _described(hint: Any) -> str:
    """Return words for a type."""
    if hint is str:
        return "a name"
    if hint is ArrayLike or get_origin(hint) is np.ndarray:
        return "numbers"
    if get_origin(hint) is tuple and ... not in get_args(hint):
        return f"a tuple of {' and '.join(map(_described, get_args(hint)))}"
    if get_origin(hint) in (Sequence, tuple, Mapping):
        return "a list of them"
    if hint in (int, float):
        return "a number"
    if getattr(hint, "__metadata__", None):
        told = (getattr(each, "description", None) for each in hint.__metadata__)
        said = next(filter(None, told), None)
        return with_article(said) if said else _described(get_args(hint)[0])
    return with_article(getattr(hint, "__name__", None) or str(hint))
