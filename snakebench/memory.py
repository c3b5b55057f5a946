"""Does it fit into memory? Asked before anything is allocated, since a system may end a process that takes too much."""

import ctypes
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil

from snakebench.errors import InvalidValue

_CONTROL_GROUPS = Path("/sys/fs/cgroup")  # of Linux: they bound containers and the jobs of a cluster
_OWN_GROUP = Path("/proc/self/cgroup")
_TRIM, _MMAP = -1, -3  # M_TRIM_THRESHOLD and M_MMAP_THRESHOLD of glibc's mallopt


def check_memory(what: str, needed: float) -> None:
    """Make sure that what a setting such as "duration = 1e6 s" needs at its peak [bytes] is available."""
    available = available_memory()
    if needed > available:
        raise InvalidValue(f"{what}: needs {needed / 1e9:.1f} GB of memory, {available / 1e9:.1f} GB are available")


def available_memory() -> float:
    """Memory that this process may still take [bytes]: of the machine, its container or its own limit."""
    process, left = psutil.Process(), [psutil.virtual_memory().available, *_left_in_groups()]
    if hasattr(process, "rlimit"):  # on Linux and FreeBSD
        most, _ = process.rlimit(psutil.RLIMIT_AS)
        left += [most - process.memory_info().vms] if most != psutil.RLIM_INFINITY else []
    return max(min(left), 0)


def keep_freed_memory() -> None:
    """Let this process keep the memory that it frees, for what it allocates next; without effect but with glibc.

    A training allocates tensors of the same sizes again and again: new pages for them take a tenth of its time.
    """
    with suppress(OSError, AttributeError):
        libc = ctypes.CDLL(None)
        libc.mallopt(_MMAP, 2**25)  # the largest value
        libc.mallopt(_TRIM, 2**30)


def _left_in_groups() -> Iterator[float]:
    """What each control group of the process may still take, files that are only cached apart [bytes]."""
    try:
        own = _OWN_GROUP.read_text().partition("0::/")[2].partition("\n")[0]
    except OSError:
        return
    for group in (_CONTROL_GROUPS / own, *(_CONTROL_GROUPS / own).parents):
        try:
            most = int((group / "memory.max").read_text())
            taken = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())["anon"]
        except (OSError, ValueError, KeyError):  # unlimited, or no group of the second version
            continue
        yield most - int(taken)
