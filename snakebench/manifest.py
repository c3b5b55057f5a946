"""The manifest of results: what made them, and which files they are."""

import json
import os
import platform
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from snakebench.errors import InvalidValue, OtherFormat, StoreError
from snakebench.files import readable_file
from snakebench.names import SMALLER
from snakebench.registry import load_plugins
from snakebench.sources import package_version, plugin_digest
from snakebench.store import FORMAT
from snakebench.value import digest
from snakebench.version import __version__

MANIFEST = "manifest.json"
LEFT_OUT = "left_out"  # of a manifest: files that a copy of the results may lack, and the command that makes them
_DIGEST = "digest"  # of a manifest, by its own name in it
_PACKAGES = (
    *("pybullet", "numpy", "scipy", "numba", "optuna", "pandas", "pymoo", "moocore", "cmaes", "torch"),
    *("gymnasium", "stable-baselines3", "sb3-contrib", "casadi", "onnxruntime"),
)


def provenance() -> dict[str, Any]:
    """What runs here and now: versions of packages, the commit of the source, digests of plug-ins, the machine.

    The commit is that at the first call of a process, whose code stays what it was.
    """
    plugins, packages = plugin_digests(), {name: package_version(name) for name in _PACKAGES}
    return {
        "versions": {"python": platform.python_version(), "snakebench": __version__} | packages,
        "commit": _own_commit(),
        **({"plugins": plugins} if plugins else {}),
        "machine": {"system": platform.platform(), "processor": platform.machine(), "cores": os.cpu_count()},
    }


@cache
def _own_commit() -> str | None:
    return commit_of(__file__)


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
    study, _, profile = directory.rpartition("-")
    if study and profile in SMALLER:
        return f"snakebench run-study {study} --profile {profile}"
    return f"snakebench {'bench' if directory == 'bench' else f'run-study {directory}'}"


def read_manifest(directory: Path) -> dict[str, Any]:
    """Read the manifest of a results directory; it is `Damaged` when it is not as it was written."""
    path, nothing = directory / MANIFEST, f"{directory} holds no results of snakebench: {MANIFEST}"
    try:
        manifest = json.loads(readable_file(path).read_text(encoding="utf-8"))
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
    written, lists = manifest.pop(_DIGEST, None), (manifest.get("files", {}), left_out_files(manifest))
    listed = all(isinstance(part, dict) and all(isinstance(seal, str) for seal in part.values()) for part in lists)
    try:
        intact = found == FORMAT and listed and written == digest(manifest)
    except ValueError:  # a number that JSON has not, such as NaN
        intact = False
    if not intact:
        raise Damaged(f"{nothing} is damaged: it is not as it was written")
    return manifest


def left_out_files(manifest: Mapping[str, Any]) -> dict[str, str]:
    """The files that a copy of the results may lack, and their digests."""
    left_out = manifest.get(LEFT_OUT, {})
    return left_out.get("files", {}) if isinstance(left_out, dict) else left_out


class Damaged(StoreError):
    """Results or a manifest that are not as they were written."""


def commit_of(file: str) -> str | None:
    """The commit of a package that a file lies in, with `+` when it or what is beside it has uncommitted changes.

    Only studies and examples count, not their texts. None outside a checkout.
    """
    folder, name = os.path.split(file)

    def git(*words: str) -> str:
        run = subprocess.run(["git", "-C", folder, *words], capture_output=True, text=True, timeout=60, check=True)
        return run.stdout.strip()

    try:
        git("ls-files", "--error-unmatch", name)
        changed = git("status", "--porcelain", "--", ".", "../studies", "../examples", ":(top,exclude)*.md")
        return git("rev-parse", "--short=12", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None
