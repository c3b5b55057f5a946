"""numba, made ready: compiled code is kept between runs wherever this user may write."""

import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from snakebench.errors import InvalidValue

if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise InvalidValue("NUMBA_DISABLE_JIT = 1: the physics runs compiled only: unset it, or set it to 0")


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` with the same options; in a container it may have to keep compiled code in a temporary directory."""

    def compiled(function: Callable[..., Any]) -> Any:
        try:
            return numba.njit(**options)(function)
        except RuntimeError:  # numba may write nowhere
            directory = _directory()
            if directory is not None:
                os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR = directory  # type: ignore[attr-defined]
            return numba.njit(**options | {"cache": directory is not None})(function)

    return compiled


def _directory() -> str | None:
    """A temporary directory where no one but this user may write, since numba runs what it finds; None without one."""
    owner = getattr(os, "geteuid", int)()
    path = Path(tempfile.gettempdir()) / f"snakebench-{owner}"
    try:
        path.mkdir(mode=0o700, exist_ok=True)
        found = path.lstat()
    except OSError:
        return None
    safe = stat.S_ISDIR(found.st_mode) and found.st_uid == owner and not stat.S_IMODE(found.st_mode) & 0o077
    return str(path) if safe else None
