"""Identification: known robots are found again from noisy logs, within intervals that mean what they say."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.cli.identify import Fitted
from snakebench.errors import InvalidValue
from snakebench.identification.fit import FITTABLE, FITTED, identify
from snakebench.identification.log import read_log, write_log
from snakebench.identification.replay import Replay

GAITS = {
    "torque": sb.SinusoidalTorque(amplitude=3.5, frequency=0.70, phase=0.84),
    "target": sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7),
}
NOMINAL = sb.Perturbations()
NOISE = {"joint_angle": 0.005, "head_rate": 0.02, "head": 0.005}  # rad, rad/s, m


def write_swim(path: Path, gait, robot, rng=None, duration=6.0, rows=60, drag=NOMINAL, **where) -> Path:
    """A log of a simulated swim, with noise, from an engine with finer steps than the replay's."""
    where = {"engine": "planar", "physics_rate": 960} | where
    swim = sb.simulate(*sb.perturbed(gait, sb.Scenario(robot=robot, duration=duration, **where), drag))
    swim = swim.thinned(where["physics_rate"] // rows)
    if rng is not None:
        noisy = {name: getattr(swim, name) for name in NOISE}
        swim = replace(swim, **{name: x + NOISE[name] * rng.standard_normal(x.shape) for name, x in noisy.items()})
    write_log(path, swim)
    return path


def random_robot(rng) -> sb.Robot:
    return sb.Robot(
        diameter=rng.uniform(0.07, 0.14), joint_stiffness=rng.uniform(3.5, 9.0), joint_damping=rng.uniform(0.002, 0.05)
    )


def errors(seeds, directory: Path, factors=()) -> np.ndarray:
    """Of robots drawn by seeds, with such factors of the drag, the errors in units of half the intervals."""
    found_errors = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        robot, fluid = random_robot(rng), ("water", "oil1", "oil2")[seed % 3]
        drag = sb.Perturbations(**{name: rng.uniform(0.8, 1.2) for name in factors})
        swum = {"drag": drag, "fluid": fluid}
        paths = [write_swim(directory / f"{name}.csv", gait, robot, rng, **swum) for name, gait in GAITS.items()]
        logs = [read_log(path) for path in paths]
        found = identify(logs, sb.named_fluid(fluid), sb.Robot(), [*FITTED, *factors])
        assert found.remarks == [] and set(found.noise) == {"angle", "gyro", "position"}
        assert found.noise["angle"] == pytest.approx(NOISE["joint_angle"], rel=0.05)
        for p in found.parameters:
            true = getattr(drag if p.name in factors else robot, p.name)
            assert (p.high - p.low) / 2 < (0.7 if p.name == "pressure_drag" else 0.25) * true
            found_errors.append(2 * (p.value - true) / (p.high - p.low))
            print(seed, p.name, true, p.value, found_errors[-1])
    return np.array(found_errors)


def check_coverage(found_errors: np.ndarray, fewest: int) -> None:
    """At least so many intervals of 95 % contain the true value, and they are no wider than they must be."""
    inside, spread = int((np.abs(found_errors) <= 1).sum()), 1.96 * float(np.sqrt(np.mean(found_errors**2)))
    print(f"{inside} of {len(found_errors)} intervals contain the true value; errors are {spread:.2f} standard ones")
    assert inside >= fewest and 0.75 < spread < 1.3


@pytest.mark.slow
def test_a_robot_and_a_factor_of_its_drag_are_found_within_their_intervals(tmp_path):
    assert (np.abs(errors([0], tmp_path, ["normal_drag"])) <= 1).sum() >= 3


@pytest.mark.slow
def test_intervals_of_twenty_random_robots_cover_about_95_percent(tmp_path):
    check_coverage(errors(range(20), tmp_path), 53)  # of 60; fewer than 53 have a chance of 1 %


@pytest.mark.slow
def test_intervals_of_twenty_random_robots_cover_their_factors_of_drag_too(tmp_path):
    of_120 = errors(range(20), tmp_path, ["pressure_drag", "viscous_drag", "normal_drag"])
    check_coverage(of_120, 108)  # fewer than 108 have a chance of 1 %


@pytest.mark.slow
def test_a_robot_that_swam_in_the_other_engine_is_found(tmp_path):
    robot = sb.Robot(diameter=0.08, joint_stiffness=7.0, joint_damping=0.02)
    pybullet = {"engine": "pybullet", "physics_rate": 1920, "fluid": "oil1"}
    logs = [read_log(write_swim(tmp_path / f"{name}.csv", gait, robot, **pybullet)) for name, gait in GAITS.items()]
    found = identify(logs, sb.named_fluid("oil1"), sb.Robot()).robot
    for name in ("diameter", "joint_stiffness", "joint_damping"):
        assert getattr(found, name) == pytest.approx(getattr(robot, name), rel=0.005)


def test_servo_gains_are_found_from_target_angles(tmp_path):
    robot = sb.Robot(proportional_gain=5.0, derivative_gain=0.2)
    log = read_log(write_swim(tmp_path / "log.csv", GAITS["target"], robot, np.random.default_rng(0)))
    found = identify([log], sb.named_fluid("water"), sb.Robot(), ["proportional_gain", "derivative_gain"])
    for p in found.parameters:
        assert p.low < getattr(robot, p.name) < p.high < 1.05 * p.value


def write_held(path: Path, robot: sb.Robot) -> Path:
    """A log of commands that are held from row to row."""
    targets = 0.5 * np.random.default_rng(0).uniform(-1, 1, (90, 7))
    gait = sb.HeldTargets(rate=30.0, targets=tuple(map(tuple, targets.tolist())))
    return write_swim(path, gait, robot, duration=3.0, rows=30)


def test_held_commands_are_replayed_as_held(tmp_path):
    log = read_log(write_held(tmp_path / "log.csv", sb.Robot()))
    misses = []
    for hold in (True, False):
        replay = Replay(log, sb.named_fluid("water"), hold, [sb.Robot()])
        (signals,) = replay([sb.Robot()], np.zeros((1, 17)))
        misses.append(np.sqrt(np.mean((signals.angle[1:] - log.joint_angle[1:]) ** 2)))
    assert misses[0] < 1e-3 and misses[1] > 1e-2


def test_start_frame_and_gyro_may_be_anywhere(tmp_path):
    """A log from the midst of a swim, with the gyro in link 3 and the centre of mass in a turned, shifted frame."""
    robot, rng, turn = sb.Robot(diameter=0.08), np.random.default_rng(1), 2.0
    swim = sb.simulate(GAITS["target"], robot=robot, engine="planar", physics_rate=960, duration=8.0).thinned(16)
    write_log(tmp_path / "log.csv", swim)
    table = pd.read_csv(tmp_path / "log.csv").iloc[187:].drop(columns=["gyro_1", "head_x", "head_y"])
    links = np.unwrap(swim.links[:, 2, 2])
    center = swim.center @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]] + [3.0, -1.0]
    table["gyro_3"] = np.gradient(links, swim.time)[187:]
    table["center_x"], table["center_y"] = center[187:].T
    noise = {column: 0.005 for column in table if column.startswith(("angle", "center"))} | {"gyro_3": 0.02}
    for column, size in noise.items():
        table[column] += size * rng.standard_normal(len(table))
    table.to_csv(tmp_path / "log.csv", index=False)
    found = identify([read_log(tmp_path / "log.csv")], sb.named_fluid("water"), sb.Robot())
    assert found.parameters[0].low < 0.08 < found.parameters[0].high
    assert found.noise == pytest.approx({"angle": 0.005, "gyro": 0.02, "position": 0.005}, rel=0.1)


