"""What runs on a robot is the policy: exported models and headers act as the network in PyTorch does."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch
from writing import random_policy

import snakebench as sb
from snakebench.deployment import export_policy
from snakebench.deployment.interface import MEANINGS
from snakebench.errors import InvalidValue
from snakebench.learning.actor import Actor
from snakebench.observation import GROUPS, STUDENT, TEACHER, Senses, columns
from snakebench.physics.kinematics import link_poses
from snakebench.physics.record import Record
from snakebench.policy import Card, Policy

POLICIES = Path(__file__).parents[2] / "results"
CARDS = {
    "teacher": Card(feels=TEACHER),
    "memoryless": Card(feels=TEACHER, lstm=()),
    "linear": Card(mlp=(), lstm=()),
    "preference": Card(feels=("sensors", "preference"), prices=(0.005, 2.0)),
    "no mlp": Card(feels=("preference", "joint angle"), mlp=(), lstm=(9,), prices=(0.005, 2.0)),
    "small": Card(joints=3, feels=("joint angle", "viscosity"), mlp=(5, 40), lstm=(4, 4, 4), control_rate=15),
}
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror", "-O2")
MAIN = """
#include <stdio.h>
#include "policy.h"

int main(void)
{
    static struct snake_memory memory;
    float observation[SNAKE_INPUTS], action[SNAKE_JOINTS];
    while (fread(observation, sizeof observation, 1, stdin) == 1) {
        snake_step(observation, &memory, action);
        fwrite(action, sizeof action, 1, stdout);
    }
    return 0;
}
"""
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on the PATH")


def observations(policy: Policy, steps: int = 400) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(steps, 4 * policy.card.joints + 8)).astype(np.float32)


def student() -> tuple[Policy, np.ndarray]:
    """A published student and all that it observes in 20 s."""
    policy, seen = sb.Policy.load(POLICIES / "teacher_student" / "policies" / "student-10.safetensors"), []
    act = policy.act

    def remembered(observation, memory):
        seen.append(observation)
        return act(observation, memory)

    policy.act = remembered
    sb.simulate(policy, "oil1", engine="planar", duration=20.0)
    return policy, np.array(seen)


def case(name: str) -> tuple[Policy, np.ndarray]:
    if name == "student":
        return student()
    policy = random_policy(CARDS[name])
    return policy, observations(policy)


def felt(policy: Policy, seen: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(seen[:, columns(policy.card.feels, policy.card.joints)])


def of_torch(policy: Policy, seen: np.ndarray) -> np.ndarray:
    """What PyTorch's network does, in 64-bit numbers: its 32-bit ones are wrong by almost 1e-6 themselves."""
    actor = Actor.of(policy).double()
    with torch.no_grad():
        rest = tuple(part.double() for part in actor.rest(1))
        return actor(torch.from_numpy(seen).double()[:, None], rest)[0][:, 0].clamp(-1, 1).numpy()


