"""What was learned is checked before it is used; damaged, it is learned again, with the same bytes."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from snakebench.learning.resume import TrainingFolder
from snakebench.learning.settings import Training
from snakebench.learning.training import train

TRAINING = Training(steps=600, lstm=(), duration=1.0, members=8, checkpoints=3)
STUDY = """
question = "Is it learned again?"
method = "teacher_student"
fluids = ["water"]
profile = "tiny"
viscosities = 2
only = ["teacher"]
published = ["teacher"]
shown = ["teacher"]
[policies.teacher]
lstm = []
[profiles.tiny]
duration = 1.0
seeds = [0]
training = { steps = 400, members = 4, rollout = 25, checkpoints = 2 }
"""


def overwritten(path: Path) -> None:
    path.write_bytes(np.random.default_rng(3).bytes(path.stat().st_size))


def one_bit_flipped(path: Path) -> None:
    """In the last third, where only numbers are."""
    content = bytearray(path.read_bytes())
    content[len(content) * 5 // 6] ^= 16
    path.write_bytes(bytes(content))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.fixture(scope="module")
def learned(tmp_path_factory) -> Path:
    """The folder of a finished training."""
    folder = tmp_path_factory.mktemp("learned") / "one"
    train(TRAINING, 0, folder)
    return folder


@pytest.mark.parametrize("damage", [overwritten, one_bit_flipped, cut, Path.unlink])
@pytest.mark.parametrize("names", [("policy.safetensors",), ("log.csv",), ("checkpoint.pt", "policy.safetensors")])
def test_a_damaged_training_is_found_out_and_made_again_with_the_same_bytes(learned, tmp_path, names, damage):
    shutil.copytree(learned, tmp_path / "one")
    place = TrainingFolder(tmp_path / "one")
    assert not place.set_damaged_aside()
    for name in names:
        damage(tmp_path / "one" / name)
    removed = damage is Path.unlink and "policy.safetensors" in names  # then nothing is there that could mislead
    assert place.set_damaged_aside() is not removed
    train(TRAINING, 0, tmp_path / "one")
    for name in ("policy.safetensors", "log.csv"):
        assert (tmp_path / "one" / name).read_bytes() == (learned / name).read_bytes()
    assert not place.set_damaged_aside()


@pytest.mark.slow
@pytest.mark.parametrize("damage", [overwritten, one_bit_flipped])
def test_a_study_says_that_what_was_learned_is_damaged_and_ends_with_the_same_bytes(
    snakebench_command, tmp_path, contents, damage
):
    (tmp_path / "tiny.toml").write_text(STUDY)
    words = ("run-study", "tiny.toml", "--workers", "1")
    assert snakebench_command(*words)[0] == 0
    found = contents(tmp_path / "results")
    (policy,) = (tmp_path / "results" / ".cache" / "training").glob("*/policy.safetensors")
    whole = policy.read_bytes()
    damage(policy)
    code, _, err = snakebench_command(*words)
    assert code == 0 and "teacher 0: what was learned is damaged: it is set aside, and learned again" in err
    assert contents(tmp_path / "results") == found
    assert policy.read_bytes() == whole and policy.with_name("policy.safetensors.damaged").exists()