@pytest.mark.slow
def test_a_model_that_does_not_explain_the_log_is_said(tmp_path):
    log = read_log(write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot(masses=(0.6,) * 8)))
    (remark,) = [r for r in identify([log], sb.named_fluid("water"), sb.Robot()).remarks if "angle" in r]
    assert "intervals are too narrow" in remark


@pytest.mark.parametrize("ending", ["csv.gz", "zip", "xz"])
def test_a_compressed_log_is_refused_in_a_line(tmp_path, ending):
    path = write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot(), duration=3.0).rename(
        tmp_path / f"log.{ending}"
    )
    path.write_bytes(gzip.compress(path.read_bytes())[:-20])
    with pytest.raises(InvalidValue, match="cannot read the log"):
        read_log(path)


def test_a_log_that_is_too_long_is_refused_and_not_cut(tmp_path, monkeypatch):
    path = write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot(), duration=3.0)
    monkeypatch.setattr("snakebench.identification.log._LONGEST", 50)
    with pytest.raises(InvalidValue, match="more than 50 rows"):
        read_log(path)


def test_the_time_of_a_long_log_is_exact(tmp_path):
    swim = sb.simulate(GAITS["torque"], engine="planar", duration=1.0)
    names = ("robot", "drives", "joint_angle", "head_rate", "command", "head")
    late = SimpleNamespace(time=swim.time + 5000.0, **{name: getattr(swim, name) for name in names})
    write_log(tmp_path / "log.csv", late)
    steps = np.diff(pd.read_csv(tmp_path / "log.csv")["time"])
    assert steps == pytest.approx(np.diff(swim.time), rel=1e-3)


