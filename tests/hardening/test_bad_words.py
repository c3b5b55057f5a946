"""Whatever is typed, the answer is a result or one line that says what was wrong; nothing is lost or half-written."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import numpy as np
import pytest

import snakebench as sb
from snakebench.policy import Card

NUMBERS = (
    *("nan", "inf", "-inf", "-1", "0", "-0", "1e400", "1e-400", "9" * 400, "99999999999999999999", "0x10", "1_000"),
    *("١٢", "½", "1,5", "1e", "--1", "1e308", "-1e308", "5e-324", "NaN", "0.1.2"),
)
TEXTS = (
    *("", " ", "true", "None", "[]", "{}", "'", '"', "a,b", "--", "-", "☃", "\n", "a\nb", "\t", "%s", "{0}", "$(x)"),
    *("x" * 300, "x" * 5000, "\udcff\udcfe", "wasser", "WATER", "water ", "oil2@99", "\x1b[31m", "--help-me", "[bold]"),
)
PATHS = (
    *("directory", "file", "missing", "missing/too", "file/below", "/dev/null", "/dev/full", "/proc/nothing", "."),
    *("\udcff\udcfe", "x" * 300, "x/" * 3000, "", "~", "directory/", "dangling", "loop", "pipe"),
)
RESULTS, LEADERBOARD = (Path(__file__).parents[2] / name for name in ("results", "leaderboard"))
ODD = (*NUMBERS, *TEXTS, *PATHS)

GAIT = {"amplitude": "0.5", "frequency": "1", "phase": "0.7"}
RUN = ("fluid", "robot", "diameter", "joints", "engine", "physics-rate", "save", "log", "animate")
WORK = ("workers", "executor", "scheduler", "results", "reports")
# Each command: its words, what it needs to be valid, and the options that may be given wrongly. A run that starts is
# of 0.1 s; commands that run studies are given at least one word that none of them takes.
COMMANDS = {
    "sinusoidal-torque": (("simulate", "sinusoidal-torque"), GAIT | {"duration": "0.1"}, (*RUN, *GAIT)),
    "sea-snake": (("simulate", "sea-snake"), GAIT | {"duration": "0.1"}, (*RUN, *GAIT)),
    "file": (("simulate", "file", "gait.json"), {"duration": "0.1"}, RUN),
    "policy": (("simulate", "policy"), {"path": "policy.safetensors", "duration": "0.1"}, (*RUN, "path", "preference")),
    "report": (("report",), {}, ("results", "out", "leaderboard")),
    "run-study": (("run-study", "missing.toml"), {}, ("profile", "seeds", "engine", *WORK)),
    "pareto": (("pareto",), {"fluids": "lava"}, ("method", "grid", "population", "seeds", "verify", "profile", *WORK)),
    "reproduce": (("reproduce",), {"workers": "0"}, ("profile", "results", "reports")),
    "bench": (("bench",), {"threads": "0"}, ("results", "reports")),
    "export": (("export", "policy.safetensors", "policy.h"), {}, ("preference",)),
    "identify": (("identify", "file"), {}, ("fit", "fluid", "robot", "diameter", "joints", "save")),
    "limit": (("limit",), {"power": "0"}, (*RUN[:4], "currency", "bound", "joint-rate", "save", "animate", "workers")),
    "play": (("play", "--no-open"), {"results": "missing"}, ("results", "out")),
    "score": (("score", "file"), {}, ("task", "seed", "out", "leaderboard", "workers", "results")),
    "leaderboard": (("leaderboard",), {"leaderboard": "file"}, ("reports", "workers")),
    "list": (("list",), {}, ("fluids",)),
    "nothing": ((), {}, ("help-me",)),
}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A directory with something of every kind in it, and results that must stay as they are."""
    (tmp_path / "directory").mkdir()
    (tmp_path / "file").write_text("a file")
    (tmp_path / "dangling").symlink_to("nowhere/at/all")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "gait.json").write_text(sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7).model_dump_json())
    card = Card(mlp=(4,), lstm=(3,))
    arrays = {name: np.zeros(shape, np.float32) for name, shape in card.shapes().items()}
    sb.Policy(card, arrays).save(tmp_path / "policy.safetensors")
    for study in ("kept", "sea_snake"):
        (tmp_path / "results" / study).mkdir(parents=True)
        (tmp_path / "results" / study / "manifest.json").write_text('{"format": 1}')
        (tmp_path / "results" / study / "optima.csv").write_text("a,b\n1,2\n")
    return tmp_path


