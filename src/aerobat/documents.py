"""TOML documents (vehicles, problems): found, read and checked; whatever is wrong becomes one sentence.

pydantic checks types and keys, and is imported by whoever defines a model; what a value may be is for the
objects built from it to say, under `in_document`.
"""

from __future__ import annotations

import os
import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_args

from aerobat.errors import SpecError

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

    from pydantic import BaseModel

    Document = Path | Traversable
    Model = TypeVar("Model", bound=BaseModel)


def document_names(presets: Traversable) -> tuple[str, ...]:
    """The names of the documents that lie in the folder `presets`, sorted."""
    stems = (entry.name.removesuffix(".toml") for entry in presets.iterdir() if entry.name.endswith(".toml"))
    return tuple(sorted(stems))


def resolve_document(name_or_path: str | os.PathLike[str], presets: Traversable, kind: str) -> Document:
    """The document that a user means: one of the `presets` by its name, or a file by its path.

    A path object, or text that ends in .toml or has a folder in it, is a path; whether it exists is found
    out on reading. Raises SpecError, with the closest name, for a name that no preset has.
    """
    text = os.fspath(name_or_path)
    if not isinstance(name_or_path, str) or text.endswith(".toml") or "/" in text or os.sep in text:
        return Path(text)
    known = document_names(presets)
    if text not in known:
        raise unknown_name(kind, text, known)
    return presets / f"{text}.toml"


def unknown_name(kind: str, name: str, known: Iterable[str]) -> SpecError:
    """The error that says no `kind` has this name, which known name is closest, and which there are."""
    known = tuple(known)
    guess = _closest(name, known)
    hint = f"did you mean {guess!r}? Known: " if guess else "known: "
    return SpecError(f"no {kind} named {name!r}; {hint}{', '.join(known)}")


def read_document(path: str | Document, model: type[Model], kind: str) -> Model:
    """The TOML file `path` as an instance of the pydantic class `model`.

    Raises SpecError, one sentence that begins with the kind of document and its file, when the file cannot
    be read, is not TOML, or does not fit the model: then the first misfit's dotted field and a remedy follow;
    an unknown key goes first, since it is often the reason why another one is missing.
    """
    from pydantic import ValidationError

    document = Path(path) if isinstance(path, str) else path
    with in_document(document, kind):
        table = _parse(_read(document))
        try:
            return model.model_validate(table)
        except ValidationError as error:
            raise SpecError(_sentence(error, model)) from None


def write_document(path: str | os.PathLike[str], table: Mapping[str, Any], kind: str) -> None:
    """Write `table` as a TOML file, whole or not at all. Raises SpecError when the file cannot be written."""
    import tomli_w

    from aerobat.storage import whole_file

    with in_document(Path(path), kind), whole_file(Path(path)) as temporary:
        temporary.write_text(tomli_w.dumps(table), encoding="utf-8")


@contextmanager
def in_document(path: Document, kind: str) -> Iterator[None]:
    """Begin the message of any SpecError raised inside with the document it is about."""
    name = str(path) if isinstance(path, Path) else path.name
    with within(f"{kind} file {name if name.isprintable() else repr(name)}: "):
        yield


@contextmanager
def within(prefix: str) -> Iterator[None]:
    """Put `prefix` (such as "rotors[2].") before the message of any SpecError raised inside."""
    try:
        yield
    except SpecError as error:
        raise SpecError(f"{prefix}{error}") from None


def _read(path: Document) -> str:
    try:
        return path.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise SpecError("there is no such file; check the path") from None
    except IsADirectoryError:
        raise SpecError("this is a folder; give the path of a .toml file") from None
    except UnicodeDecodeError as error:
        raise SpecError(f"byte {error.start} is not UTF-8 text; save the file as UTF-8") from None
    except (OSError, ValueError) as error:
        raise SpecError(f"cannot be read: {_reason(error)}") from None


def _reason(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)


def _parse(text: str) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(text)
    except RecursionError:
        raise SpecError("this is not a TOML file that can be read: it nests too deeply") from None
    except ValueError as error:  # TOMLDecodeError, or an integer with thousands of digits
        raise SpecError(f"this is not valid TOML: {error}") from None


