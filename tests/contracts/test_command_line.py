"""The command line: what it prints, how it refuses, and how quickly it helps."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from writing import random_policy

import snakebench as sb
from snakebench.engines import PHYSICS_RATES
from snakebench.files import write_file
from snakebench.policy import Card
from snakebench.studies.config import study_names

TORQUE = ("simulate", "sinusoidal-torque", "--amplitude", "3.5", "--frequency", "0.70", "--phase", "0.84")
SEA_SNAKE = ("simulate", "sea-snake", "--amplitude", "0.8", "--frequency", "0.6", "--phase", "0.7")
KEYS = {
    "speed", "path_speed", "power", "positive_power", "cost_of_transport", "positive_cost_of_transport",
    "swim_frequency", "wave_speed", "tail_amplitude", "heading_drift", "return", "steady", "status",
    "command_torque_rms", "command_torque_peak", "joint_speed_peak", "heat",
}  # fmt: skip


def test_a_perturbed_robot_swims_as_in_python(snakebench_command):
    here = sb.Scenario(fluid="oil1", engine="planar", duration=3.0)
    late = sb.Perturbations(normal_drag=1.2, delay=1.0, dead_joint=4)
    expected = sb.evaluate(*sb.perturbed(sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84), here, late))
    words = ("--fluid", "oil1", "--engine", "planar", "--duration", "3", "--json")
    perturbed = ("--perturb", "normal_drag=1.2", "delay=1", "--perturb", "dead_joint=4")
    code, out, _ = snakebench_command(*TORQUE, *words, *perturbed)
    assert code == 0 and json.loads(out)["speed"] == expected.speed


def test_a_perturbed_policy_is_measured_at_its_own_rate_and_shown_with_its_perturbations(snakebench_command, tmp_path):
    random_policy(Card(feels=("joint angle",), mlp=(4,), lstm=(3,))).save(tmp_path / "policy.safetensors")
    words = ("simulate", "policy", "--path", "policy.safetensors", "--engine", "planar", "--duration", "2", "--json")
    nominal, late, noisy = (
        json.loads(snakebench_command(*words, *more)[1])
        for more in (
            (),
            ("--perturb", "delay=1"),
            ("--perturb", "angle_noise=1", "seed=3", "--animate", "swim.html"),
        )
    )
    assert len({swim["power"] for swim in (nominal, late, noisy)}) == 3
    assert late["return"] == pytest.approx(nominal["return"], rel=0.2)  # as many control steps
    assert "angle_noise 1" in (tmp_path / "swim.html").read_text()


def test_json_is_one_object_with_the_evaluators_numbers(snakebench_command):
    expected = sb.evaluate(sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84), duration=5.0)
    code, out, err = snakebench_command(*TORQUE, "--fluid", "water", "--duration", "5", "--json")
    numbers = json.loads(out)
    assert code == 0 and err == "" and out.count("\n") == 1
    assert set(numbers) >= KEYS
    assert numbers["speed"] == expected.speed
    assert numbers["return"] is None


def test_both_currencies_and_what_a_servo_must_stand_are_printed_with_their_units(snakebench_command):
    out = snakebench_command(*TORQUE, "--fluid", "water", "--duration", "3")[1]
    lines = {line.split()[0]: line for line in out.splitlines()}
    units = {"positive_power": "[W]", "positive_cost_of_transport": "[1]", "command_torque_rms": "[N m]"}
    units |= {"command_torque_peak": "[N m]", "joint_speed_peak": "[rad/s]", "heat": "[N^2 m^2]"}
    for name, unit in units.items():
        assert lines[name].endswith(unit)
    assert lines["command_torque_peak"].split()[1] == "3.5"


def test_bounds_stand_beside_speed_and_power_and_large_ones_are_flagged(snakebench_command, tmp_path):
    calm = snakebench_command(*SEA_SNAKE)[1]
    assert re.search(r"^speed .* v along x, signed \[m/s\], within 0\.\d+ %$", calm, flags=re.MULTILINE)
    assert re.search(r"^power .* mean command power P \[W\], within 0\.\d+ %$", calm, flags=re.MULTILINE)
    assert "uncertain" not in calm
    targets = [[(-1.0) ** (i + j) for j in range(7)] for i in range(60)]
    (tmp_path / "gait.json").write_text(json.dumps({"kind": "held-targets", "rate": 30.0, "targets": targets}))
    wild = snakebench_command("simulate", "file", str(tmp_path / "gait.json"), "--duration", "2")[1]
    assert re.search(r"^uncertain: power may be wrong by \d+ %: a higher --physics-rate", wild, flags=re.MULTILINE)


def test_a_sea_snake_has_a_return(snakebench_command):
    _, out, _ = snakebench_command(*SEA_SNAKE, "--fluid", "oil1", "--duration", "5", "--json")
    assert json.loads(out)["return"] > 0


def test_a_fluid_may_be_described(snakebench_command):
    answers = [
        json.loads(snakebench_command(*TORQUE, "--duration", "3", "--json", "--fluid", fluid)[1])
        for fluid in ("oil1", "2.32e-4", "2.32e-4,874")
    ]
    assert answers[0] == answers[1] == answers[2]  # the density rule passes through oil1


def test_robot_and_rate_are_passed_on(snakebench_command):
    options = ("--diameter", "0.0686", "--joints", "5", "--physics-rate", "960", "--duration", "3")
    _, out, _ = snakebench_command(*TORQUE, *options, "--json")
    robot = sb.Robot.with_joints(5, 0.0686)
    gait = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
    assert json.loads(out)["speed"] == sb.evaluate(gait, robot=robot, physics_rate=960, duration=3.0).speed


def test_the_planar_engine_swims_at_its_own_rate_unless_told_otherwise(snakebench_command):
    gait = sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84)
    for options, rate in (((), 240), (("--physics-rate", "120"), 120)):
        _, out, _ = snakebench_command(*TORQUE, "--duration", "3", "--engine", "planar", *options, "--json")
        expected = sb.evaluate(gait, duration=3.0, engine="planar", physics_rate=rate)
        assert json.loads(out)["speed"] == expected.speed


def test_the_run_can_be_saved_and_animated(snakebench_command, tmp_path):
    code, out, _ = snakebench_command(*SEA_SNAKE, "--duration", "2", "--save", "run.npz", "--animate", "swim.html")
    page = (tmp_path / "swim.html").read_text()
    assert code == 0 and "written: run.npz" in out and "written: swim.html" in out
    assert sb.Trajectory.load(tmp_path / "run.npz").time[-1] == pytest.approx(2.0)
    assert page.startswith("<!DOCTYPE html>") and "src=" not in page and "http" not in page


def test_any_gait_can_be_read_from_a_file(snakebench_command, tmp_path):
    i = np.arange(1, 8)
    content = {"kind": "fourier", "frequency": 0.6, "cosine": [list(0.8 * i / 7 * np.sin((7 - i) * 0.7))]}
    content["sine"] = [list(0.8 * i / 7 * np.cos((7 - i) * 0.7))]
    (tmp_path / "gait.json").write_text(json.dumps(content))
    assert snakebench_command("simulate", "file", "gait.json", "--duration", "1", "--animate", "swim.html")[0] == 0
    from_file = json.loads(snakebench_command("simulate", "file", "gait.json", "--duration", "3", "--json")[1])
    direct = json.loads(snakebench_command(*SEA_SNAKE, "--duration", "3", "--json")[1])
    assert from_file["speed"] == pytest.approx(direct["speed"], rel=1e-6)


def test_a_diverged_run_is_an_answer_not_an_error(snakebench_command):
    words = ("simulate", "sinusoidal-torque", "--amplitude", "1e5", "--frequency", "1", "--phase", "1")
    code, out, _ = snakebench_command(*words, "--json")
    assert code == 0
    assert json.loads(out)["status"] == "diverged" and json.loads(out)["speed"] is None


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ((*TORQUE, "--fluid", "watr"), "did you mean water"),
        ((*TORQUE, "--fluid", ""), "unknown fluid ''"),
        ((*TORQUE, "--fluid=-1e-3"), "kinematic_viscosity = -0.001"),
        ((*TORQUE, "--fluid", "nan"), "kinematic_viscosity = nan"),
        ((*TORQUE, "--fluid", "1e-3,0"), "density = 0"),
        ((*TORQUE, "--fluid", "1e-3,900,15"), "VISCOSITY,DENSITY"),
        ((*TORQUE, "--robot", ""), "unknown robot ''"),
        ((*TORQUE, "--robot", "paper", "--joints", "5"), "--robot excludes --joints and --diameter"),
        (("identify", "log.csv", "--save", "robot.txt"), "a name that ends with .json is needed"),
        ((*TORQUE, "--duration", "-3"), "duration = -3"),
        ((*TORQUE, "--duration", "inf"), "duration = inf"),
        ((*TORQUE, "--duration", "1e-9"), "out of range"),
        ((*TORQUE, "--duration", "1e9"), "out of range"),
        ((*TORQUE, "--physics-rate", "0"), "physics_rate = 0"),
        ((*TORQUE, "--physics-rate", "470"), "multiple of control_rate 30"),
        ((*SEA_SNAKE, "--physics-rate", "60"), "at least 85 Hz is needed"),
        ((*SEA_SNAKE, "--joints", "60"), "Hz is needed"),
        ((*TORQUE, "--engine", "bullit"), "did you mean"),
        ((*TORQUE, "--engine", "planar", "--physics-rate", "30"), "at least 45 Hz is needed, such as 60"),
        (("run-study", "quickstart", "--engine", "planr"), "did you mean planar"),
        (("run-study", "validation", "--engine", "planar"), "unknown field 'engine'"),
        (("run-study", "validation", "--profile", "slow"), "allowed are"),
        (("bench", "--threads", "0"), "threads = 0: allowed are 1 to"),
        (("bench", "--threads", "10000"), "threads = 10000: allowed are 1 to"),
        (("bench", "--threads", "many"), "--threads"),
        ((*TORQUE, "--joints", "0"), "allowed are 2 to 63"),
        ((*TORQUE, "--diameter", "0"), "diameter = 0"),
        ((*TORQUE, "--save", "nowhere/run.npz", "--duration", "1"), "cannot write nowhere/run.npz"),
        ((*TORQUE, "--save", "/dev/null", "--duration", "1"), "not a regular file"),
        ((*TORQUE, "--save", "", "--duration", "1"), "not a regular file"),
        ((*TORQUE, "--save", "kept.npz", "--animate", "nowhere/swim.html", "--duration", "1"), "nowhere"),
        ((*TORQUE, "--save", "swim.html", "--animate", "swim.html", "--duration", "1"), "are the same file"),
        ((*TORQUE, "--diameter", "1e200"), "diameter = 1e+200"),
        ((*TORQUE, "--physics-rate", "99999999999999999990"), "out of range"),
        ((*TORQUE, "--animate", "nowhere/swim.html", "--duration", "1"), "cannot write"),
        ((*TORQUE, "--colour", "red"), "--colour"),
        (("simulate", "sea-snake", "--amplitude", "1", "--frequency", "-1", "--phase", "1"), "frequency = -1"),
        (("simulate", "sea-snake", "--amplitude", "1"), "--frequency"),
        (("simulate", "sea-cow"), "sea-cow"),
        ((*SEA_SNAKE, "--perturb", "delay"), "--perturb delay: NAME=VALUE is needed, such as delay=1"),
        ((*SEA_SNAKE, "--perturb", "delay=long"), "--perturb delay=long: NAME=VALUE is needed"),
        ((*SEA_SNAKE, "--perturb", "dead_joint=1.5"), "such as dead_joint=4, a whole number"),
        ((*SEA_SNAKE, "--perturb", "delay=1", "delay=2"), "--perturb delay=2: delay is given twice"),
        ((*SEA_SNAKE, "--perturb", "mass=1.1", "rate_noise=1"), "--perturb rate_noise: it has no effect"),
        ((*SEA_SNAKE, "--perturb", "mass=1.1", "delay=1", "--log", "log.csv"), "--log: a log does not show delay"),
        ((*TORQUE, "--perturb", "joint_offset=0.01"), "--perturb joint_offset: it has no effect"),
        ((*SEA_SNAKE, "--perturb", "dealy=1"), "did you mean delay"),
        ((*SEA_SNAKE, "--perturb", "seed=5"), "--perturb seed: it has no effect"),
        ((*SEA_SNAKE, "--perturb", "dead_joint=8"), "the robot has 7 joints"),
        (("simulate", "file", "missing.json"), "cannot read the gait"),
        (("run-study", "sea_snak"), "did you mean sea_snake"),
        (("run-study", "quickstart", "--profile", "smok"), "did you mean smoke"),
        (("run-study", "quickstart", "--workers", "0"), "workers = 0"),
        (("run-study", "quickstart", "--seeds", "1", "1"), "differ from each other"),
        (("run-study", "quickstart", "--seeds", "-1"), "seeds"),
        (("run-study", "quickstart", "--seeds", "99999999999"), "seeds"),
        (("run-study", "x" * 300), "unknown study"),
        (("pareto", "--fluids"), "fluids = []: one fluid or more is needed"),
        (("pareto", "--fluids", "watr"), "did you mean water"),
        (("pareto", "--fluids", "water", "water"), "values must differ"),
        (("pareto", "--fluids", "water", "0,900"), "kinematic_viscosity = 0"),
        (("pareto", "--fluids", "1e-3,900,5"), "unknown fluid '1e-3,900,5'"),
        (("pareto", "--grid", "0", "3", "3"), "grid.0 = 0"),
        (("pareto", "--grid", "3", "3"), "grid = [3, 3]: sinusoidal-torque has 3 parameters"),
        (("pareto", "--method", "random"), "--method"),
        (("pareto", "--name", "sea_snake"), "name = sea_snake: a study of the library is called so"),
        (("pareto", "--name", "../out"), "name"),
        (("pareto", "--method", "both", "--population", "0"), "population = 0"),
        (("pareto", "--method", "both", "--generations", "-1"), "generations = -1"),
        (("pareto", "--population", "9"), "--population: with --method grid it has no effect"),
        (("pareto", "--method", "nsga2", "--grid", "3", "3", "3"), "--grid: with --method nsga2 it has no effect"),
        (("pareto", "--engine", "planr"), "did you mean planar"),
        (("pareto", "--verify", "bullet"), "did you mean pybullet"),
        (("pareto", "--method", "both", "--seeds", "1", "1"), "differ from each other"),
        (("pareto", "--workers", "0"), "workers = 0"),
        (("pareto", "--grid", "3", "2.5", "3"), "--grid: 3 2.5 3: whole numbers are needed"),
        ((*TORQUE, "--joints", "6.6"), "--joints: 6.6: whole numbers are needed"),
        (("run-study", "quickstart", "--seeds", "1.5"), "--seeds: 1.5: whole numbers are needed"),
        (("pareto", "--profile", "fast"), "allowed are"),
        (("report", "--results", "nowhere"), "holds no results"),
        (("report", "--results", ".", "--leaderboard", "nowhere"), "nowhere is no leaderboard"),
        (("reproduce", "--profile", "fast"), "validation: unknown profile of validation.toml 'fast': allowed are"),
        (("reproduce", "--workers", "0"), "workers = 0"),
        (("swim",), "swim"),
    ],
)
def test_bad_input_gets_one_clear_line_and_exit_code_2(snakebench_command, tmp_path, words, complaint):
    code, out, err = snakebench_command(*words)
    assert code == 2 and out == ""
    assert complaint in err
    assert err.startswith("snakebench: ") and err.count("\n") == 1 and "Traceback" not in err
    assert not [path for path in tmp_path.rglob("*") if path.suffix in {".npz", ".html", ".csv"}]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\ntrails = 3", "unknown field 'trails'"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'tea_snake'", "did you mean sea_snake"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\ntrials = 'many'", "trials = 'many'"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nfluids = ['watr']", "did you mean water"),
        (
            "profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nfluids = ['water', 'water']",
            "differ from each other",
        ),
        (
            "profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nspace = {width = [0, 1]}",
            "unknown parameter 'width'",
        ),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nspace = {phase = [1, 0]}", "below the second"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nduration = -1", "duration = -1"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\ntrials = '2'", "trials = '2'"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nseeds = [false]", "seeds.0 = False"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nduration = '1'", "duration = '1'"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nname = '../../evil'", "name = '../../evil'"),
        ("profile = 'quick'\n[profiles.quick]\nmethod = 'sea_snake'\nspace = {phase = [-1e308, 1e308]}", "space"),
        ("profile = ['a']\n[profiles.quick]\nmethod = 'sea_snake'", "unknown profile"),
        ("profiles = 3", "profiles must be tables"),
        ("profile = [", "cannot read the study"),
        ("", "mine: method is missing: allowed are adaptation"),
    ],
)
def test_a_bad_study_file_gets_one_clear_line(snakebench_command, tmp_path, text, complaint):
    base = "question = 'q'\nfluids = ['water']\ntrials = 2\nseeds = [0]\n" if "[profiles" in text else ""
    keys = {line.split(" = ")[0] for line in text.splitlines()}
    kept = "".join(line + "\n" for line in base.splitlines() if line.split(" = ")[0] not in keys)
    (tmp_path / "mine.toml").write_text(kept + text)
    code, out, err = snakebench_command("run-study", "mine.toml")
    assert (code, out) == (2, "") and complaint in err and err.count("\n") == 1
    assert not (tmp_path / "reports").exists()


def test_results_that_cannot_be_written_are_refused(snakebench_command, tmp_path):
    (tmp_path / "results").write_text("a file in the way")
    code, _, err = snakebench_command("run-study", "quickstart", "--profile", "smoke")
    assert code == 2 and "cannot write to the directory" in err
    assert (tmp_path / "results").read_text() == "a file in the way"


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("[]", "gait.json is no gait: a JSON object"),
        ("3", "gait.json is no gait: a JSON object"),
        ("{}", "a gait needs a kind: sea-snake"),
        ('{"kind": "eel"}', "unknown gait 'eel'"),
        ('{"kind": "sea-snake", "self": 1}', "unknown field 'self'"),
        ('{"kind": "sea-snake", "amplitude": true}', "amplitude = True"),
    ],
)
def test_what_is_no_gait_gets_one_clear_line(snakebench_command, tmp_path, content, complaint):
    (tmp_path / "gait.json").write_text(content)
    code, out, err = snakebench_command("simulate", "file", "gait.json")
    assert (code, out) == (2, "") and complaint in err and err.count("\n") == 1


def test_a_reader_that_leaves_early_is_no_error():
    command = f"{sys.executable} -m snakebench.cli list | head -1"
    answer = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
    assert (answer.stdout, answer.stderr) == ("studies\n", "")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_gone_before_is_no_error_and_a_full_disk_is_told_in_a_line(unbuffered):
    def bash(line: str) -> subprocess.CompletedProcess[str]:
        environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
        return subprocess.run(["bash", "-c", line], capture_output=True, text=True, env=environment)

    command = f"{sys.executable} -m snakebench.cli list"
    gone = bash(f"set -o pipefail; (sleep 1; {command}) | true")
    assert (gone.returncode, gone.stderr) == (0, "")
    full = bash(f"{command} > /dev/full")
    assert full.returncode == 2
    assert full.stderr == "snakebench: cannot go on: No space left on device\n"


def test_a_command_ends_well_without_an_output(tmp_path):
    command = [sys.executable, "-m", "snakebench.cli", "list"]
    done = subprocess.run(["sh", "-c", '"$@" >&-', "sh", *command], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_nothing_is_listed_before_a_plug_in_is_refused(tmp_path):
    where = {**os.environ, "SNAKEBENCH_PLUGINS": "nothere.py"}
    command = [sys.executable, "-m", "snakebench.cli", "list"]
    done = subprocess.run(command, cwd=tmp_path, env=where, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_the_longest_name_can_be_written(tmp_path):
    write_file(tmp_path / ("a" * 250 + ".html"), "text")
    assert [len(path.name) for path in tmp_path.iterdir()] == [255]


def test_a_file_called_as_a_study_of_the_library_does_not_take_its_place(snakebench_command, tmp_path):
    text = (Path(__file__).parents[2] / "studies" / "quickstart.toml").read_text()
    (tmp_path / "sea_snake.toml").write_text(text)
    code, out, err = snakebench_command("run-study", "sea_snake.toml", "--profile", "smoke")
    assert (code, out) == (2, "") and err.count("\n") == 1
    assert "name = sea_snake-smoke: a study of the library is called so: give another name" in err


def test_pareto_prints_its_fronts_and_what_the_reference_loses(snakebench_command, tmp_path):
    words = ("pareto", "--profile", "smoke", "--fluids", "oil2", "--grid", "2", "3", "2", "--workers", "1")
    code, out, err = snakebench_command(*words)
    assert code == 0 and "Traceback" not in err
    assert (tmp_path / "reports" / "pareto-smoke-fluids-oil2-grid-2-3-2.html").exists()
    assert snakebench_command(*words, "--name", "mine")[0] == 0
    assert (tmp_path / "reports" / "mine.html").exists() and (tmp_path / "results" / "mine" / "fronts.csv").exists()
    assert "sinusoid, oil2" in out and "hypervolume" in out
    assert "note: wider sinusoid, oil2" in out and "beyond the reference (0 m/s, 30 W)" in out


def test_list_names_everything(snakebench_command):
    code, out, _ = snakebench_command("list")
    listed = {line[1:].split()[0] for line in out.splitlines() if line.startswith((" ", "+"))}
    assert code == 0 and "profiles: full, quick, smoke" in out
    assert listed >= {*study_names(), *sb.FLUIDS, *sb.GAITS, *sb.ROBOTS, *sb.SAMPLERS, *PHYSICS_RATES}


COMMANDS = (
    *("", "simulate", "simulate file", "simulate policy", "simulate sea-snake", "simulate sinusoidal-torque"),
    *("run-study", "pareto", "reproduce", "report", "score", "leaderboard", "limit", "identify", "play", "bench"),
    *("export", "list"),
)


@pytest.mark.parametrize("words", COMMANDS)
def test_every_command_has_help_with_an_example(snakebench_command, words):
    code, out, _ = snakebench_command(*words.split(), "--help")
    assert code == 0
    assert "Example" in out and "snakebench" in out


def test_help_loads_nothing_heavy():
    script = """import sys
