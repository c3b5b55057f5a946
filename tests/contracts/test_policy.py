"""Policies are numbers in a file: safe to load, the same everywhere, and controllers like any other."""

from __future__ import annotations

import contextlib
import json
import struct
import subprocess
import sys

import numpy as np
import pytest
import torch
import writing

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.execution import evaluation_key
from snakebench.learning.actor import Actor
from snakebench.learning.ppo import exported
from snakebench.learning.settings import Training
from snakebench.learning.training import ppo
from snakebench.observation import LAYOUT, STUDENT, TEACHER, columns
from snakebench.policy import Card, Policy

CARDS = {
    "student": Card(feels=STUDENT),
    "teacher": Card(feels=TEACHER),
    "memoryless": Card(feels=TEACHER, lstm=()),
    "preference": Card(feels=("sensors", "preference"), prices=(0.005, 2.0)),
    "small": Card(joints=3, feels=("joint angle", "viscosity"), mlp=(5,), lstm=(4, 4, 4), control_rate=15),
}


def random_policy(card: Card, seed: int = 0) -> Policy:
    """A policy of numbers that 16 bits hold."""
    arrays = writing.random_policy(card, seed).arrays
    return Policy(card, {name: array.astype(np.float16).astype(np.float32) for name, array in arrays.items()})


@pytest.fixture(params=CARDS)
def policy(request):
    return random_policy(CARDS[request.param])


def observations(policy, steps=300):
    width = 4 * policy.card.joints + 3 + 4 + 1
    return np.random.default_rng(0).normal(size=(steps, width)).astype(np.float32)


def acted(policy, seen):
    memory, actions = policy.fresh_memory(), []
    for one in seen:
        action, memory = policy.act(one, memory)
        actions.append(action)
    return np.array(actions)


