"""A gait, a robot, a fluid, a metric and a search from outside the package are used like its own."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "cpg.py"
GAIT = {"kind": "cpg", "amplitude": 0.8, "frequency": 0.7, "phase": 0.8}
STUDY = """
question = "How fast is a pattern generator?"
fluids = ["water", "honey"]
duration = 3.0
seeds = [0]
"""
FRONTS = """
method = "pareto"
gait = "cpg"
robot = "short"
engine = "planar"
physics_rate = 120
grid = [2, 2, 2]
periods = 1
"""
CROSS = 'method = "cross"\nrobot = "short"\n[contenders]\ngaits = ["fronts"]\n' + "\n".join(
    f'{name} = ""' for name in ("policies", "sinusoids", "sea_snakes", "waveforms")
)
SEARCH = """
method = "sea_snake"
engine = "planar"
physics_rate = 120
trials = 2
compared = ["halton"]
"""


def run(directory: Path, *words: str, plugins: Path | str = EXAMPLE, **variables: str) -> tuple[int, str, str]:
    """Run Python, or the command line in it, where the plug-ins are: exit code, standard output and error."""
    command = [sys.executable, *(words if words[0] == "-c" else ("-m", "snakebench.cli", *words))]
    environment = os.environ | {"SNAKEBENCH_PLUGINS": str(plugins)} | variables
    done = subprocess.run(command, cwd=directory, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def test_what_a_plug_in_registers_is_listed_with_a_plus(tmp_path):
    _, listed, _ = run(tmp_path, "list")
    assert [line.split()[1] for line in listed.splitlines() if line.startswith("+")] == [
        *("honey", "cpg", "short", "halton", "mean_curvature")
    ]


@pytest.mark.parametrize("robot", ["paper", "short"])
def test_a_gait_of_a_plug_in_swims_with_seven_joints_and_four_and_its_metric_is_measured(tmp_path, robot):
    (tmp_path / "gait.json").write_text(json.dumps(GAIT))
    code, printed, error = run(tmp_path, *f"simulate file gait.json --robot {robot} --duration 6 --json".split())
    assert code == 0, error
    evaluation = json.loads(printed)
    assert evaluation["speed"] > 0.05 and evaluation["mean_curvature"] > 0.1


def test_oscillators_agree_on_the_phase_that_they_are_told(tmp_path):
    script = """
import numpy as np, snakebench as sb
gait = sb.GAITS["cpg"](amplitude=0.8, frequency=0.7, phase=0.8)
for joints in (4, 7):
    times = 20 + np.arange(200) / 200 / 0.7
    found = gait.commands(np.concatenate([np.arange(0, 20, 0.1), times]), joints)[-200:]
    waves = np.exp(-2j * np.pi * np.arange(200) / 200) @ found / 100
    assert np.allclose(np.abs(waves), 0.8 * np.arange(1, joints + 1) / joints, rtol=1e-3)
    assert np.allclose(np.angle(waves[1:] / waves[:-1]), -0.8, atol=1e-3)
