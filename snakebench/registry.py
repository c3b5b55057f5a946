"""What there is by name, and how others add to it: plug-ins are Python modules that register names when imported.

A plug-in is installed, and declares an entry point in the group "snakebench"; or it is a file, and the environment
variable SNAKEBENCH_PLUGINS names it. The variable reaches every worker process of this machine by itself.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, MutableMapping
from functools import partial
from importlib import import_module, metadata
from pathlib import Path
from typing import TypeVar

from snakebench.errors import InvalidValue, UnknownName

GROUP = "snakebench"  # of the entry points
VARIABLE = "SNAKEBENCH_PLUGINS"  # paths of Python files, separated as in PATH
_T = TypeVar("_T")
_loaded = False


class Registry(MutableMapping[str, _T]):
    """A dictionary of what may be called by name; reading it loads the plug-ins first.

    Args:
        what: is registered, in one word.
        own: what this package itself has.

    Raises:
        InvalidValue: when a name is given away twice.
    """

    def __init__(self, what: str, own: Mapping[str, _T]) -> None:
        self._what, self._named = what, dict(own)
        self.own = tuple(own)

    def named(self, name: str) -> _T:
        """What is called so.

        Raises:
            UnknownName: with the nearest valid names.
        """
        if name not in self:
            raise UnknownName.among(self._what, name, self)
        return self[name]

    def __getitem__(self, name: str) -> _T:
        load_plugins()
        return self._named[name]

    def __setitem__(self, name: str, thing: _T) -> None:
        if name in self._named:
            raise InvalidValue(f"{self._what} {name!r} is there already: give yours another name")
        self._named[name] = thing

    def __delitem__(self, name: str) -> None:
        del self._named[name]

    def __iter__(self) -> Iterator[str]:
        load_plugins()
        return iter(self._named)

    def __len__(self) -> int:
        load_plugins()
        return len(self._named)


def load_plugins() -> None:
    """Import all plug-ins, once: those installed, by the names of their entry points, then the files.

    Raises:
        InvalidValue: naming the plug-in that cannot be imported.
    """
    global _loaded
    if _loaded:
        return
    _loaded = True  # a plug-in that reads a registry does not begin again
    installed = {entry.value: entry.load for entry in sorted(metadata.entry_points(group=GROUP))}
    files = filter(None, os.environ.get(VARIABLE, "").split(os.pathsep))
    for name, load in (installed | {path: partial(_import_file, Path(path)) for path in files}).items():
        try:
            load()
        except Exception as error:  # whatever a plug-in does
            _loaded = False
            raise InvalidValue(f"cannot load the plug-in {name}: {type(error).__name__}: {error}") from error


def _import_file(path: Path) -> None:
    """Import a file as a module that workers can import as well: its directory is put on the path, which they share."""
    if not path.is_file():
        raise InvalidValue("there is no such file")
    if str(path.resolve().parent) not in sys.path:
        sys.path.append(str(path.resolve().parent))
    found = import_module(path.stem).__file__
    if found is None or not path.samefile(found):
        raise InvalidValue(f"another module is called {path.stem} as well, {found}: rename the file")
