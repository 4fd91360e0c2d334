"""Registries of classes by name, from this package, users' files and installed packages."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.machinery import SourceFileLoader
from inspect import isabstract, unwrap
from pathlib import Path
from traceback import extract_tb
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from aerobat.declaration import FieldError, PathName, declared, from_table, shown, unknown_name, validated
from aerobat.declaration.sentences import with_article
from aerobat.errors import SpecError, chain_of

T = TypeVar("T")


class Registry(Generic[T]):
    """The declared classes of one base, each by its name.

    The package's own classes of `modules` come first, in that order; each module is imported when its name is
    first requested. Installed packages add classes through the entry points of `group`. These are imported
    when an unregistered name is requested, or all names are.

    Args:
        base: the common base class.
        noun: the word for one class in messages.
        group: the group of entry points, such as "aerobat.maneuvers".
        modules: by name, the modules that register it when they are imported.
    """

    def __init__(
        self, base: type[T], noun: str, group: str, modules: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self._base = base
        self._noun = noun
        self._one = with_article(noun)
        self._group = group
        self._modules = modules
        self._classes: dict[str, type[T]] = {}
        self._searched = False

    def add(self, name: str, cls: type[T]) -> type[T]:
        """Declare `cls` and register it as `name`. Raises SpecError for an unfit class or a name in use."""
        if not isinstance(cls, type):
            raise SpecError(f"{self._one} is a class, got {shown(cls)}; write its name above a class")
        if not issubclass(cls, self._base):
            raise SpecError(f"{cls.__name__} must inherit from {self._base.__name__} to be {self._one}")
        if isabstract(cls):
            wanting = " and ".join(sorted(vars(cls)["__abstractmethods__"]))
            raise SpecError(f"{cls.__name__} has no {wanting} and is no {self._noun} without; define it")
        if cls.__module__ != self._modules.get(name):
            self._import_own(name)
        other = self._classes.get(name)
        if other and (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):
            both = " and ".join(f"{each.__name__} of {each.__module__}" for each in (other, cls))
            raise SpecError(f"there are two {self._noun}s named {name!r}, {both}; rename one")
        made: Any = declared(cls)
        if "kind" in vars(cls).get("__annotations__", {}):
            raise SpecError(f"{cls.__name__}.kind hides the name of the {self._noun} in files; rename it")
        if not made.__pydantic_complete__:
            raise SpecError(f"{cls.__name__} has a field whose type is no known name; import that type")
        made.kind = name
        self._classes[name] = made
        return self._classes[name]

    def __getitem__(self, name: str) -> type[T]:
        """Return the class of that name. Raises SpecError, with the closest name, when there is none."""
        if name not in self:
            raise unknown_name(self._noun, name, self)
        return self._classes[name]

    def __contains__(self, name: str) -> bool:
        self._import_own(name)
        return name in self._classes or name in tuple(self)

    def __iter__(self) -> Iterator[str]:
        for name in self._modules:
            self._import_own(name)
        self._import_installed()
        return iter((*self._modules, *sorted(self._classes.keys() - self._modules)))

    def read(self, value: Any) -> T:
        """Return a field's value: an instance of the base class, or made from a table with its `kind`.

        Raises FieldError for anything else.
        """
        if isinstance(value, self._base):
            return value
        if not isinstance(value, Mapping):
            complaint = f"must be {with_article(self._base.__name__)}, in a file a table, got {shown(value)}"
            raise FieldError("", complaint)
        if "kind" not in value:
            raise FieldError("kind", "is missing; add it")
        kind = value["kind"]
        if not isinstance(kind, str) or kind not in self:
            known = ", ".join(map(repr, self))
            own = f"your own, with --import FILE.py, or one of {known}"
            kinds = own if isinstance(kind, str) else known
            raise FieldError("kind", f"must be one of {kinds}, got {shown(kind)}")
        return from_table(self[kind], {key: each for key, each in value.items() if key != "kind"})

    def instance(self, value: Any) -> T | None:
        """Return an instance as it is, the class of a name with its defaults, or None for None.

        Raises FieldError for anything else.
        """
        if value is None or isinstance(value, self._base):
            return value
        if not isinstance(value, str):
            raise FieldError("", f"must be {self._one} or the name of one, got {shown(value)}")
        try:
            return self[value]()
        except SpecError as error:
            raise FieldError("", f": {error}") from None

    def _import_own(self, name: str) -> None:
        if name in self._modules:
            import_module(self._modules[name])

    def _import_installed(self) -> None:
        if self._searched:
            return
        self._searched = True
        from importlib.metadata import entry_points

        for entry in entry_points(group=self._group):
            _import(entry.load, f"{self._group} of the installed package {entry.value}")


_PLUGIN = "aerobat_plugin_"  # prefix of the names of modules made of users' files


def imported_plugins() -> tuple[str, ...]:
    """Return the paths of files that `import_plugin` has run, so that another process can run them too."""
    found = ((name, module.__file__) for name, module in sys.modules.items() if name.startswith(_PLUGIN))
    return tuple(path for _, path in found if path is not None)


class _PluginLoader(SourceFileLoader):
    """Loader of a user's file that writes no byte code beside it."""

    def set_data(self, path: str, data: Any, *, _mode: int = 0) -> None:
        """Write nothing."""