def test_a_value_beyond_the_search_is_said(tmp_path):
    log = read_log(write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot(joint_damping=0.4), duration=3.0))
    remarks = identify([log], sb.named_fluid("water"), sb.Robot(), ["joint_damping"]).remarks
    assert "joint_damping ends at the bound of the search" in remarks


def test_the_command_fits_what_can_be_fitted():
    assert get_args(Fitted) == FITTABLE


@pytest.mark.parametrize(
    ("names", "complaint"), [(["girth"], "unknown parameter 'girth'"), ([], "at least one of both")]
)
def test_unknown_parameters_are_refused(names, complaint):
    with pytest.raises(InvalidValue, match=complaint):
        identify([], sb.named_fluid("water"), sb.Robot(), names)


def test_a_factor_at_its_bound_is_said(tmp_path):
    most = sb.Perturbations(normal_drag=10.0)
    log = read_log(write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot(), duration=3.0, drag=most))
    found = identify([log], sb.named_fluid("water"), sb.Robot(), ["normal_drag"])
    assert "normal_drag ends at the bound of the search" in found.remarks
    assert found.drag.normal_drag == pytest.approx(10.0, rel=1e-3)


def test_factors_that_the_logs_cannot_tell_apart_are_not_determined(tmp_path):
    robot = sb.Robot(lengths=(0.3, 0.3), masses=(1.0, 1.0))  # the drag across two links has two factors
    log = read_log(write_swim(tmp_path / "log.csv", GAITS["torque"], robot, np.random.default_rng(0), duration=3.0))
    names = ["normal_drag", "head_drag", "tail_drag"]
    remarks = identify([log], sb.named_fluid("water"), robot, names).remarks
    assert remarks == [f"{name} is not determined: its interval contains zero" for name in names]


def test_what_has_no_effect_is_refused(tmp_path):
    log = read_log(write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot()))
    with pytest.raises(InvalidValue, match="proportional_gain has no effect on these logs"):
        identify([log], sb.named_fluid("water"), sb.Robot(), ["diameter", "proportional_gain"])


def test_a_singular_fit_is_refused_in_a_line(tmp_path, monkeypatch):
    monkeypatch.setattr("snakebench.identification.fit._SINGULAR", 1.0)  # as if no logs could tell anything apart
    log = read_log(write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot()))
    with pytest.raises(InvalidValue, match="the logs do not tell diameter, joint_stiffness apart: fit fewer, or add"):
        identify([log], sb.named_fluid("water"), sb.Robot(), ["diameter", "joint_stiffness"])


@pytest.fixture(scope="module")
def table(tmp_path_factory) -> pd.DataFrame:
    path = tmp_path_factory.mktemp("log") / "log.csv"
    return pd.read_csv(write_swim(path, GAITS["target"], sb.Robot(diameter=0.08, joint_stiffness=7.0)))


