"""numba, made ready: compiled code is kept between runs wherever this user may write.

Raises:
    InvalidValue: on import, when numba is told to compile nothing.
"""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba

from snakebench.errors import InvalidValue

if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise InvalidValue("NUMBA_DISABLE_JIT = 1: the physics runs compiled only: unset it, or set it to 0")


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit`, which takes the same options.

    What is to be kept (`cache=True`) is kept where numba keeps it. In a container, where it often may write neither
    beside the package nor to the home directory, it is kept in a temporary directory, which workers are told of.
    """

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
    """A temporary directory of this user, where no one else may write: numba runs what it finds there.

    The same one each time; where it is not safe, a new one, which goes with this process; None where none can be made.
    """
    owner = getattr(os, "geteuid", int)()
    try:
        usual = Path(tempfile.gettempdir()) / f"snakebench-{owner}"
        with suppress(FileExistsError):
            usual.mkdir(mode=0o700)
        found = usual.lstat()
        if stat.S_ISDIR(found.st_mode) and found.st_uid == owner and not stat.S_IMODE(found.st_mode) & 0o077:
            return str(usual)
        new = tempfile.mkdtemp(prefix="snakebench-")
    except OSError:
        return None
    atexit.register(shutil.rmtree, new, ignore_errors=True)
    return new