def of_onnx(path: Path, seen: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(path)
    state = {field.name: np.zeros(field.shape, np.float32) for field in session.get_inputs()[1:]}
    actions = []
    for one in seen:
        action, *after = session.run(None, {"observation": one, **state})
        state = dict(zip(state, after, strict=True))
        actions.append(action)
    return np.array(actions)


def of_c(header: Path, seen: np.ndarray, joints: int) -> np.ndarray:
    (header.parent / "main.c").write_text(MAIN)
    program = header.parent / "main"
    subprocess.run(["cc", *FLAGS, header.parent / "main.c", "-o", program, "-lm"], check=True, timeout=120)
    done = subprocess.run([program], input=seen.tobytes(), capture_output=True, check=True, timeout=60)
    return np.frombuffer(done.stdout, np.float32).reshape(-1, joints)


@pytest.mark.parametrize("name", ["student", *CARDS])
def test_a_model_acts_for_a_whole_run_as_pytorch_does(name, tmp_path):
    policy, seen = case(name)
    export_policy(policy, tmp_path / "policy.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx")
    memory = {"hidden": [sum(policy.card.lstm)], "cell": [sum(policy.card.lstm)]} if policy.card.lstm else {}
    width = len(columns(policy.card.feels, policy.card.joints))
    assert {one.name: one.shape for one in session.get_inputs()} == {"observation": [width]} | memory
    found = of_onnx(tmp_path / "policy.onnx", felt(policy, seen))
    assert len(found) >= 300 and np.abs(found - of_torch(policy, seen)).max() < 1e-6


@needs_compiler
@pytest.mark.parametrize("name", ["student", *CARDS])
def test_a_header_acts_for_a_whole_run_as_pytorch_does(name, tmp_path):
    policy, seen = case(name)
    export_policy(policy, tmp_path / "policy.h")
    found = of_c(tmp_path / "policy.h", felt(policy, seen), policy.card.joints)
    assert len(found) >= 300 and np.abs(found - of_torch(policy, seen)).max() < 1e-6


def test_the_code_in_a_header_is_short_and_needs_the_mathematical_library_only(tmp_path):
    export_policy(random_policy(CARDS["small"]), tmp_path / "policy.h")
    text = (tmp_path / "policy.h").read_text()
    assert text.isascii() and re.findall("#include.*", text) == ["#include <math.h>"] and "alloc(" not in text
    assert len(text[text.index("/* One control step") :].splitlines()) <= 100


def test_the_numbers_in_a_header_are_the_policys_to_the_last_bit(tmp_path):
    policy = random_policy(CARDS["small"])
    export_policy(policy, tmp_path / "policy.h")
    text = (tmp_path / "policy.h").read_text()
    for name, array in policy.arrays.items():
        written = re.search(rf"float snake_{name.replace('.', '_')}\[\] = {{(.*?)}};", text, re.DOTALL)[1]
        numbers = np.array([number.strip(" \nf") for number in written.split(",")], np.float32)
        np.testing.assert_array_equal(numbers, array.T.ravel())


@needs_compiler
@pytest.mark.parametrize("name", ["teacher", "memoryless"])
def test_a_target_angle_is_always_a_number(name, tmp_path):
    policy = random_policy(CARDS[name])
    export_policy(policy, tmp_path / "policy.h")
    seen = felt(policy, observations(policy, steps=3))
    seen[1, 0] = np.nan
    found = of_c(tmp_path / "policy.h", seen, 7)
    assert found[0].any() and not found[1].any() and np.isfinite(found).all()


@needs_compiler
def test_text_from_a_policys_file_is_never_code(tmp_path):
    policy = random_policy(CARDS["linear"])
    odd = Policy(policy.card.but(origin={"policy": '*/\n#error "run" /* ??/ \\'}), policy.arrays)
    export_policy(odd, tmp_path / "policy.h")
    seen = observations(policy)
    assert np.abs(of_c(tmp_path / "policy.h", felt(policy, seen), 7) - of_torch(policy, seen)).max() < 1e-6


@pytest.mark.parametrize("ending", [".onnx", pytest.param(".h", marks=needs_compiler)])
@pytest.mark.parametrize("name", ["preference", "no mlp"])
def test_a_fixed_preference_acts_as_that_price_observed(name, ending, tmp_path):
    policy = random_policy(CARDS[name])
    seen, path = observations(policy), tmp_path / f"policy{ending}"
    seen[:, -1] = 0.75 * np.log10(0.3) + 0.75
    export_policy(policy, path, preference=0.3)
    without = felt(policy, seen)[:, :-1]
    found = of_c(path, without, 7) if ending == ".h" else of_onnx(path, without)
    assert np.abs(found - of_torch(policy, seen)).max() < 1e-6
    seen[:, -1] = 0.75 * np.log10(0.4) + 0.75
    assert np.abs(found - of_torch(policy, seen)).max() > 1e-3


def described(policy: Policy, tmp_path: Path, **preference: float) -> dict:
    export_policy(policy, tmp_path / "policy.onnx", **preference)
    metadata = onnxruntime.InferenceSession(tmp_path / "policy.onnx").get_modelmeta().custom_metadata_map
    export_policy(policy, tmp_path / "policy.h", **preference)
    comment = (tmp_path / "policy.h").read_text().partition("*/")[0]
    content = json.loads(metadata["snakebench"])
    assert json.loads(comment[comment.index("{") :]) == content
    return content


def test_the_description_gives_name_unit_scale_and_offset_of_every_number(tmp_path):
    policy = random_policy(Card(joints=2, feels=tuple(GROUPS), prices=(0.01, 3.0)))
    robot, action = sb.Robot(lengths=(0.2, 0.2, 0.2), masses=(0.5, 0.5, 0.5)), [0.3, -0.4]
    parts = {name: np.zeros((1, 2)) for name in Record._fields}
    parts |= {"joint_angle": np.array([[0.5, -0.6]]), "joint_rate": np.array([[7.0, -8.0]])}
    now = Record(**parts | {"head": np.zeros((1, 3)), "head_rate": np.array([[0.1, -0.2, 0.9]])})
    senses = Senses(robot)
    senses.act(np.array([action]), now)
    seen = senses.observation(now, np.array([1e-4]), np.array([0.1]))[0]
    torque = [  # with the constants of docs/deploy.md
        4.0 * (a - q) - 0.3 * rate - 5.729578 * q - 2.864789e-3 * rate
        for a, q, rate in zip(action, (0.5, -0.6), (7.0, -8.0), strict=True)
    ]
    value = {
        "joint angle 1": 0.5,
        "joint angle 2": -0.6,
        "joint rate 1": 7.0,
        "joint rate 2": -8.0,
        "joint torque 1": torque[0],
        "joint torque 2": torque[1],
        "head turning x": 0.0,
        "head turning y": 0.0,
        "head turning z": 0.9,
        "last action 1": 0.3,
        "last action 2": -0.4,
        "viscosity": -4.0,
        "head velocity x": 0.1,
        "head velocity y": -0.2,
        "head velocity z": 0.0,
        "price of power": -1.0,
    }
    content = described(policy, tmp_path)
    numbers = content["observation"]
    assert [number["name"] for number in numbers] == list(value)
    scaled = [number["scale"] * value[number["name"]] + number["offset"] for number in numbers]
    np.testing.assert_allclose(scaled, seen, atol=1e-6)
    assert all(number["unit"] and number["meaning"] for number in numbers)
    assert [(angle["name"], angle["low"], angle["high"]) for angle in content["action"]] == [
        ("target angle 1", -1, 1),
        ("target angle 2", -1, 1),
    ]
    assert content["control_rate"] == 30 and content["card"]["joints"] == 2 and content["preferences"] == [0.01, 3.0]


def test_a_student_has_31_inputs_and_a_fixed_preference_is_described(tmp_path):
    assert len(described(random_policy(Card(feels=STUDENT)), tmp_path)["observation"]) == 31
    policy = random_policy(CARDS["preference"])
    assert len(described(policy, tmp_path)["observation"]) == 32
    fixed = described(policy, tmp_path, preference=0.1)
    assert len(fixed["observation"]) == 31 and fixed["fixed_preference"] == 0.1 and fixed["preferences"] is None


def test_every_quantity_has_a_unit_and_a_meaning():
    assert list(MEANINGS) == [quantity.name for group in GROUPS.values() for quantity in group]


def test_a_positive_angle_swings_what_is_behind_to_the_right():
    angles = np.zeros((1, 7))
    angles[0, 2] = 0.4
    links = link_poses(sb.Robot().link_lengths, np.zeros((1, 3)), angles)[0]
    np.testing.assert_array_equal(links[:3, 1], 0.0)  # heading +x, so that the left is +y
    assert (links[3:, 1] < 0).all()


def test_the_same_policy_is_always_the_same_bytes(tmp_path):
    policy = random_policy(CARDS["small"])
    for name in ("policy.h", "policy.onnx"):
        export_policy(policy, tmp_path / name)
        export_policy(policy, tmp_path / f"again-{name}")
        assert (tmp_path / name).read_bytes() == (tmp_path / f"again-{name}").read_bytes()


def test_a_policy_that_would_observe_nothing_is_refused(tmp_path):
    policy = random_policy(Card(feels=("preference",), prices=(0.01, 3.0)))
    with pytest.raises(InvalidValue, match=r"preference = 0\.1: the policy observes nothing else"):
        export_policy(policy, tmp_path / "policy.h", preference=0.1)


def test_a_header_needs_no_library_and_a_model_says_which_it_needs(tmp_path):
    random_policy(CARDS["small"]).save(tmp_path / "policy.safetensors")
    script = (
        "import sys; sys.modules |= dict.fromkeys(('onnx', 'torch'));"
        "import snakebench as sb; from pathlib import Path; from snakebench.deployment import export_policy;"
        f"here = Path({str(tmp_path)!r}); policy = sb.Policy.load(here / 'policy.safetensors');"
        "export_policy(policy, here / 'policy.h'); export_policy(policy, here / 'policy.onnx')"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (
        'policy.onnx needs onnx: in the clone, pip install -c constraints.txt ".[onnx]"' in done.stderr.splitlines()[-1]
    )
    assert (tmp_path / "policy.h").exists() and not (tmp_path / "policy.onnx").exists()


def test_a_header_has_the_range_of_the_price_where_it_is_an_input(tmp_path):
    found = {}
    for name in ("preference", "teacher"):
        export_policy(random_policy(CARDS[name]), tmp_path / f"{name}.h")
        found[name] = re.findall(r"#define SNAKE_PRICE_(\w+) (\S+)f", (tmp_path / f"{name}.h").read_text())
    assert {end: float(price) for end, price in found["preference"]} == {"LEAST": 0.005, "MOST": 2.0}
    assert found["teacher"] == []
