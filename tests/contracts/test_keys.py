# ruff: noqa: E501  # an edit is a line
"""A key is of what is computed: no wording changes it, every formula and constant does; compiled code likewise."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from mutations import MUTATIONS

import snakebench
from snakebench.sources import code_digest

PACKAGE = Path(snakebench.__file__).parent

# Makes each edit in the copy of the package in the working directory, imports it anew, and prints its keys.
KEYS = """
import json, sys
from importlib import invalidate_caches
from pathlib import Path

sys.dont_write_bytecode = True
answers = []
for edits in json.load(sys.stdin):
    originals = {Path(path): Path(path).read_text() for path, _, _ in edits}
    for path, old, new in edits:
        text = Path(path).read_text()
        assert old in text, (path, old)
        Path(path).write_text(text.replace(old, new, 1))
    for name in [name for name in sys.modules if name.partition(".")[0] == "snakebench"]:
        del sys.modules[name]
    invalidate_caches()
    import snakebench as sb
    from snakebench.execution import evaluation_key
    from snakebench.learning.resume import learning_key
    from snakebench.learning.settings import Distillation, Training

    policy = sb.Policy.load(sys.argv[1])
    wave, snake = sb.SinusoidalTorque(amplitude=3.0, frequency=0.7, phase=0.8), sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
    oil = sb.FLUIDS[list(sb.FLUIDS)[3]]
    swims = {f"{engine} {name}": evaluation_key(controller, sb.Scenario(fluid=oil, engine=engine))
        for engine in ("pybullet", "planar") for name, controller in (("wave", wave), ("snake", snake), ("policy", policy))}
    learned = {"training": learning_key(Training(steps=1000), 0),
        "distillation": learning_key(Distillation(teacher="teacher"), 0, policy)}
    answers.append(swims | learned)
    for path, text in originals.items():
        path.write_text(text)
