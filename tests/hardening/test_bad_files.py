"""Damaged or hostile files are refused in a line, or are valid: never a traceback, never a long wait."""

from __future__ import annotations

import json
import random
import shutil
import struct
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pandas as pd
import pytest
from fuzzing import changed, twisted
from onnx import helper
from writing import random_policy

import snakebench as sb
from snakebench.deployment import export_policy
from snakebench.errors import InvalidValue, SnakebenchError
from snakebench.gain_schedule import WINDOW, GainSchedule, ScheduledGait, features
from snakebench.identification.fit import identify
from snakebench.identification.log import read_log, write_log
from snakebench.policy import Card
from snakebench.robot import named_robot
from snakebench.scoring.checking import check
from snakebench.scoring.entry import read_entry
from snakebench.scoring.leaderboard import read_leaderboard
from snakebench.scoring.page import leaderboard_page
from snakebench.studies.config import LIBRARY, study_settings
from snakebench.studies.running import study_config, study_plan

TOML_JUNK = (
    *("nan", "inf", "-inf", "1e999", "9" * 400, "-1", "0", "1", "true", '""', '"x"', '"\\u0000"', '"☃"', "[]", "[[]]"),
    *("{}", "{a = 1}", "[1, 'a']", "[0, 0]", "1979-05-27", "07:32:00", "'''a\nb'''", "[nan]", "[-1]", "['water']"),
    *("[1e308, -1e308]", "0x10", "1_000", "[" * 3000, "[" * 3000 + "]" * 3000, '"' + "x" * 3000 + '"', "{seeds = 1}"),
    *("0.5", "[0.5]", "[true]", "1e-300", "'../../x'", "['a', 'b']", "{full = {}}", "=", "#", ""),
)
FEW, MANY = 20, 3000
LONGEST = 60  # that a file may take: the first one compiles the engine [s]
LEADERBOARD = Path(__file__).parents[2] / "leaderboard"


def changed_toml(text: str, rng: random.Random) -> str:
    """A TOML text with values, keys, tables or lines changed."""
    lines = text.splitlines()
    for _ in range(rng.choice((1, 1, 2, 4))):
        k = rng.randrange(len(lines))
        key, equals, _ = lines[k].partition(" = ")
        kind = rng.random()
        if equals and kind < 0.65:
            lines[k] = f"{key} = {rng.choice(TOML_JUNK)}"
        elif equals and kind < 0.75:
            lines[k] = lines[k].replace(
                key, rng.choice((key + "s", key[:-1] or "x", '""', "profile", "name", "robot")), 1
            )
        elif kind < 0.85:
            lines.insert(rng.randrange(len(lines)), lines[k])
        elif kind < 0.92:
            lines[k] = rng.choice(("[profiles]", "[profiles.smoke]", "[[profiles]]", "[a.b.c]", "[robot]", "", "]"))
        else:
            del lines[k]
            lines = lines or [""]
    return "\n".join(lines)


def tried(read: Callable[[], object], what: object) -> bool:
    """Whether something was refused in words; any other error than SnakebenchError, or a long wait, fails the test."""
    begun = time.process_time()
    try:
        read()
    except SnakebenchError as error:
        return bool(str(error).strip()) or pytest.fail(f"nothing is said of {what}")
    finally:
        assert time.process_time() - begun < LONGEST, f"{what} took too long"
    return False


SHORT_SWIM = ("simulate", "file", "gait.json", "--engine", "planar", "--duration", "0.1")
counts = pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow)])


@counts
def test_a_study_file_is_planned_or_refused(tmp_path, count):
    rng, path, refused = random.Random(count), tmp_path / "mine.toml", 0
    library = sorted(LIBRARY.glob("*.toml"))

    def plan() -> None:
        text = path.read_bytes()
        profile = rng.choice((None, "smoke", "quick", "full"))
        study_plan(study_config(study_settings(path, profile)))
        assert text == path.read_bytes()

    for _ in range(count):
        original = rng.choice(library).read_text()
        if rng.random() < 0.3:
            path.write_bytes(twisted(original.encode(), rng))
        else:
            path.write_text(changed_toml(original, rng))
        refused += tried(plan, path)
    print(f"{refused} of {count} study files refused, the others planned")
    assert count / 4 < refused < count
    assert [one.name for one in tmp_path.iterdir()] == ["mine.toml"]


