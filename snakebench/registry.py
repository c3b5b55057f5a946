"""Registries of what has a name, and plug-ins: Python modules that add entries to them when imported.

A plug-in is installed, with an entry point in the group "snakebench", or SNAKEBENCH_PLUGINS names its file.
"""

import os
import sys
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from functools import partial
from importlib import import_module, metadata
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from snakebench.errors import InvalidValue, UnknownName
from snakebench.value import checked_name, normal_form

GROUP = "snakebench"  # of the entry points
VARIABLE = "SNAKEBENCH_PLUGINS"  # paths of Python files, separated as in PATH
_T = TypeVar("_T")
_loaded: dict[str, object] | None = None  # plug-ins by name, once they are looked for

Complaint = Callable[[str, object], str | None]


def instance_of(kind: type) -> Complaint:
    """A check that something is an instance of a class."""
    return lambda _, thing: None if isinstance(thing, kind) else f"{thing!r} is no {kind.__name__}"


def to_be_called(_: str, thing: object) -> str | None:
    """A check that something can be called."""
    return None if callable(thing) else f"{thing!r} cannot be called"


class Registry(MutableMapping[str, _T]):
    """A dictionary by name; reading it loads the plug-ins first.

    Each entry has a name of its own and passes a check, `complaint`, which returns what is wrong with it, or None.
    """

    def __init__(self, what: str, own: Mapping[str, _T], complaint: Complaint) -> None:
        self._what, self._named, self._complaint = what, dict(own), complaint
        self.own = tuple(own)

    def named(self, name: str) -> _T:
        """The entry of that name."""
        if name not in self:
            hint = [] if len(self) > len(self.own) else [f"or a plug-in's, of which {VARIABLE} names none here"]
            raise UnknownName.among(self._what, name, [*self, *hint])
        return self[name]

    def __getitem__(self, name: str) -> _T:
        load_plugins()
        return self._named[normal_form(name)]

    def __setitem__(self, name: str, thing: _T) -> None:
        try:
            name = checked_name(name)
        except ValueError as error:
            raise InvalidValue(f"{self._what} {name!r}: {error}") from None
        if not name[0].isalpha():  # numbers are fluids
            raise InvalidValue(f"{self._what} {name!r}: it must begin with a letter")
        if name in self._named:
            raise InvalidValue(f"{self._what} {name!r} is there already: give yours another name")
        if complaint := self._complaint(name, thing):
            raise InvalidValue(f"{self._what} {name!r}: {complaint}")
        self._named[name] = thing

    def __delitem__(self, name: str) -> None:
        del self._named[name]

    def __iter__(self) -> Iterator[str]:
        load_plugins()
        return iter(self._named)

    def __len__(self) -> int:
        load_plugins()
        return len(self._named)


def load_plugins() -> Mapping[str, object]:
    """All plug-ins by their names, imported once: those installed, by their entry points, then the files."""
    global _loaded
    if _loaded is not None:
        return _loaded
    _loaded = {}  # a plug-in that reads a registry does not begin again
    installed = {entry.value: entry.load for entry in sorted(metadata.entry_points(group=GROUP))}
    files = filter(None, os.environ.get(VARIABLE, "").split(os.pathsep))
    for name, load in (installed | {path: partial(_import_file, Path(path)) for path in files}).items():
        try:
            _loaded[name] = load()
        except Exception as error:  # whatever a plug-in does
            _loaded = None
            raise InvalidValue(f"cannot load the plug-in {name}: {type(error).__name__}: {error}") from error
    return _loaded


def _import_file(path: Path) -> ModuleType:
    """Import a file as a module that workers can import as well: they share the path, where its directory is put."""
    if not path.is_file():
        raise InvalidValue("there is no such file")
    if str(path.resolve().parent) not in sys.path:
        sys.path.append(str(path.resolve().parent))
    module = import_module(path.stem)
    if module.__file__ is None or not path.samefile(module.__file__):
        raise InvalidValue(f"another module is called {path.stem} as well, {module.__file__}: rename the file")
    return module
