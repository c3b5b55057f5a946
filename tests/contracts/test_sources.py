"""Neither cached evaluations nor compiled code outlive a change of the physics."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import snakebench
from snakebench.sources import code_digest

SCRIPT = """
import snakebench as sb
from snakebench.keys import evaluation_key
gait = sb.SinusoidalTorque(amplitude=3.0, frequency=1.0, phase=0.8)
print(evaluation_key(gait, sb.Scenario(duration=1.0)), sb.evaluate(gait, duration=1.0).speed)
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory) -> Path:
    """A copy of the package that a test may change."""
    root = tmp_path_factory.mktemp("copy")
    shutil.copytree(Path(snakebench.__file__).parent, root / "snakebench", ignore=shutil.ignore_patterns("__pycache__"))
    return root


def key_and_speed(package: Path, script: str = SCRIPT) -> list[str]:
    environment = os.environ | {"PYTHONPATH": str(package)}
    command = [sys.executable, "-c", script]
    return subprocess.run(
        command, env=environment, cwd=package, capture_output=True, text=True, check=True
    ).stdout.split()


@pytest.mark.slow
def test_a_changed_force_law_is_compiled_again_and_has_other_keys(package):
    law = package / "snakebench" / "hydrodynamics.py"
    original = law.read_text()
    before = key_and_speed(package)
    law.write_text(original.replace("C_MU = 0.31584", "C_MU = 3.1584"))
    changed = key_and_speed(package)
    law.write_text(original)
    assert changed[0] != before[0]
    assert float(changed[1]) < 0.95 * float(before[1])
    assert key_and_speed(package) == before


@pytest.mark.slow
def test_a_comment_changes_nothing(package):
    law = package / "snakebench" / "hydrodynamics.py"
    original, before = law.read_text(), key_and_speed(package)
    law.write_text(
        original.replace('"""The fluid force', '"""What the fluid force').replace("# added mass", "# the added mass")
    )
    assert law.read_text() != original
    assert key_and_speed(package) == before
    law.write_text(original)


@pytest.mark.slow
def test_the_planar_engine_too_is_compiled_again(package):
    law, script = package / "snakebench" / "hydrodynamics.py", SCRIPT.replace("duration", "engine='planar', duration")
    original = law.read_text()
    before = key_and_speed(package, script)
    law.write_text(original.replace("C_MU = 0.31584", "C_MU = 3.1584"))
    changed = key_and_speed(package, script)
    law.write_text(original)
    assert changed[0] != before[0]
    assert float(changed[1]) < 0.95 * float(before[1])


@pytest.mark.parametrize(("engine", "compiled"), [("bullet", "swimmer"), ("planar", "stepping")])
def test_every_module_that_an_evaluation_imports_is_part_of_its_key(engine, compiled):
    import ast

    from snakebench import evaluation

    sources = import_module(f"snakebench.engines.{compiled}").SOURCES

    root = Path(snakebench.__file__).parent
    tree = ast.parse((root / "evaluation.py").read_text())
    (code,) = [
        node for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) == "code_digest"
    ]
    keyed = {argument.value for argument in code.args} | set(sources) | {f"engines/{engine}.py"}
    reached, todo = set(), {"evaluation.py", f"engines/{engine}.py"}
    while todo:
        name = todo.pop()
        reached.add(name)
        for node in ast.walk(ast.parse((root / name).read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("snakebench"):
                parts = node.module.split(".")[1:] or [alias.name for alias in node.names]
                module = "/".join(parts) + ".py"
                if (root / module).is_file() and module not in reached:
                    todo.add(module)
    assert evaluation._CODE
    no_number = {"compilation.py", "errors.py", "files.py", "memory.py", "names.py", "registry.py", "sources.py"}
    assert reached - keyed <= no_number


def test_digests_differ_between_modules():
    assert code_digest("fluid.py") != code_digest("robot.py")