def files(place: Path) -> dict[str, bytes]:
    """All files, compiled code and pages apart."""
    found = (path for path in place.rglob("*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(place)): path.read_bytes() for path in found}


def sentence(rng: random.Random) -> list[str]:
    """A command with one to three wrong words, at most."""
    fixed, needed, options = COMMANDS[rng.choice(list(COMMANDS))]
    words, given = list(fixed), dict(needed)
    for _ in range(rng.randint(1, 3)):
        kind = rng.random()
        if kind < 0.75 and options:
            name = rng.choice(options)
            likely = dict.fromkeys(("save", "log", "animate", "results", "reports", "out", "path"), PATHS)
            given[name] = rng.choice(likely.get(name, ODD) if rng.random() < 0.7 else ODD)
        elif kind < 0.85 and needed:
            given.pop(rng.choice(list(needed)), None)
            if fixed[:1] in {("pareto",), ("reproduce",), ("bench",)}:
                given = dict(needed)  # or it would start
        elif words:
            words[rng.randrange(len(words))] = rng.choice(ODD)
            if fixed[:1] != ("simulate",):
                words.append("--" + rng.choice(("colour", "trails")))
    spelled = [word for name, value in given.items() for word in (f"--{name}", value)]
    if rng.random() < 0.05 and spelled:
        spelled.pop()
    return words + spelled


def judge(words: list[str], answer: tuple[int, str, str]) -> bool:
    """Whether a command was refused; fails unless it was answered or refused as promised."""
    code, out, err = answer
    assert "Traceback" not in err, words
    if code == 0:
        return False
    lines = [line for line in err.splitlines() if not line.startswith("compiling ")]
    assert code == 2 and len(lines) == 1 and lines[0].startswith("snakebench: "), (words, answer)
    assert not out or words[0] in ("report", "play"), (words, answer)
    return True


def try_many(command, place: Path, count: int, seed: int) -> tuple[int, int]:
    """So many sentences: how many were refused, and how many were answered."""
    rng, refused = random.Random(seed), 0
    before = files(place)
    for _ in range(count):
        words = sentence(rng)
        if judge(words, command(*words)):
            refused += 1
            assert files(place) == before, words
        else:  # pages and runs that were asked for
            for path in set(files(place)) - set(before):
                assert path.endswith((".html", ".npz", ".md", ".svg", ".h")) or path in words, (path, words)
                (place / path).unlink()
            for path, content in before.items():
                if (place / path).read_bytes() != content:
                    assert path in words, (path, words)  # it was named as the file to write
                    (place / path).write_bytes(content)
    return refused, count - refused


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("count", [60, pytest.param(2000, marks=pytest.mark.slow)])
def test_wrong_words_get_one_line_and_change_nothing(snakebench_command, place, little_memory, count):
    refused, answered = try_many(snakebench_command, place, count, seed=count)
    print(f"{refused} sentences refused, {answered} answered")
    assert refused > count / 2


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/full"])
@pytest.mark.parametrize(
    "words",
    [
        *(("simulate", "file"), ("simulate", "policy", "--path"), ("export",), ("run-study",), ("identify",)),
        *(("score",), ("simulate", "file", "gait.json", "--robot"), ("identify", "gait.json", "--robot")),
        *(("play", "--no-open", "--results"), ("play", "--no-open", "--results", "results", "--out")),
    ],
)
def test_a_device_that_never_ends_is_not_read(snakebench_command, place, little_memory, words, device):
    after = ("model.onnx",) if words == ("export",) else ()
    (place / "endless.json").symlink_to(device)
    for path in (device, "endless.json"):
        assert judge([*words, path], snakebench_command(*words, path, *after))


@pytest.mark.parametrize("name", ["card.toml", "score.json"])
def test_an_entry_that_never_ends_is_not_read(snakebench_command, place, little_memory, name):
    shutil.copytree(LEADERBOARD / "sea_snake", place / "entries" / "sea_snake")
    (place / "entries" / "sea_snake" / name).unlink()
    (place / "entries" / "sea_snake" / name).symlink_to("/dev/zero")
    words = ["leaderboard", "--leaderboard", "entries", "--reports", "."]
    assert judge(words, snakebench_command(*words))


@pytest.mark.parametrize("option", ["save", "animate"])
@pytest.mark.parametrize("path", ["directory", "missing/too", "/dev/full", "loop", "x" * 300, "pipe"])
def test_a_run_that_cannot_be_kept_does_not_start(snakebench_command, place, monkeypatch, option, path):
    os.mkfifo(place / "pipe")
    monkeypatch.setattr(sb, "simulate", lambda *_, **__: pytest.fail("it started"))
    words = ["simulate", "file", "gait.json", "--duration", "0.1", f"--{option}", path]
    assert judge(words, snakebench_command(*words))


@pytest.mark.parametrize("kind", ["same", "link", "hard link", "other words"])
@pytest.mark.parametrize("option", ["--save", "--animate"])
def test_no_output_is_an_input(kind, option, snakebench_command, tmp_path):
    gait, policy, score = (tmp_path / name for name in ("gait.json", "policy.safetensors", "score.json"))
    gait.write_text('{"kind": "sea-snake", "amplitude": 0.9, "frequency": 0.6, "phase": 0.7}')
    score.write_text(gait.read_text())
    policy.write_bytes((RESULTS / "teacher_student" / "policies" / "student-10.safetensors").read_bytes())
    before = {path: path.read_bytes() for path in (gait, policy, score)}
    (tmp_path / "below").mkdir()

    def another(path: Path) -> Path:
        if kind == "same":
            return path
        if kind == "other words":
            return tmp_path / "below" / ".." / path.name
        other = path.with_name(f"other-{path.name}")
        other.symlink_to(path) if kind == "link" else other.hardlink_to(path)
        return other

    gait_again, policy_again, score_again = (str(another(path)) for path in before)
    commands = [
        ("export", str(policy), policy_again),
        ("simulate", "file", str(gait), option, gait_again, "--duration", "1"),
        ("simulate", "policy", "--path", str(policy), option, policy_again, "--duration", "1"),
        ("identify", str(gait), "--save", gait_again),
        ("score", score_again, "--out", str(tmp_path)),
        ("play", "--no-open", "--results", str(tmp_path.parent), "--out", gait_again),
    ]
    for command in commands:
        code, _, err = snakebench_command(*command)
        assert code == 2 and "is read as an input" in err and err.count("\n") == 1
    assert {path: path.read_bytes() for path in before} == before