@counts
def test_a_gait_file_is_a_gait_or_refused(snakebench_command, tmp_path, count):
    rng, path, refused = random.Random(count), tmp_path / "gait.json", 0
    gaits = [
        sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7),
        sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84),
        sb.Fourier(frequency=0.8, cosine=((0.1,) * 7,), sine=((0.2,) * 7,)),
        sb.HeldTargets(rate=30, targets=((0.1,) * 7,) * 3),
    ]
    for gait in gaits:
        path.write_text(json.dumps(gait.model_dump(mode="json")))
        assert snakebench_command(*SHORT_SWIM)[0] == 0
    for _ in range(count):
        content = json.dumps(changed(rng.choice(gaits).model_dump(mode="json"), rng))
        path.write_bytes(twisted(content.encode(), rng) if rng.random() < 0.4 else content.encode())
        code, _, err = snakebench_command(*SHORT_SWIM)
        assert code == 0 or (code, err.count("\n")) == (2, 1), content[:300]
        refused += code == 2
    print(f"{refused} of {count} gait files refused, the others swam")
    assert count / 4 < refused


@counts
def test_a_robot_file_is_a_robot_or_refused(tmp_path, count):
    rng, path, refused = random.Random(count), tmp_path / "robot.json", 0
    original = sb.Robot().model_dump(mode="json")
    for _ in range(count):
        content = json.dumps(changed(original, rng)).encode()
        path.write_bytes(twisted(content, rng) if rng.random() < 0.4 else content)
        refused += tried(lambda: named_robot(str(path)), path)
    print(f"{refused} of {count} robot files refused, the others are robots")
    assert count / 4 < refused < count


def small_policy(joints: int) -> sb.Policy:
    """A small policy of random numbers."""
    return random_policy(Card(joints=joints, feels=("joint angle",), mlp=(4,), lstm=(3,)))


@pytest.fixture(scope="module")
def policy() -> bytes:
    """The file of a small policy."""
    return small_policy(joints=3).content()


def with_header(content: bytes, header: Any, length: int | None = None) -> bytes:
    """A safetensors file with another header."""
    (own,) = struct.unpack("<Q", content[:8])
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return struct.pack("<Q", len(text) if length is None else length) + text + content[8 + own :]


def changed_policy(content: bytes, rng: random.Random) -> bytes:
    """A policy with its bytes, header, card, shapes or lengths changed."""
    (own,) = struct.unpack("<Q", content[:8])
    header = json.loads(content[8 : 8 + own])
    kind = rng.random()
    if kind < 0.35:
        return twisted(content, rng)
    if kind < 0.45:
        return with_header(content, header, rng.choice((0, 1, own - 1, own + 1, 2**31, 2**40, 2**63, 2**64 - 1)))
    if kind < 0.65:
        return with_header(content, changed(header, rng))
    card = changed(json.loads(header["__metadata__"]["snakebench"]), rng)
    header["__metadata__"]["snakebench"] = json.dumps(card)
    return with_header(content, header)


@counts
def test_a_policy_file_is_a_policy_or_refused(tmp_path, policy, little_memory, count):
    rng, path, refused = random.Random(count), tmp_path / "policy.safetensors", 0
    scenario = sb.Scenario(engine="planar", duration=0.1, robot=sb.Robot.with_joints(3))
    path.write_bytes(policy)
    assert not tried(lambda: sb.evaluate(sb.Policy.load(path), scenario), path)
    for _ in range(count):
        path.write_bytes(changed_policy(policy, rng))
        refused += tried(lambda: sb.evaluate(sb.Policy.load(path), scenario), path)
    print(f"{refused} of {count} policy files refused, the others swam")
    assert refused > count / 2


