"""The manifest of results, which says where they come from, and the names that results share."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from snakebench.errors import InvalidValue, OtherFormat, StoreError
from snakebench.registry import load_plugins
from snakebench.sources import package_version, plugin_digest
from snakebench.value import digest

MANIFEST = "manifest.json"
LEFT_OUT = "left_out"  # of a manifest: files that a copy of the results may lack, and the command that makes them
_DIGEST = "digest"  # of a manifest, by its own name in it
FORMAT = 1  # of the cache's table, the result tables and the manifest
_PACKAGES = (
    *("snakebench", "pybullet", "numpy", "scipy", "numba", "optuna", "pandas", "pymoo", "moocore", "cmaes", "torch"),
    *("gymnasium", "stable-baselines3", "sb3-contrib"),
)
SMALLER = ("quick", "smoke")  # profiles whose results stand beside the published ones, as STUDY-PROFILE
# Every study but quickstart, which is a small sea_snake; a study that reads results of others comes after them.
STUDIES = (
    *("validation", "sea_snake", "sea_snake_front", "pareto", "fourier", "teacher_student", "learned_front"),
    *("cross", "adaptation", "relearned", "sensitivity"),
)
PAPER, EXTENDED = "paper", "extended"  # search spaces of the sinusoidal torque: the paper's and a wider one
# What tables call that which a gait is tuned to, where it is not one fluid.
INTEGRATED = "integrated"  # all fluids, by the mean over them
SIMPLE_SUM = "simple-sum"  # each fluid by a gait of its own, switched at once: the name of a front
ADAPTIVE = "adaptive"  # whichever fluid it finds itself in, as a policy


def provenance() -> dict[str, Any]:
    """What runs here and now: versions of packages, the commit of the source, digests of plug-ins, the machine."""
    plugins = plugin_digests()
    return {
        "versions": {"python": platform.python_version()} | {name: package_version(name) for name in _PACKAGES},
        "commit": _commit(),
        **({"plugins": plugins} if plugins else {}),
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cores": os.cpu_count()},
    }


def plugin_digests() -> dict[str, str | None]:
    """The digest of the code of each plug-in, by its name; None where it is in no file."""
    digests: dict[str, str | None] = dict.fromkeys(load_plugins())
    for name, plugin in load_plugins().items():
        with suppress(InvalidValue, TypeError):
            digests[name] = plugin_digest(plugin)
    return digests


def manifest_text(content: Mapping[str, Any]) -> str:
    """A manifest as JSON, with its format and a digest of all else, by which damage is found."""
    content = {"format": FORMAT} | {name: part for name, part in content.items() if name != _DIGEST}
    return json.dumps({**content, _DIGEST: digest(content)}, indent=2) + "\n"


def command_of(directory: str, manifest: Mapping[str, Any] | None = None) -> str:
    """The command that makes the results in a directory of that name; the one that made them, if a manifest tells."""
    if manifest and manifest.get("command"):
        return str(manifest["command"])
    study, _, profile = directory.partition("-")
    return f"snakebench run-study {study}" + (f" --profile {profile}" if profile in SMALLER else "")


def read_manifest(directory: Path) -> dict[str, Any]:
    """Read the manifest of a results directory; it is `Damaged` when it is not as it was written."""
    path, nothing = directory / MANIFEST, f"{directory} holds no results of snakebench: {MANIFEST}"
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise StoreError(f"{nothing}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise Damaged(f"{nothing} is damaged: {error}") from None
    if not isinstance(manifest, dict) or not manifest:
        raise Damaged(f"{nothing} is damaged: it says nothing")
    if manifest.keys().isdisjoint({"format", "study", "config", _DIGEST}):
        raise StoreError(f"{nothing} is of another program")
    if isinstance(found := manifest.get("format"), int) and found != FORMAT:
        raise OtherFormat(directory, found, FORMAT)
    written, files = manifest.pop(_DIGEST, None), manifest.get("files", {})  # version 1.0 wrote neither
    lists = (files, left_out_files(manifest))
    listed = all(isinstance(part, dict) and all(isinstance(seal, str) for seal in part.values()) for part in lists)
    if found != FORMAT or not listed or written not in (None, digest(manifest)):
        raise Damaged(f"{nothing} is damaged: it is not as it was written")
    return manifest


def left_out_files(manifest: Mapping[str, Any]) -> dict[str, str]:
    """The files that a copy of the results may lack, and their digests."""
    left_out = manifest.get(LEFT_OUT, {})
    return left_out.get("files", {}) if isinstance(left_out, dict) else left_out


def file_digest(content: bytes) -> str:
    """SHA-256 of a file's content, by which a manifest lists it."""
    return hashlib.sha256(content).hexdigest()


class Damaged(StoreError):
    """Results or a manifest that are not as they were written."""


def _commit() -> str | None:
    """The commit of the source that runs, with `+` when it has uncommitted changes; None outside a checkout."""
    folder, name = os.path.split(__file__)
    tracked = ["git", "-C", folder, "ls-files", "--error-unmatch", name]
    describe = ["git", "-C", folder, "describe", "--always", "--dirty=+", "--abbrev=12", "--exclude=*"]
    try:
        subprocess.run(tracked, capture_output=True, timeout=10, check=True)
        return subprocess.run(describe, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None