sys.argv = ["snakebench", "--help"]
from snakebench.cli import main
try: main()
finally: print(*sys.modules)"""
    loaded = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "pybullet", "numba", "scipy", "pandas", "optuna", "seaborn", "pydantic"} & set(loaded)


@pytest.fixture
def policy(tmp_path):
    """A random policy; beside it one with a dial, and a slow one."""
    dial = Card(feels=("sensors", "preference"), prices=(0.02, 2.0))
    cards = {"dial": dial, "slow": Card(control_rate=15), "policy": Card()}
    for name, card in cards.items():
        path = tmp_path / f"{name}.safetensors"
        random_policy(card).save(path)
    return path


def test_a_policy_swims_like_any_gait(snakebench_command, policy):
    words = ("simulate", "policy", "--path", str(policy), "--fluid", "oil2", "--duration", "2")
    expected = sb.evaluate(sb.Policy.load(policy), fluid="oil2", duration=2.0)
    code, out, err = snakebench_command(*words, "--json", "--animate", "swim.html")
    assert code == 0 and err == ""
    assert json.loads(out)["return"] == expected.episode_return
    assert "policy in oil2" in (policy.parent / "swim.html").read_text()


def test_a_policy_swims_at_its_own_control_rate(snakebench_command, policy):
    words = ("simulate", "policy", "--path", "slow.safetensors", "--duration", "2", "--json")
    slow = sb.Policy.load(policy.parent / "slow.safetensors")
    expected = sb.evaluate(slow, fluid="water", duration=2.0, control_rate=15)
    assert json.loads(snakebench_command(*words)[1])["power"] == expected.power


def test_the_preference_sets_the_price_of_power(snakebench_command, policy):
    words = ("simulate", "policy", "--path", "dial.safetensors", "--duration", "2", "--json")
    numbers = {price: json.loads(snakebench_command(*words, *price)[1]) for price in ((), ("--preference", "0.5"))}
    dial = sb.Policy.load(policy.parent / "dial.safetensors")
    for price, expected in (((), dial.at(0.02)), (("--preference", "0.5"), dial.at(0.5))):
        assert numbers[price]["power"] == sb.evaluate(expected, fluid="water", duration=2.0).power
    assert len({found["power"] for found in numbers.values()}) == 2


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (
            ("simulate", "policy", "--path", "dial.safetensors", "--preference", "3"),
            "preference = 3: the policy was trained from 0.02 to 2 1/W",
        ),
        (("simulate", "policy", "--path", "dial.safetensors", "--preference", "nan"), "preference = nan"),
        (("simulate", "policy", "--path", "dial.safetensors", "--preference", "low"), "--preference"),
        (
            ("simulate", "policy", "--path", "policy.safetensors", "--preference", "0.1"),
            "preference = 0.1: this policy is not preference-conditioned",
        ),
        (("simulate", "policy", "--path", "none.safetensors"), "cannot read the policy none.safetensors: No such file"),
        (("simulate", "policy", "--path", "text"), "text is damaged or no policy of snakebench"),
        (("simulate", "policy", "--path", "policy.safetensors", "--joints", "5"), "made for 7 joints at 30 Hz"),
        (("export", "text", "model.onnx"), "text is damaged or no policy"),
        (("export", "text", "policy.h"), "text is damaged or no policy"),
        (("export", "policy.safetensors", "no/such/model.onnx"), "cannot write no/such/model.onnx"),
        (("export", "policy.safetensors", "policy.pt"), "policy.pt ends in .pt: .onnx or .h is needed"),
        (("export", "policy.safetensors", "policy"), "policy ends in nothing: .onnx or .h is needed"),
        (
            ("export", "dial.safetensors", "policy.h", "--preference", "3"),
            "preference = 3: the policy was trained from 0.02 to 2 1/W",
        ),
        (
            ("export", "policy.safetensors", "policy.onnx", "--preference", "0.1"),
            "preference = 0.1: this policy is not preference-conditioned",
        ),
    ],
)
def test_a_policy_that_does_not_fit_is_refused_in_a_line(snakebench_command, policy, words, match):
    (policy.parent / "text").write_text("no policy")
    before = set(policy.parent.iterdir())
    code, out, err = snakebench_command(*words)
    assert (code, out) == (2, "")
    assert match in err and err.count("\n") == 1
    assert set(policy.parent.iterdir()) == before


@pytest.mark.parametrize("words", [(*SEA_SNAKE, "--duration", "1"), ("limit", "--fluid", "water", "--power", "5")])
def test_the_file_of_the_robot_is_not_written_over(snakebench_command, tmp_path, words):
    (tmp_path / "mine.json").write_text('{"diameter": 0.08}')
    code, out, err = snakebench_command(*words, "--robot", "mine.json", "--save", "mine.json")
    assert (code, out, err.count("\n")) == (2, "", 1) and "it is read as an input" in err
    assert (tmp_path / "mine.json").read_text() == '{"diameter": 0.08}'