@pytest.fixture(scope="module", params=["saved", "published"])
def swim(request) -> bytes:
    """The file of a short trajectory."""
    run = sb.simulate(sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7), engine="planar", duration=0.1).thinned(8)
    return run.content() if request.param == "saved" else run.shown()


@counts
def test_a_trajectory_file_is_a_trajectory_or_refused(tmp_path, swim, count):
    rng, path, refused = random.Random(count), tmp_path / "swim.npz", 0
    path.write_bytes(swim)
    assert not tried(lambda: sb.Trajectory.load(path), path)
    for _ in range(count):
        path.write_bytes(twisted(swim, rng))
        refused += tried(lambda: sb.Trajectory.load(path), path)
    print(f"{refused} of {count} trajectory files refused, the others loaded")
    assert refused > count / 4


def schedule() -> GainSchedule:
    """A gain schedule of two small gaits."""
    targets = (0.3 * np.sin(np.arange(4)[:, None] * np.pi / 2 - np.arange(7))).tolist()
    gaits = [{"viscosity": 10.0**-k, "price": 0.1, "targets": targets} for k in (6, 3)]
    width = features(np.zeros((WINDOW, 31), np.float32), ScheduledGait(**gaits[0]), 0.0).size
    return GainSchedule(gaits=gaits, estimator={"weights": [[[0.01] * width]], "biases": [[-5.0]]})


@pytest.fixture(scope="module")
def entries() -> dict[str, bytes]:
    """Small files that can be scored, by their ending."""
    gait = sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7).model_dump(mode="json")
    table = {"kind": "gait-table", "gaits": [{"fluid": fluid, "gait": gait} for fluid in (None, "water")]}
    with tempfile.TemporaryDirectory() as directory:
        export_policy(small_policy(joints=7), Path(directory) / "policy.onnx")
        network = (Path(directory) / "policy.onnx").read_bytes()
    return {"table.json": json.dumps(table).encode(), "schedule.json": schedule().model_dump_json().encode(),
            "policy.onnx": network}  # fmt: skip


@counts
@pytest.mark.parametrize("name", ["table.json", "schedule.json", "policy.onnx"])
def test_a_file_to_be_scored_is_an_entry_or_refused(tmp_path, entries, little_memory, name, count):
    rng, path, refused = random.Random(count), tmp_path / name, 0
    scenario = sb.Scenario(engine="planar", duration=0.1)
    for _ in range(count):
        content = entries[name]
        if path.suffix == ".json" and rng.random() < 0.6:
            path.write_text(json.dumps(changed(json.loads(content), rng)))
        else:
            path.write_bytes(twisted(content, rng))
        refused += tried(lambda: sb.evaluate(read_entry(path).settings[0].controller, scenario), path)
    print(f"{refused} of {count} files {name} refused, the others swam")
    assert count / 4 < refused < count


OPERATORS = ("Add", "Mul", "Div", "Log", "Exp", "Concat", "Reshape", "Transpose", "Gather", "Cast", "Loop", "Nowhere")