def test_a_file_gives_the_policy_back_and_is_always_the_same_bytes(policy, tmp_path):
    paths = tmp_path / "one.safetensors", tmp_path / "two.safetensors"
    for path in paths:
        policy.save(path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    loaded = Policy.load(paths[0])
    assert loaded.digest() == policy.digest() and loaded.card == policy.card
    seen = observations(policy)
    np.testing.assert_array_equal(acted(loaded, seen), acted(policy, seen))


def test_a_student_is_below_half_a_megabyte(tmp_path):
    random_policy(CARDS["student"]).save(tmp_path / "student.safetensors")
    assert (tmp_path / "student.safetensors").stat().st_size < 5e5


def test_a_policy_of_other_32_bit_floats_is_kept_as_it_is(tmp_path):
    policy = random_policy(CARDS["small"])
    policy.arrays["action.bias"][:] = 0.1
    policy.save(tmp_path / "small.safetensors")
    assert Policy.load(tmp_path / "small.safetensors").digest() == policy.digest()


def test_numpy_and_torch_act_alike(policy):
    seen = observations(policy)
    actor = Actor.of(policy)
    assert actor.policy().digest() == policy.digest()
    with torch.no_grad():
        whole, _ = actor(torch.from_numpy(seen)[:, None], actor.rest(1))
    np.testing.assert_allclose(acted(policy, seen), whole[:, 0].clamp(-1, 1).numpy(), atol=1e-5)


@pytest.mark.parametrize("lstm", [(), (16, 16)])
def test_what_is_exported_is_the_trained_mean(lstm):
    training = Training(steps=1, members=2, lstm=lstm, feels=TEACHER)
    network = ppo(training, seed=3).policy
    for weights in network.parameters():
        weights.data = weights.half().float()  # as a file has them
    policy = exported(network, training.card())
    seen = observations(policy, 20)
    groups = {"sensors": seen[:, :31], "privileged": seen[:, 31:35], "preference": seen[:, 35:]}
    state, begins, found = None, np.ones(1), []
    for k in range(20):
        one = {name: group[k : k + 1] for name, group in groups.items()}
        action, state = network.predict(one, state, begins, deterministic=True)
        begins = np.zeros(1)
        found.append(action[0])
    np.testing.assert_allclose(acted(policy, seen), np.array(found), atol=1e-5)


def test_a_student_does_not_see_what_is_privileged():
    hidden = columns(["privileged"], 7)
    seen = observations(random_policy(CARDS["student"]), 50)
    other = seen.copy()
    other[:, hidden] = np.random.default_rng(1).normal(size=(50, 4))
    for name, sees in (("student", False), ("teacher", True)):
        policy = random_policy(CARDS[name])
        assert (acted(policy, seen) != acted(policy, other)).any() == sees


def test_the_preference_changes_within_its_range_and_is_part_of_the_key():
    policy = random_policy(CARDS["preference"])
    assert policy.price == 0.005  # where power is cheapest
    cheap, dear = (sb.simulate(policy.at(price), engine="planar", duration=1.0) for price in (0.005, 2.0))
    assert (cheap.command != dear.command).any()
    np.testing.assert_array_equal(cheap.command, sb.simulate(policy, engine="planar", duration=1.0).command)
    assert policy.at(0.005).digest() == policy.digest() != policy.at(0.1).digest()
    for price in (0.0049, 2.1, float("nan"), -1.0):
        with pytest.raises(InvalidValue, match=r"preference = .*: the policy was trained from 0.005 to 2 1/W"):
            policy.at(price)
    with pytest.raises(InvalidValue, match=r"preference = 0.1: this policy is not preference-conditioned"):
        random_policy(CARDS["student"]).at(0.1)


def test_a_file_from_before_there_was_a_preference_is_still_read(tmp_path):
    policy = random_policy(CARDS["student"])
    policy.save(tmp_path / "old.safetensors")
    changed(tmp_path / "old.safetensors", layout=[line for line in LAYOUT if "preference" not in line])
    old, seen = Policy.load(tmp_path / "old.safetensors"), observations(policy, 5)
    np.testing.assert_array_equal(acted(old, seen), acted(policy, seen))


@pytest.mark.parametrize(("engine", "rate"), [("pybullet", 480), ("planar", 90)])
def test_its_swim_is_that_of_its_actions_held(engine, rate):
    where = {"engine": engine, "physics_rate": rate, "fluid": "oil1", "duration": 2.0}
    policy = random_policy(CARDS["teacher"])
    swim = sb.simulate(policy, **where)
    targets = swim.command[: -1 : rate // 30]
    held = sb.HeldTargets(rate=30, targets=tuple(map(tuple, targets.tolist())))
    assert sb.evaluate(policy, **where) == sb.evaluate(held, **where)
    assert len(np.unique(targets[:, 0])) == 60


def test_its_key_knows_its_numbers_but_not_its_history():
    here = sb.Scenario()
    one, other = random_policy(CARDS["student"]), random_policy(CARDS["student"], seed=1)
    renamed = Policy(one.card.but(origin={"seed": 9}), one.arrays)
    assert evaluation_key(one, here) == evaluation_key(renamed, here) != evaluation_key(other, here)


def test_a_policy_of_another_robot_or_rate_is_refused():
    policy = random_policy(CARDS["student"])
    with pytest.raises(InvalidValue, match="made for 7 joints at 30 Hz, the robot has 5 at 30 Hz"):
        sb.evaluate(policy, robot=sb.Robot.with_joints(5), duration=1.0)
    with pytest.raises(InvalidValue, match="made for 7 joints at 30 Hz, the robot has 7 at 60 Hz"):
        sb.evaluate(policy, control_rate=60, duration=1.0)


def test_a_missing_file_or_one_of_another_kind_is_refused_in_a_line(tmp_path):
    with pytest.raises(InvalidValue, match=r"cannot read the policy .*No such file"):
        Policy.load(tmp_path / "none.safetensors")
    with pytest.raises(InvalidValue, match="cannot read the policy"):
        Policy.load(tmp_path)
    for content in (b"", b"pickle?", b"\x80\x04N." * 20, struct.pack("<Q", 2**60)):
        (tmp_path / "odd").write_bytes(content)
        with pytest.raises(InvalidValue, match="damaged or no policy of snakebench"):
            Policy.load(tmp_path / "odd")


def test_a_damaged_file_is_refused(tmp_path):
    rng, path = np.random.default_rng(0), tmp_path / "policy.safetensors"
    random_policy(CARDS["small"]).save(path)
    whole = path.read_bytes()
    for length in rng.integers(0, len(whole), 50):
        path.write_bytes(whole[:length])
        with pytest.raises(InvalidValue):
            Policy.load(path)
    (header,) = struct.unpack("<Q", whole[:8])
    for place in rng.integers(0, 8 + header, 300):  # beyond it a change only makes another number
        content = bytearray(whole)
        content[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(bytes(content))
        with contextlib.suppress(InvalidValue):  # and nothing else
            Policy.load(path)


def changed(path, **card):
    """The file with its card changed."""
    content = path.read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    header = json.loads(content[8 : 8 + length])
    inner = json.loads(header["__metadata__"]["snakebench"]) | card
    header["__metadata__"]["snakebench"] = json.dumps(inner)
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + content[8 + length :])


@pytest.mark.parametrize(
    ("card", "match"),
    [
        ({"layout": ["sensors: joint angle x 2 + 0"]}, "it observes sensors: joint angle x 2 .* is what there is"),
        ({"joints": 5}, r"shape \(7,\): \(5,\) is needed"),
        ({"lstm": [128]}, "lstm.1.*None is needed"),
        ({"feels": ["sonar"]}, "unknown observation 'sonar'"),
        ({"format": 2}, "format = 2"),
        ({"code": "import os"}, "unknown field 'code'"),
    ],
)
def test_a_card_that_does_not_fit_is_refused(card, match, tmp_path):
    path = tmp_path / "policy.safetensors"
    random_policy(CARDS["student"]).save(path)
    changed(path, **card)
    with pytest.raises(InvalidValue, match=match):
        Policy.load(path)


def test_numbers_that_are_none_are_refused():
    policy = random_policy(CARDS["small"])
    for wrong in (np.float32(np.nan), np.float32(np.inf)):
        arrays = dict(policy.arrays) | {"action.bias": np.full(3, wrong)}
        with pytest.raises(InvalidValue, match=r"action\.bias holds numbers that are no finite"):
            Policy(policy.card, arrays)
    with pytest.raises(InvalidValue, match="no finite 32-bit"):
        Policy(policy.card, dict(policy.arrays) | {"action.bias": np.zeros(3)})


def test_a_policy_swims_without_any_learning_library(tmp_path):
    path = tmp_path / "policy.safetensors"
    random_policy(CARDS["student"]).save(path)
    script = (
        "import sys, snakebench as sb; from pathlib import Path;"
        f"print(sb.evaluate(sb.Policy.load(Path({str(path)!r})), engine='planar', duration=0.5).status);"
        "assert not {'torch', 'gymnasium', 'stable_baselines3'} & set(sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True).stdout == "ok\n"
