"""What was learned is checked before it is used; damaged, it is learned again, with the same bytes."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import snakebench as sb
from snakebench.gain_schedule import ScheduledGait
from snakebench.learning.demonstrations import Demonstrations
from snakebench.learning.resume import TrainingFolder
from snakebench.learning.schedule import learn_schedule, set_damaged_schedule_aside
from snakebench.learning.settings import Imitation, Randomisation, Scheduling, Training
from snakebench.learning.training import distil, train

TRAINING = Training(steps=600, lstm=(), duration=1.0, members=8, checkpoints=3)
SMALL = sb.Robot(lengths=(0.28, 0.44, 0.44, 0.32), masses=(1.0, 1.5, 1.5, 1.2))
WAVE = 0.9 * np.sin(np.arange(30)[:, None] / 30 * 2 * np.pi - 0.9 * np.arange(3))
GAITS = Demonstrations([ScheduledGait(viscosity=1e-6, price=0.1, targets=WAVE.tolist())])
SHOWN = {"demonstrations": "limit", "robot": SMALL, "duration": 1.0, "randomisation": Randomisation(prices=(0.05, 3.0))}
IMITATION = Imitation(**SHOWN, lstm=(4,), members=8, rollout=15, iterations=4, handover=2, checkpoints=2)
LEARN = {
    "training": lambda folder: train(TRAINING, 0, folder),
    "imitation": lambda folder: distil(IMITATION, GAITS, 0, folder),
    "gain schedule": lambda folder: learn_schedule(Scheduling(**SHOWN, estimator=20), GAITS, 0, folder),
}
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


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in LEARN if name != "training"]


@pytest.fixture(scope="module", params=["training", *SLOW])
def learned(tmp_path_factory, request) -> Path:
    """The folder of what is finished, by what was learned."""
    folder = TrainingFolder(tmp_path_factory.mktemp("learned") / request.param).path
    LEARN[request.param](folder)
    return folder


def set_aside(folder: Path) -> bool:
    """What a study does before it learns."""
    return TrainingFolder(folder).set_damaged_aside() or set_damaged_schedule_aside(folder)


@pytest.mark.parametrize("damage", [overwritten, one_bit_flipped, cut, Path.unlink])
@pytest.mark.parametrize("names", [("finished",), ("log.csv",), ("checkpoint.pt", "finished")])
def test_what_was_learned_is_found_out_if_damaged_and_made_again_with_the_same_bytes(learned, tmp_path, names, damage):
    finished = "schedule.json" if learned.name == "gain schedule" else "policy.safetensors"
    folder = shutil.copytree(learned, tmp_path / "one")
    assert not set_aside(folder)
    paths = [folder / (finished if name == "finished" else name) for name in names]
    for path in filter(Path.exists, paths):  # a gain schedule has no checkpoint
        damage(path)
    removed = damage is Path.unlink and "finished" in names  # then nothing is there that could mislead
    assert set_aside(folder) is not removed
    assert (folder / f"{finished}.damaged").exists() is not removed
    LEARN[learned.name](folder)
    for name in (finished, "log.csv"):
        assert (folder / name).read_bytes() == (learned / name).read_bytes()
    assert not set_aside(folder)


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