def changed_network(content: bytes, rng: random.Random) -> bytes:
    """An ONNX model with operators, wires, weights, shapes or metadata changed."""
    model = onnx.load_model_from_string(content)
    graph = model.graph
    for _ in range(rng.choice((1, 1, 2, 4))):
        node, weights = rng.choice(graph.node), rng.choice(graph.initializer)
        names = [name for one in graph.node for name in (*one.input, *one.output)]
        kind = rng.randrange(8)
        if kind == 0:
            node.op_type = rng.choice(OPERATORS)
        elif kind == 1 and node.input:
            node.input[rng.randrange(len(node.input))] = rng.choice([*names, "", "nowhere"])
        elif kind == 2 and len(graph.node) > 1:
            graph.node.remove(node)
        elif kind == 3:
            if weights.data_type == onnx.TensorProto.FLOAT and weights.raw_data:
                array = np.frombuffer(weights.raw_data, np.float32).copy()
                array[rng.randrange(array.size)] = rng.choice((np.nan, np.inf, -np.inf, 3e38, 1e-40))
                weights.raw_data = array.tobytes()
        elif kind == 4 and weights.dims:
            weights.dims[rng.randrange(len(weights.dims))] = rng.choice((0, -1, 1, 10**6, 2**40))
        elif kind == 5:
            shape = rng.choice((*graph.input, *graph.output)).type.tensor_type.shape
            shape.dim[0].dim_value = rng.choice((0, -1, 1, 10**6))
        elif kind == 6:
            rng.choice((*graph.input, *graph.output)).type.tensor_type.elem_type = rng.randrange(17)
        else:
            model.metadata_props[0].value = json.dumps(changed(json.loads(model.metadata_props[0].value), rng))
    return model.SerializeToString()


@counts
def test_a_network_is_an_entry_or_refused(tmp_path, entries, little_memory, count):
    rng, path, refused = random.Random(count), tmp_path / "policy.onnx", 0
    scenario = sb.Scenario(engine="planar", duration=0.1)
    for _ in range(count):
        path.write_bytes(changed_network(entries[path.name], rng))
        refused += tried(lambda: sb.evaluate(read_entry(path).settings[0].controller, scenario), path)
    print(f"{refused} of {count} networks refused, the others swam")
    assert count / 4 < refused < count


@pytest.mark.parametrize("hidden", [False, True])
def test_a_network_that_may_never_end_is_refused(tmp_path, entries, hidden):
    model = onnx.load_model_from_string(entries["policy.onnx"])
    turn = helper.make_tensor_value_info("turn", onnx.TensorProto.INT64, [])
    *flags, shown = (helper.make_tensor_value_info(name, onnx.TensorProto.BOOL, []) for name in ("a", "b", "c", "yes"))
    same = [helper.make_node("Identity", ["a"], [name]) for name in ("b", "c")]
    body = helper.make_graph(same, "body", [turn, flags[0], shown], flags[1:])
    yes = helper.make_tensor("yes", onnx.TensorProto.BOOL, [], [True])
    nodes = [
        helper.make_node("Constant", [], ["yes"], value=yes),
        helper.make_node("Loop", ["", "yes", "yes"], ["end"], body=body),
    ]
    if hidden:
        branches = {name: helper.make_graph(nodes, name, [], [shown]) for name in ("then_branch", "else_branch")}
        nodes = [
            helper.make_node("Constant", [], ["on"], value=yes),
            helper.make_node("If", ["on"], ["out"], **branches),
        ]
    model.graph.node.extend(nodes)
    onnx.save(model, tmp_path / "policy.onnx")
    with pytest.raises(InvalidValue, match="has Loop: a control step without loops is needed"):
        read_entry(tmp_path / "policy.onnx")


def test_a_network_whose_numbers_are_in_another_file_is_refused(tmp_path, entries):
    model = onnx.load_model_from_string(entries["policy.onnx"])
    everything = {"save_as_external_data": True, "size_threshold": 0, "convert_attribute": True}
    onnx.save(model, tmp_path / "policy.onnx", **everything, location="numbers")
    with pytest.raises(InvalidValue, match="has numbers in other files"):
        read_entry(tmp_path / "policy.onnx")


def test_a_network_with_functions_is_refused(tmp_path, entries):
    model = onnx.load_model_from_string(entries["policy.onnx"])
    same = helper.make_node("Identity", ["a"], ["b"])
    model.functions.append(helper.make_function("mine", "Same", ["a"], ["b"], [same], model.opset_import))
    onnx.save(model, tmp_path / "policy.onnx")
    with pytest.raises(InvalidValue, match="has functions: inline them"):
        read_entry(tmp_path / "policy.onnx")


