"""Nothing in a file is executed when it is loaded, and the package has no call that could."""

from __future__ import annotations

import ast
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch

import snakebench
import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.learning.resume import TrainingFolder
from snakebench.physics.record import Record

PACKAGE = Path(snakebench.__file__).parent


class Trap:
    """What makes a file when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.write_text, (self.mark, "executed")


def pickled(path: Path, trap: Trap) -> None:
    path.write_bytes(pickle.dumps(trap))


def torch_file(path: Path, trap: Trap) -> None:
    torch.save({"rows": [], "trap": trap}, path)


def object_arrays(path: Path, trap: Trap) -> None:
    arrays = {name: np.array([trap], dtype=object) for name in (*Record._fields, "time", "header")}
    with path.open("wb") as file:
        np.savez(file, **arrays)


def object_array(path: Path, trap: Trap) -> None:
    with path.open("wb") as file:
        np.save(file, np.array([trap], dtype=object))


def pickle_in_an_archive(path: Path, trap: Trap) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for name in (*Record._fields, "header"):
            archive.writestr(name, pickle.dumps(trap))


FILES = (pickled, torch_file, object_arrays, object_array, pickle_in_an_archive)


@pytest.mark.parametrize("write", FILES)
def test_a_file_that_holds_code_is_refused_and_nothing_is_executed(tmp_path, write):
    path, mark = tmp_path / "file", tmp_path / "mark"
    write(path, Trap(mark))
    for load in (sb.Policy.load, sb.Trajectory.load):
        with pytest.raises(InvalidValue, match="file"):
            load(path)
    (tmp_path / "training").mkdir()
    path.rename(tmp_path / "training" / "checkpoint.pt")
    assert TrainingFolder(tmp_path / "training").checkpoint() is None
    assert not mark.exists()


def test_the_trap_works(tmp_path):
    pickled(tmp_path / "file", Trap(tmp_path / "mark"))
    pickle.loads((tmp_path / "file").read_bytes())
    assert (tmp_path / "mark").read_text() == "executed"


LOADERS = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal", "yaml"}


def unsafe(call: ast.Call) -> bool:
    """Whether a call may execute what it is given."""
    name = ast.unparse(call.func)
    options = {one.arg: ast.unparse(one.value) for one in call.keywords}
    owner, _, function = name.rpartition(".")
    if name in {"eval", "exec", "compile", "__import__", "os.system", "os.popen"} or options.get("shell") == "True":
        return True
    if owner.split(".")[0] in LOADERS and function in {"load", "loads", "Unpickler", "open", "unsafe_load"}:
        return True
    if name == "torch.load":
        return options.get("weights_only") != "True"
    if name in {"pd.read_pickle", "pandas.read_pickle", "np.fromregex", "runpy.run_path"}:
        return True
    return name in {"np.load", "numpy.load"} and options.get("allow_pickle") != "False"


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_module_calls_what_executes_a_file(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Call) and unsafe(node)]
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert found == []
    assert not {name.split(".")[0] for name in imported} & (LOADERS - {"joblib"})  # joblib is for its workers


@pytest.mark.parametrize(
    "text",
    [
        *("eval(x)", "exec('1')", "pickle.load(f)", "torch.load(f)", "torch.load(f, weights_only=False)", "np.load(f)"),
        *("np.load(f, allow_pickle=True)", "yaml.load(f)", "joblib.load(f)", "subprocess.run(x, shell=True)"),
    ],
)
def test_such_a_call_would_be_found(text):
    assert unsafe(ast.parse(text, mode="eval").body)