@validated
def import_plugin(path: PathName) -> None:
    """Run a user's Python file, which registers maneuvers, planners and other classes, once.

    Raises SpecError when there is no such file or it fails.
    """
    import hashlib
    import importlib.util

    file = Path(path).resolve()
    name = _PLUGIN + hashlib.sha256(os.fsencode(file)).hexdigest()[:16]
    if name in sys.modules:
        return
    loader = _PluginLoader(name, str(file))
    spec = importlib.util.spec_from_file_location(name, file, loader=loader)
    if spec is None or file.suffix != ".py" or not file.is_file():
        raise SpecError(f"plugin {path}: there is no such Python file; give the path of a .py file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # before it runs: annotations are looked up in this module
    try:
        _import(lambda: loader.exec_module(module), f"plugin {path}")
    except BaseException:  # also for interrupts
        del sys.modules[name]
        raise


def _import(load: Any, what: str) -> None:
    try:
        load()
    except SpecError as error:
        raise SpecError(f"{what}{_line(error)}: {error}") from None
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split())
        said = f"{type(error).__name__}: {reason}" if reason else type(error).__name__
        raise SpecError(f"{what}{_line(error)} cannot be imported: {said}") from error


def _line(error: BaseException) -> str:
    """Return the line of a plugin at which an error occurred, after a colon; "" if it was in no plugin."""
    if isinstance(error, SyntaxError) and error.filename in imported_plugins():
        return f":{error.lineno}"
    found = [line for path, line in passed_lines(error) if path in imported_plugins()]
    return f":{found[-1]}" if found else ""


def placed(error: SpecError, method: Any = None) -> SpecError:
    """Return the error with a plugin's file and line before its sentence, if a plugin caused it.

    Args:
        error: The error.
        method: Of the class with a wrong answer; its first line is named if the error passed through no
            plugin.
    """
    code = getattr(unwrap(method), "__code__", None) if callable(method) else None
    lines = [*([] if code is None else [(code.co_filename, code.co_firstlineno)]), *passed_lines(error)]
    within = [f"{path}:{line}" for path, line in lines if path in imported_plugins()]
    if not within or any(path in str(error) for path in imported_plugins()):
        return error
    return SpecError(f"{within[-1]}: {error}")


def passed_lines(error: BaseException) -> list[tuple[str, int]]:
    """Return the files and lines that an error and its causes passed through."""
    frames = (frame for each in chain_of(error) for frame in extract_tb(each.__traceback__))
    return [(frame.filename, frame.lineno or 0) for frame in frames]