@counts
def test_a_leaderboard_is_checked_and_drawn_or_refused(tmp_path, count):
    rng, refused, mine = random.Random(count), 0, tmp_path / "mine"
    original = LEADERBOARD / "sea_snake"
    shutil.copytree(original, mine)
    assert not tried(lambda: [check(one, swims=0) for one in read_leaderboard(tmp_path)], mine)
    for _ in range(count):
        for name in ("card.toml", "score.json"):
            shutil.copy(original / name, mine / name)
        text = (mine / "score.json").read_text()
        kind = rng.random()
        if kind < 0.4:
            (mine / "card.toml").write_text(changed_toml((original / "card.toml").read_text(), rng))
        elif kind < 0.7:
            (mine / "score.json").write_text(json.dumps(changed(json.loads(text), rng)))
        else:
            damaged = mine / rng.choice(("card.toml", "score.json"))
            damaged.write_bytes(twisted(damaged.read_bytes(), rng))
        refused += tried(lambda: [check(one, swims=0) for one in read_leaderboard(tmp_path)], mine)
        tried(lambda: leaderboard_page(read_leaderboard(tmp_path)), mine)
    print(f"{refused} of {count} leaderboards refused, the others checked and drawn")
    assert count / 4 < refused


@pytest.fixture(scope="module")
def log() -> bytes:
    """The file of a short log."""
    run = sb.simulate(sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7), engine="planar", duration=4.0)
    with tempfile.TemporaryDirectory() as directory:
        write_log(Path(directory) / "log.csv", run.thinned(8))
        return (Path(directory) / "log.csv").read_bytes()


@counts
def test_a_log_is_a_log_or_refused(tmp_path, log, count):
    rng, path, refused = random.Random(count), tmp_path / "log.csv", 0
    path.write_bytes(log)
    assert not tried(lambda: read_log(path), path)
    for _ in range(count):
        path.write_bytes(twisted(log, rng))
        refused += tried(lambda: read_log(path), path)
    print(f"{refused} of {count} logs refused, the others read")
    assert count / 4 < refused < count


def changed_log(table: pd.DataFrame, rng: random.Random) -> pd.DataFrame:
    """A log with columns scaled, exchanged or strange, rows lost or noisy."""
    for _ in range(rng.choice((1, 1, 2, 3))):
        one, other = rng.sample(list(table), 2)
        row, kind = rng.randrange(len(table)), rng.randrange(8)
        if kind == 0:
            table[one] = table[one] * rng.choice((-1, 0, 1e-9, 57.3, 1e9, 1e300))
        elif kind == 1:
            table = table.rename(columns={one: other, other: one})
        elif kind == 2:
            table.loc[row, one] = rng.choice((np.nan, np.inf, -1e308, 1e6, 0.0))
        elif kind == 3:
            table = table.drop(index=range(row, min(row + rng.choice((1, 2, 30)), len(table)))).reset_index(drop=True)
        elif kind == 4:
            table[one] = [rng.gauss(0, 1) for _ in range(len(table))]
        elif kind == 5:
            table = table.drop(columns=one)
        elif kind == 6:
            table[one] = np.roll(table[one], rng.randrange(60))
        else:
            table[one] = table[other]
        if not len(table) or len(table.columns) < 2:
            break
    return table


@pytest.mark.parametrize("count", [3, pytest.param(MANY // 20, marks=pytest.mark.slow)])
def test_what_a_log_says_is_fitted_or_refused(tmp_path, count):
    rng, path, refused = random.Random(count), tmp_path / "log.csv", 0
    gait = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
    write_log(path, sb.simulate(gait, engine="planar", duration=3.0).thinned(8))
    original = pd.read_csv(path)
    assert not tried(lambda: identify([read_log(path)], sb.named_fluid("water"), sb.Robot(), ["diameter"]), path)
    for _ in range(count):
        changed_log(original.copy(), rng).to_csv(path, index=False)
        refused += tried(lambda: identify([read_log(path)], sb.named_fluid("water"), sb.Robot(), ["diameter"]), path)
    print(f"{refused} of {count} logs refused, the others fitted")
    assert count / 4 < refused < count