"""
    code, _, error = run(tmp_path, "-c", script)
    assert code == 0, error


@pytest.mark.slow
def test_a_gait_of_a_plug_in_has_fronts_and_joins_the_cross_study_and_the_reports(tmp_path):
    for name, rest in {"fronts": FRONTS, "cross_cpg": CROSS}.items():
        (tmp_path / f"{name}.toml").write_text(STUDY + rest)
        code, _, error = run(tmp_path, "run-study", f"{name}.toml")
        assert code == 0, error
    matrix = pd.read_csv(tmp_path / "results" / "cross_cpg" / "matrix.csv")
    assert set(matrix["method"]) == {"cpg"} and set(matrix["fluid"]) == {"water", "honey"}
    assert {"open", "closed"} == set(matrix["loop"]) and matrix["mean_curvature"].notna().any()
    manifest = json.loads((tmp_path / "results" / "cross_cpg" / "manifest.json").read_text())
    assert list(manifest["plugins"]) == [str(EXAMPLE)] and len(manifest["plugins"][str(EXAMPLE)]) == 16
    code, _, error = run(tmp_path, "report", plugins="")  # of what is stored: the plug-in is not needed
    assert code == 0, error
    pages = {path.stem: path.read_text() for path in (tmp_path / "reports").glob("*.html")}
    assert pages.keys() == {"index", "fronts", "cross_cpg"}
    assert "fronts.html" in pages["index"] and "cpg, honey" in pages["fronts"] and "honey" in pages["cross_cpg"]
    assert "Not the paper" in pages["fronts"] and "Actions of policies" not in pages["fronts"]
    assert "mean_curvature" in pages["cross_cpg"]
    own = re.sub(
        "<summary>Terms and symbols.*?</details>", "", pages["cross_cpg"].partition("What was assumed")[0], flags=re.S
    )
    assert "Markers" not in pages["fronts"] and "policy" not in own


@pytest.mark.slow
def test_a_search_of_a_plug_in_is_compared(tmp_path):
    (tmp_path / "search.toml").write_text(STUDY + SEARCH)
    code, _, error = run(tmp_path, "run-study", "search.toml")
    assert code == 0, error
    assert set(pd.read_csv(tmp_path / "results" / "search" / "samplers.csv")["sampler"]) == {"halton"}


@pytest.mark.slow
def test_the_code_of_a_plug_in_is_part_of_the_key_of_its_evaluations_and_its_comments_are_not(tmp_path):
    script = "import snakebench as sb; from snakebench.execution import evaluation_key"
    keys = []
    code, comment, term = EXAMPLE.read_text(), "# of the phase lag between neighbours", "self.coupling * coupling"
    assert comment in code and term in code
    for k, variant in enumerate([code, code.replace(comment, "# reworded"), code.replace(term, "2 * coupling")]):
        (tmp_path / f"cpg{k}.py").write_text(variant)
        ask = (
            f"{script}; print(evaluation_key(sb.GAITS['cpg'](amplitude=0.8, frequency=0.7, phase=0.8), sb.Scenario()))"
        )
        keys.append(run(tmp_path, "-c", ask, plugins=tmp_path / f"cpg{k}.py")[1])
    assert keys[0] == keys[1] != keys[2] and len(keys[0]) == 65


def test_an_installed_plug_in_is_found_by_its_entry_point(tmp_path):
    shutil.copy(EXAMPLE, tmp_path / "installed_cpg.py")
    about = tmp_path / "demo-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: demo\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[snakebench]\ncpg = installed_cpg\n")
    _, listed, error = run(tmp_path, "list", plugins="", PYTHONPATH=f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    assert "+ cpg" in listed, error


@pytest.mark.parametrize(
    ("code", "complaint"),
    [
        ("1 / 0", "cannot load the plug-in mine.py: ZeroDivisionError"),
        (
            "import snakebench as sb\nsb.FLUIDS['water'] = sb.Fluid(kinematic_viscosity=1e-5)",
            "'water' is there already",
        ),
        ("import snakebench as sb\nsb.METRICS['speed'] = len", "metric 'speed': there is a column of that name"),
        (None, "no such file"),
    ],
)
def test_a_plug_in_that_cannot_be_loaded_is_refused_in_a_line(tmp_path, code, complaint):
    if code is not None:
        (tmp_path / "mine.py").write_text(code)
    status, _, error = run(tmp_path, "list", plugins="mine.py")
    assert status == 2 and complaint in error and error.count("\n") == 1 and "Traceback" not in error


def test_where_no_plug_in_is_loaded_an_unknown_gait_reminds_of_them(tmp_path):
    (tmp_path / "gait.json").write_text(json.dumps(GAIT))
    status, _, error = run(tmp_path, "simulate", "file", "gait.json", plugins="")
    assert status == 2 and "unknown gait 'cpg'" in error and "SNAKEBENCH_PLUGINS" in error


def test_a_file_called_like_another_module_is_refused(tmp_path):
    (tmp_path / "mine").mkdir()
    shutil.copy(EXAMPLE, tmp_path / "mine" / "json.py")
    status, _, error = run(tmp_path, "list", plugins="mine/json.py")
    assert status == 2 and "another module is called json" in error
