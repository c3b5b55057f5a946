"""What a notebook sees: names, signatures, docstrings, tables; and which Pythons and packages there may be."""

from __future__ import annotations

import inspect
import json
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pandas as pd
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.manifest import provenance
from snakebench.sources import package_version
from snakebench.version import __version__

GAITS = [sb.SeaSnake(amplitude=a, frequency=1.0, phase=0.7) for a in (0.2, 0.4)]
QUICK = {"engine": "planar", "duration": 1.0}
SETTINGS = {"fluid", "robot", "engine", "physics_rate", "control_rate", "duration", "scenario"}
OIL = sb.named_fluid("oil1")
NO_PYBULLET = "import sys; sys.modules['pybullet'] = None; "
TYPED = """
import numpy as np, snakebench as sb
class Mine(sb.Gait):
    kind: str = "mine"
    height: float
    @property
    def drives(self): return "angle"
    def commands(self, times, n_joints): return self.height * np.sin(4 * times[:, None] - np.arange(n_joints))
table = sb.evaluate_many([Mine(height=0.3)] * 2, "oil1", engine="planar", duration=1.0, workers=1)
print(*table["height"], *table["status"])
"""


def python(script: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-"], input=script, capture_output=True, text=True)


def test_tab_completion_offers_the_public_names():
    assert dir(sb) == sorted(sb.__all__)
    assert sb.__version__ == __version__


@pytest.mark.parametrize("function", [sb.simulate, sb.evaluate, sb.evaluate_many])
def test_the_settings_of_a_run_are_in_the_signature(function):
    parameters = inspect.signature(function).parameters
    assert SETTINGS - {"fluid"} < set(parameters)
    assert not [one for one in parameters.values() if one.kind is one.VAR_KEYWORD]
    assert "Example:" in function.__doc__


@pytest.mark.parametrize(
    "where",
    ["oil1", OIL, sb.FluidField(along="time", knots=(0.0,), fluids=(OIL,)), sb.Scenario(fluid="oil1", **QUICK)],
    ids=["name", "fluid", "field", "scenario"],
)
def test_the_second_argument_is_a_fluid_or_a_scenario(where):
    expected = sb.evaluate(GAITS[0], fluid="oil1", **QUICK)
    assert sb.evaluate(GAITS[0], where, **QUICK) == expected
    assert sb.measure(sb.simulate(GAITS[0], where, **QUICK)) == expected


@pytest.mark.parametrize("twice", [("oil1", {"fluid": "water"}), (sb.Scenario(), {"scenario": sb.Scenario()})])
def test_a_fluid_or_scenario_given_twice_is_refused(twice):
    where, settings = twice
    with pytest.raises(InvalidValue, match="one is allowed"):
        sb.evaluate(GAITS[0], where, **settings)


def test_a_row_has_plain_values():
    row = sb.evaluate(GAITS[0], "oil1", **QUICK).row()
    assert {type(value) for value in row.values()} <= {str, bool, float, type(None)}
    assert row["status"] == "ok" and "return" in row


@pytest.mark.parametrize("workers", [1, 2])
def test_many_evaluations_are_a_table_of_each_gait_in_each_fluid(workers):
    table = sb.evaluate_many(GAITS, ["water", "oil1"], workers=workers, **QUICK)
    rows = [
        {"gait": i, **gait.model_dump(), "fluid": fluid, **sb.evaluate(gait, fluid, **QUICK).row()}
        for i, gait in enumerate(GAITS)
        for fluid in ("water", "oil1")
    ]
    pd.testing.assert_frame_equal(table, pd.DataFrame(rows))


def test_many_evaluations_may_be_of_one_gait_and_of_fluids_by_names_of_ones_own():
    scenario = sb.Scenario(**QUICK)
    table = sb.evaluate_many(GAITS[0], {"mine": sb.Fluid(kinematic_viscosity=1e-3)}, scenario=scenario, workers=1)
    assert table["fluid"].tolist() == ["mine"]
    assert table["speed"].tolist() == [sb.evaluate(GAITS[0], "1e-3", **QUICK).speed]


def test_many_evaluations_may_be_of_a_perturbed_robot_by_several_workers():
    gait, dead = sb.perturbed(GAITS[0], sb.Scenario(**QUICK), sb.Perturbations(dead_joint=3))
    table = sb.evaluate_many(gait, ["water", "oil1"], scenario=dead, workers=2)
    assert table["speed"].tolist() == [sb.evaluate(gait, fluid, scenario=dead).speed for fluid in ("water", "oil1")]


def test_many_evaluations_are_remembered_where_one_says(tmp_path, monkeypatch, evaluated):
    first = sb.evaluate_many(GAITS, "oil1", cache=tmp_path / "results", workers=1, **QUICK)
    assert evaluated(tmp_path) == 2
    monkeypatch.setattr("snakebench.execution.evaluate", lambda *case: pytest.fail("evaluated again"))
    second = sb.evaluate_many(GAITS, "oil1", cache=str(tmp_path / "results"), workers=1, **QUICK)
    pd.testing.assert_frame_equal(first, second)


def test_a_gait_typed_at_a_prompt_is_evaluated():
    assert python(TYPED).stdout == "0.3 0.3 ok ok\n"


@pytest.mark.parametrize(
    ("gaits", "fluids", "complaint"),
    [
        ([], "water", "no gait is given: at least one is needed"),
        (GAITS, [], "no fluid is given: at least one is needed"),
        ([sb.SeaSnake], "water", "a gait with its parameters"),
        (GAITS, ["wine"], "unknown fluid 'wine'"),
        (GAITS, [3], "fluid = 3"),
        (GAITS, 3, "fluid = 3"),
        (3, "water", "controller = 3"),
    ],
)
def test_many_evaluations_of_nothing_or_of_something_else_are_refused(gaits, fluids, complaint):
    with pytest.raises(InvalidValue, match=complaint):
        sb.evaluate_many(gaits, fluids, workers=1, **QUICK)


def test_help_shows_the_fields_with_their_units():
    shown = python("import snakebench as sb; help(sb.Robot)").stdout
    assert "diameter: link diameter [m]; by default 0.1" in shown
    assert "phase: phase difference between adjacent joints psi [rad]" in sb.SeaSnake.__doc__


def test_without_pybullet_the_planar_engine_and_the_list_work():
    swim = "import snakebench as sb; sb.evaluate(sb.SeaSnake(amplitude=0.2, frequency=1.0, phase=0.7), engine='planar')"
    listed = python(f"{NO_PYBULLET}{swim}; sys.argv = ['snakebench', 'list']; from snakebench.cli import main; main()")
    assert listed.returncode == 0 and "pybullet" in listed.stdout


def test_a_missing_pybullet_is_one_line_that_says_what_to_install():
    words = ["simulate", "sea-snake", "--amplitude", "0.2", "--frequency", "1", "--phase", "0.7"]
    done = python(NO_PYBULLET + f"sys.argv = ['snakebench', *{words}]; from snakebench.cli import main; main()")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1 and "PyBullet is not installed: pip install pybullet" in done.stderr


@pytest.mark.parametrize("distribution", ["pybullet", "pybullet-arm64"])
def test_pybullet_is_one_package_whichever_distribution_it_comes_in(distribution, monkeypatch):
    def version(name: str) -> str:
        if name.startswith("pybullet") and name != distribution:
            raise metadata.PackageNotFoundError(name)
        return "3.9.9"

    monkeypatch.setattr(metadata, "version", version)
    assert package_version("pybullet") == "3.9.9"
    assert [name for name in provenance()["versions"] if "pybullet" in name] == ["pybullet"]


def test_an_older_python_is_refused_in_a_sentence():
    refused = python("import sys; sys.version_info = (3, 10, 13, 'final', 0); import snakebench")
    assert refused.stderr.endswith("ImportError: snakebench needs Python 3.11 or later, and this is 3.10.13\n")


@pytest.mark.skipif(shutil.which("python3.10") is None, reason="there is no older Python here")
def test_an_older_python_refuses_the_command_line_in_one_line():
    root = Path(sb.__file__).parents[1]
    command = ["python3.10", "-m", "snakebench.cli", "list"]
    refused = subprocess.run(command, cwd=root, capture_output=True, text=True)
    if "snakebench" not in refused.stderr:
        pytest.skip("python3.10 does not start")
    assert refused.returncode != 0
    assert len(refused.stderr.splitlines()) == 1 and "snakebench needs Python 3.11 or later" in refused.stderr


def test_committed_manifests_load_the_robots_that_they_were_made_with():
    results = Path(__file__).parents[2] / "results"
    configs = [json.loads(path.read_text()).get("config", {}) for path in sorted(results.glob("*/manifest.json"))]
    robots = [config["robot"] for config in configs if "robot" in config]
    assert robots and all(robot.items() <= sb.Robot(**robot).model_dump(mode="json").items() for robot in robots)
    assert sb.Robot(**robots[0]) == sb.Robot()