# How pydantic's error types read; {} is filled from the error's context.
_COMPLAINTS = {
    "missing": "is missing; add it",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be a finite number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
    "literal_error": "must be {expected}",
    "too_short": "must have at least {min_length} entries, got {actual_length}",
    "too_long": "must have at most {max_length} entries, got {actual_length}",
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
}
_COMPLETE = {"missing", "too_short", "too_long"}  # their sentence needs no "got ..."


def _sentence(error: Any, model: type[BaseModel]) -> str:
    """The first of pydantic's errors as a sentence about its field; an unknown key comes before others."""
    details = error.errors(include_url=False)
    unknown = next((detail for detail in details if detail["type"] == "extra_forbidden"), None)
    if unknown:
        return _unknown_key(model, unknown["loc"])
    first = _closest_alternative(details, model)
    kind, context = first["type"], first.get("ctx", {})
    field, _ = _place(model, first["loc"])
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _untagged(field, context)
    if kind == "value_error":  # a validator's own sentence
        return f"{field}: {context['error']}" if field else str(context["error"])
    complaint = _COMPLAINTS[kind].format_map(context) if kind in _COMPLAINTS else f"is wrong ({first['msg']})"
    return f"{field} {complaint}" + ("" if kind in _COMPLETE else f", got {_shown(first['input'])}")


def _closest_alternative(details: Sequence[Any], model: type[BaseModel]) -> Any:
    """The first error; where a value may be of several types, that of the type it comes closest to."""
    field, _ = _place(model, details[0]["loc"])
    places = [_place(model, detail["loc"])[0] for detail in details]
    inside = [place == field or place.startswith((f"{field}[", f"{field}.")) for place in places]
    return max(compress(details, inside), key=lambda detail: len(detail["loc"]))


def _unknown_key(model: type[BaseModel], place: Sequence[str | int]) -> str:
    table, known = _place(model, place[:-1])
    guess = _closest(str(place[-1]), known)
    remedy = f"did you mean {guess!r}?" if guess else f"known keys are {', '.join(known)}"
    return f"{_joined(table, str(place[-1]))} is not a known key; {remedy}"


def _untagged(field: str, context: Mapping[str, Any]) -> str:
    """A table whose `kind`-like key, which decides what else it holds, is missing or says nothing known."""
    key = _joined(field, context["discriminator"].strip("'"))
    if "tag" not in context:
        return f"{key} {_COMPLAINTS['missing']}"
    return f"{key} must be one of {context['expected_tags']}, got {_shown(context['tag'])}"


def _place(model: type[BaseModel], location: Sequence[str | int]) -> tuple[str, list[str]]:
    """The dotted name of pydantic's location as a user would write it, and the keys known there.

    Where a table is one of several kinds, pydantic inserts the kind's tag or the name of our class for it,
    which no file spells: left out. A tag may read like a key of its table.
    """
    name, models = "", [model]
    for part in location:
        fields = {key: field for each in models for key, field in each.model_fields.items()}
        kinds = [each for each in models if _tagged(each, part) or each.__name__ == part]
        if isinstance(part, int):
            name += f"[{part}]"
        elif part in fields and not (kinds and len(models) > 1):
            name, models = _joined(name, part), _models_in(fields[part].annotation)
        else:
            models = kinds
    return name, [key for each in models for key in each.model_fields]


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    """The model classes that an annotation such as `list[A | B]` speaks of."""
    if hasattr(annotation, "model_fields"):
        return [annotation]
    return [model for argument in get_args(annotation) for model in _models_in(argument)]


def _tagged(model: type[BaseModel], tag: str | int) -> bool:
    return any(tag in get_args(field.annotation) for field in model.model_fields.values())


def _joined(table: str, key: str) -> str:
    key = key if key.isprintable() else repr(key)
    return f"{table}.{key}" if table else key


def _closest(name: str, known: Iterable[str]) -> str | None:
    import difflib

    return next(iter(difflib.get_close_matches(name.lower(), known, n=1)), None)


def _shown(value: Any) -> str:
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return f"a list of {len(value)}" if value else "an empty list"
    try:
        return reprlib.repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a huge number"