print(json.dumps(answers))
"""


class Edit(NamedTuple):
    """A replacement in a file of the package, once."""

    file: str
    old: str
    new: str


WORDINGS = {
    "a docstring of the physics": Edit("physics/hydrodynamics.py", '"""The fluid force', '"""What the fluid force'),
    "a docstring of the metrics": Edit("metrics.py", '"""Trajectory to numbers', '"""From trajectory to numbers'),
    "a docstring of an engine": Edit("engines/bullet.py", "One robot in PyBullet,", "A robot in PyBullet,"),
    "a docstring of the learner": Edit("learning/resume.py", "A hash of everything", "The hash of everything"),
    "a comment": Edit("physics/hydrodynamics.py", "# added mass", "# the added mass"),
    "a type": Edit("metrics.py", "def speed(trajectory: Trajectory, window: Window)", "def speed(trajectory, window)"),
    "the description of a field of robots": Edit("robot.py", "servo gain K_p", "gain K_p of the servo"),
    "the description of a field of evaluations": Edit("evaluation.py", "along the mean course", "on the mean course"),
    "the description of a setting": Edit("learning/settings.py", "actions per second", "control steps per second"),
    "an error message of the engine": Edit("engines/bullet.py", "cannot load the robot", "does not load the robot"),
    "an error message of a policy": Edit("policy.py", "cannot read the policy", "there is no policy"),
    "an error message of the gaits": Edit("controllers.py", "is made for", "was made for"),
    "a label of the rates": Edit("engines/__init__.py", "is unstable for gaits", "is not stable for gaits"),
    "another named fluid": Edit("fluid.py", "FLUIDS: Registry", "_DENSITIES['honey'] = 1400.0\n_VISCOSITIES['honey'] = {15: 1e-2}\nFLUIDS: Registry"),
    "another name of a fluid": Edit("fluid.py", "else f\"{name}@{temperature}\"", "else f\"{name}_{temperature}\""),
    "another name of the robot": Edit("robot.py", '{"paper": Robot()}', '{"hirose": Robot()}'),
    "another kind of a gait": Edit("controllers.py", 'kind: Literal["sea-snake"] = "sea-snake"', 'kind: Literal["eel"] = "eel"'),
    "another gait": Edit("controllers.py", "class Fourier(", "class Still(SeaSnake):\n    pass\n\n\nclass Fourier("),
    "another claim in a report": Edit("report/paper.py", '"""', '"""Of the paper. '),
}  # fmt: skip
ONE_A_FILE = {mutation.file: name for name, mutation in MUTATIONS.items()}  # a file's code has one digest
FORMULAS = {name: Edit(*MUTATIONS[name]) for name in ONE_A_FILE.values()} | {
    "a law of the joints": Edit("physics/joints.py", "law.torque_fall * np.maximum(rate, 0.0)", "law.torque_fall * np.maximum(rate, 0.1)"),
    "where a metric begins": Edit("metrics.py", "_SETTLED = 0.02", "_SETTLED = 0.03"),
    "what is invalid": Edit("evaluation.py", "ENERGY_BOUND = 0.1", "ENERGY_BOUND = 0.2"),
    "how a gait is built": Edit("controllers.py", "i / n_joints * self.amplitude", "i / n_joints * self.amplitude * 1.01"),
    "how targets are held": Edit("simulation.py", "np.clip(target, -1.0, 1.0)", "np.clip(target, -0.9, 0.9)"),
    "what a policy observes": Edit("observation.py", "LARGEST = ", "LARGEST = 0.5 * "),
    "how a policy learns": Edit("learning/ppo.py", "1e-8", "1e-7"),
}  # fmt: skip
SWIMS = {f"{engine} {name}" for engine in ("pybullet", "planar") for name in ("wave", "snake", "policy")}
LEARNED = {"training", "distillation"}
CHANGED = {
    "gravity": SWIMS,
    "where a metric begins": SWIMS,
    "what is invalid": SWIMS,
    "Runge-Kutta weights": {key for key in SWIMS if key.startswith("planar")} | LEARNED,
    "how a gait is built": {"pybullet snake", "planar snake"},
    "how targets are held": SWIMS,
    "what a policy observes": {"pybullet policy", "planar policy"} | LEARNED,
    "how a policy learns": LEARNED,
}


@pytest.fixture(scope="module")
def answers(tmp_path_factory) -> dict[str, dict[str, str]]:
    """The keys after every formula's edit, by its name, and after all wordings'; of the package as it is by ""."""
    root = tmp_path_factory.mktemp("copy")
    shutil.copytree(PACKAGE, root / "snakebench", ignore=shutil.ignore_patterns("__pycache__"))
    edits = {"": [], "wordings": [*WORDINGS.values()]} | {name: [edit] for name, edit in FORMULAS.items()}
    policy = Path(__file__).parents[2] / "results/teacher_student/policies/student-10.safetensors"
    answer = subprocess.run(
        [sys.executable, "-c", KEYS, policy],
        input=json.dumps([[[f"snakebench/{edit.file}", *edit[1:]] for edit in several] for several in edits.values()]),
        env=os.environ | {"PYTHONPATH": str(root)},
        cwd=root,
        capture_output=True,
        text=True,
    )
    assert answer.returncode == 0, answer.stderr
    return dict(zip(edits, json.loads(answer.stdout), strict=True))


def changed(answers: dict[str, dict[str, str]], name: str) -> set[str]:
    return {key for key, value in answers[name].items() if value != answers[""][key]}


def test_wordings_and_names_leave_every_key(answers):
    assert changed(answers, "wordings") == set()


@pytest.mark.parametrize("name", FORMULAS)
def test_formulas_and_constants_change_the_keys_of_all_that_depends_on_them(answers, name):
    assert changed(answers, name) == CHANGED.get(name, SWIMS | LEARNED)


def test_every_swim_and_training_has_a_key_of_its_own(answers):
    assert len(set(answers[""].values())) == len(answers[""])


@cache
def imports(name: str) -> set[str]:
    """The modules of the package that a module imports, as their paths."""
    found = set()
    for node in ast.walk(ast.parse((PACKAGE / name).read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("snakebench"):
            parts = node.module.split(".")[1:]
            found |= {"/".join([*parts, *last]) + ".py" for last in ([], *([alias.name] for alias in node.names))}
    return {path for path in found if (PACKAGE / path).is_file()}


@pytest.mark.parametrize("engine", ["bullet", "planar"])
def test_every_module_that_an_evaluation_imports_is_in_its_key_or_hands_it_numbers(engine):
    keys = (PACKAGE / "execution.py").read_text()
    named = re.findall(r'"(\w+)"', " ".join(re.findall(r"code_digest\((.*?)\)", keys)))
    keyed = {f"{name}.py" for name in named} | {f"engines/{engine}.py"}
    reached, todo = set(), {"evaluation.py", f"engines/{engine}.py"}
    while todo:
        reached.add(name := todo.pop())
        todo |= imports(name) - reached
    handed = {"controllers.py", "fluid.py", "robot.py", "scenario.py"}
    no_number = {f"{name}.py" for name in ("compilation", "errors", "files", "memory", "registry", "sources", "value")}
    assert {name for name in reached - keyed if not name.startswith("physics/")} <= handed | no_number


def test_the_digest_of_a_module_is_that_of_the_physics_it_imports_as_well():
    parts = ["physics.chain", "physics.stepping", "physics.swimmer", "physics.leapfrog"]
    assert len({code_digest(part) for part in parts}) == len(parts)
    assert code_digest("physics.swimmer") == code_digest("physics.swimmer", "physics.leapfrog", "physics.joints")
    assert code_digest("physics.swimmer") != code_digest("physics.swimmer", "physics.chain")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "planar"])
def test_a_changed_force_law_is_compiled_again(tmp_path, engine):
    shutil.copytree(PACKAGE, tmp_path / "snakebench", ignore=shutil.ignore_patterns("__pycache__"))
    law = tmp_path / "snakebench/physics/hydrodynamics.py"
    original = law.read_text()

    def speed() -> float:
        script = f"import snakebench as sb; print(sb.evaluate(sb.SinusoidalTorque(amplitude=3.0, frequency=1.0, phase=0.8), engine={engine!r}, duration=1.0).speed)"
        command = [sys.executable, "-c", script]
        environment = os.environ | {"PYTHONPATH": str(tmp_path)}
        return float(subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, check=True).stdout)

    before = speed()
    law.write_text(original.replace("C_MU = 0.31584", "C_MU = 3.1584"))
    assert speed() < 0.95 * before
    law.write_text(original)
    assert speed() == before