def swapped(table, a, b):
    return table.rename(columns={a: b, b: a})


BAD = {
    "a missing column": (lambda t: t.drop(columns="angle_3"), "columns are missing: angle_3"),
    "no commands": (lambda t: t.drop(columns=[f"target_{j}" for j in range(1, 8)]), "columns are missing: torque_1"),
    "no gyro": (lambda t: t.drop(columns="gyro_1"), "0 gyros: one column is needed"),
    "no angles": (lambda t: t[["time", "gyro_1"]], "no column angle_1"),
    "a NaN": (lambda t: t.assign(angle_2=t.angle_2.where(t.time != 1.0)), "angle_2 in row 61 is nan: a number within"),
    "a word": (lambda t: t.assign(gyro_1="fast"), "gyro_1 in row 1 is fast: a number within"),
    "a huge number": (lambda t: t.assign(head_x=1e300), "head_x in row 1 is 1e.300: a number within"),
    "a gap": (lambda t: t[(t.time < 2) | (t.time > 2.5)], "a gap of 0.533 s after 1.983 s"),
    "time that goes back": (lambda t: t.iloc[::-1], "time does not increase after row 1"),
    "too short": (lambda t: t.iloc[:60], "0.983 s of 60 Hz: at least 3 s"),
    "one row": (lambda t: t.iloc[:1], "1 rows: at least 3 s"),
    "milliseconds": (lambda t: t.assign(time=1000 * t.time), "time is in seconds"),
    "angles in degrees": (lambda t: t.assign(angle_5=np.degrees(t.angle_5)), "angle_5 reaches .*looks like degrees"),
    "targets in degrees": (lambda t: t.assign(target_7=np.degrees(t.target_7)), "target_7 reaches .*looks like deg"),
    "a gyro in degrees": (lambda t: t.assign(gyro_1=np.degrees(t.gyro_1)), "looks like degrees per second"),
    "a reversed gyro": (lambda t: t.assign(gyro_1=-t.gyro_1), "gyro_1 turns against what the joints imply"),
    "swapped joints": (lambda t: swapped(t, "angle_4", "angle_5"), "angle_4 follows the command of joint 5 and"),
    "swapped commands": (lambda t: swapped(t, "target_2", "target_6"), "are they swapped"),
    "a reversed joint": (lambda t: t.assign(angle_6=-t.angle_6), "angle_6: opposite to the commands"),
    "all joints reversed": (
        lambda t: t.assign(**{f"angle_{j}": -t[f"angle_{j}"] for j in range(1, 8)}), "angle_1, .*: opposite to the com"
    ),
    "an angle that is off": (lambda t: t.assign(angle_2=0.1), "angle_2 does not move, but its command does"),
    "a gyro that is off": (lambda t: t.assign(gyro_1=0.1), "gyro_1 does not move, but the joints do"),
    "positions in mm": (lambda t: t.assign(head_x=1000 * t.head_x, head_y=1000 * t.head_y), "looks like mm"),
    "joints at rest": (lambda t: t.assign(**{f"angle_{j}": 0.0 for j in range(1, 8)}), "no joint moves"),
    "another robot's": (
        lambda t: t.drop(columns=["angle_7", "target_7"]), "a log of 6 joints, but a robot of 7: give the robot's"
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_what_looks_wrong_in_a_log_is_said_in_one_line(snakebench_command, tmp_path, table, name):
    spoil, complaint = BAD[name]
    spoil(table).to_csv(tmp_path / "log.csv", index=False)
    code, out, err = snakebench_command("identify", "log.csv", "--fit", "diameter", "--save", "robot.json")
    assert code == 2 and not out and err.count("\n") == 1
    assert pd.Series([err]).str.contains(complaint)[0], err
    assert err.startswith("snakebench: log.csv: ")
    assert not (tmp_path / "robot.json").exists()


def test_a_log_of_a_far_stiffer_robot_than_is_assumed_is_not_taken_for_a_wrong_one(tmp_path):
    stiff = sb.Robot(diameter=0.079, joint_stiffness=14.18, joint_damping=0.0092)
    gait = sb.SeaSnake(amplitude=0.49, frequency=0.74, phase=0.63)
    log = read_log(write_swim(tmp_path / "log.csv", gait, stiff))
    assert identify([log], sb.named_fluid("water"), sb.Robot()).robot.joint_stiffness == pytest.approx(14.18, rel=0.01)


def test_commas_at_the_ends_of_rows_move_no_column(tmp_path, table):
    head, *rows = table.to_csv(index=False).splitlines()
    (tmp_path / "log.csv").write_text("\n".join([head, *(f"{row}," for row in rows)]))
    assert read_log(tmp_path / "log.csv").joint_angle[:, 0] == pytest.approx(table.angle_1.to_numpy())


@pytest.mark.parametrize("content", [None, "", "\x00\x01", "a,b\n1\n2,3,4\n", "a,b\n1,2,3\n4,5,6\n"])
def test_what_is_no_table_gets_one_line(snakebench_command, tmp_path, content):
    if content is not None:
        (tmp_path / "log.csv").write_text(content)
    code, _, err = snakebench_command("identify", "log.csv")
    assert code == 2 and err.count("\n") == 1 and "log.csv" in err


def test_a_robot_is_identified_and_used_on_the_command_line(snakebench_command, tmp_path):
    (tmp_path / "true.json").write_text(sb.Robot(diameter=0.08).model_dump_json())
    swim = ("simulate", "sea-snake", "--amplitude", "0.9", "--frequency", "0.6", "--phase", "0.7", "--engine", "planar")
    assert snakebench_command(*swim, "--robot", "true.json", "--duration", "5", "--log", "swim.csv")[0] == 0
    code, out, _ = snakebench_command("identify", "swim.csv", "--fit", "diameter", "--save", "found.json")
    name, assumed, fitted, *_ = out.splitlines()[1].split()
    assert code == 0 and "written: found.json" in out
    assert (name, assumed) == ("diameter", "0.1") and float(fitted) == pytest.approx(0.08, rel=0.002)
    found = sb.Robot(**json.loads((tmp_path / "found.json").read_text()))
    assert found == sb.Robot(diameter=found.diameter)
    _, out, _ = snakebench_command(*swim, "--robot", "found.json", "--duration", "2", "--json")
    settings = {"engine": "planar", "duration": 2.0}
    assert json.loads(out)["joint_amplitude"] == sb.evaluate(GAITS["target"], robot=found, **settings).joint_amplitude
    assert sb.Scenario(robot="found.json").robot == found


def test_a_factor_of_the_drag_goes_on_as_a_perturbation(snakebench_command, tmp_path):
    write_swim(tmp_path / "log.csv", GAITS["torque"], sb.Robot(), drag=sb.Perturbations(normal_drag=1.1), duration=4.0)
    code, out, _ = snakebench_command("identify", "log.csv", "--fit", "normal_drag", "--save", "robot.json")
    assert code == 0 and "add --perturb normal_drag=1.1" in out
    assert sb.Robot(**json.loads((tmp_path / "robot.json").read_text())) == sb.Robot()


def test_the_command_prints_json_and_takes_commands_as_held(snakebench_command, tmp_path):
    write_held(tmp_path / "log.csv", sb.Robot(diameter=0.08))
    code, out, err = snakebench_command("identify", "log.csv", "--fit", "diameter", "--hold", "--json")
    found = json.loads(out)
    assert (code, err) == (0, "") and set(found) == {"parameters", "perturbations", "noise", "remarks"}
    assert found["parameters"]["diameter"]["value"] == pytest.approx(0.08, rel=0.01)


@pytest.mark.parametrize("content", ["", "[]", '{"diameter": -1}', '{"colour": 1}', "{" * 100_000])
def test_what_is_no_robot_is_refused(snakebench_command, tmp_path, content):
    (tmp_path / "robot.json").write_text(content)
    words = ("simulate", "sea-snake", "--amplitude", "0.9", "--frequency", "0.6", "--phase", "0.7")
    code, out, err = snakebench_command(*words, "--robot", "robot.json")
    assert code == 2 and not out and err.count("\n") == 1
