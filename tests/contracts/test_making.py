"""The leaderboard is made again: by the scripts that its cards name, from the results that are there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

import snakebench as sb
from snakebench.errors import SnakebenchError, StoreError
from snakebench.manifest import left_out_files, read_manifest
from snakebench.publication import locked
from snakebench.scoring.checking import check
from snakebench.scoring.leaderboard import entries_in, read_card, read_leaderboard, write_entry
from snakebench.scoring.making import Scripts, make_entry, make_leaderboard, making_seconds
from snakebench.store import file_digest

ROOT = Path(__file__).parents[2]
SCRIPT = """
import sys
from snakebench.scoring.leaderboard import write_entry
content = sys.argv[1].encode()
write_entry(sys.argv[3], content, "gait.json", name="x", authors=["y"], information="open loop", hours=0.5)
"""
GAITS = [sb.SeaSnake(amplitude=amplitude, frequency=0.5, phase=0.7).model_dump_json() for amplitude in (0.4, 0.8)]
ABOUT = {"name": "mine", "authors": ["me"], "information": "open loop", "link": "https://example.org"}


@pytest.fixture
def entry(tmp_path):
    """An entry in a leaderboard, and the script that makes it, which is given a gait."""
    (tmp_path / "script.py").write_text(SCRIPT)
    folder = tmp_path / "leaderboard" / "mine"
    write_entry(folder, GAITS[0].encode(), "gait.json", made_by=f"script.py '{GAITS[1]}'", hours=2.0, **ABOUT)
    return folder


def test_an_entry_is_made_by_its_script_and_keeps_what_its_card_says(entry, tmp_path):
    before = read_card(entry)
    make_entry(entry, tmp_path / "results", Scripts())
    assert (entry / "gait.json").read_text() == GAITS[1]
    assert read_card(entry) == before.but(hours=0.5)


def test_a_card_may_have_any_letters(tmp_path):
    write_entry(tmp_path, GAITS[0].encode(), "gait.json", **ABOUT | {"name": "𝒜 🐍 é"})
    assert read_card(tmp_path).name == "𝒜 🐍 é"


def test_an_entry_without_a_script_stays(entry, tmp_path):
    write_entry(entry, GAITS[0].encode(), "gait.json", **ABOUT)
    make_entry(entry, tmp_path / "results", Scripts())
    assert (entry / "gait.json").read_text() == GAITS[0] and not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("made_by", "why"),
    [
        ("absent.py", "absent.py is no script in"),
        ("../script.py", "no file inside"),
        ("leaderboard", "leaderboard is no script in"),
        ("script.py", "script.py failed: IndexError"),
    ],
)
def test_what_makes_no_entry_is_refused_and_nothing_is_lost(entry, tmp_path, made_by, why):
    write_entry(entry, GAITS[0].encode(), "gait.json", made_by=made_by, **ABOUT)
    before = {path.name: path.read_bytes() for path in entry.iterdir()}
    with pytest.raises(SnakebenchError, match=why):
        make_entry(entry, tmp_path / "results", Scripts())
    assert {path.name: path.read_bytes() for path in entry.iterdir()} == before


def test_the_time_of_trainings_is_said_beforehand():
    seconds = [making_seconds(ROOT / "leaderboard", workers) for workers in (1, 2)]
    cards = map(read_card, entries_in(ROOT / "leaderboard"))
    trained = sum(card.hours for card in cards if card.training_steps and "study_entries" not in card.made_by)
    assert 7200 * trained > seconds[0] == 2 * seconds[1] > 3600 * trained > 0


@pytest.mark.parametrize(
    ("file", "made_by"), [("gait.json", "absent.py"), ("gait.json", "a 'b"), ("gait.json", " "), ("gait.txt", "")]
)
def test_what_cannot_be_made_or_scored_is_refused_beforehand(entry, file, made_by):
    write_entry(entry, GAITS[0].encode(), file, made_by=made_by, **ABOUT)
    with pytest.raises(SnakebenchError, match=r"is no script|is no entry|are needed"):
        making_seconds(entry.parent, workers=2)


def test_a_work_that_is_ended_ends_its_scripts(entry, tmp_path):
    steps = ["open('begun', 'w')", "__import__('time').sleep(20)", "open('ended', 'w')"]
    (tmp_path / "script.py").write_text("\n".join(steps))
    write_entry(entry.parent / "ready", GAITS[0].encode(), "gait.json", **ABOUT)
    started = []

    def end(line):
        started.append(line)
        for _ in range(1000):
            if not (tmp_path / "begun").exists():
                time.sleep(0.02)
        raise KeyboardInterrupt

    (entry.parent / "ready").rename(entry.parent / "a")  # the first, so that the other one runs meanwhile
    with pytest.raises(KeyboardInterrupt):
        make_leaderboard(entry.parent, tmp_path / "results", 2, end)
    assert started == [f"made: {entry.parent / 'a'}"]
    assert (tmp_path / "begun").exists() and not (tmp_path / "ended").exists()


def test_a_script_that_starts_after_the_end_is_ended():
    """A thread may begin the next one while the work ends."""
    scripts = Scripts()
    scripts.end()
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as late:
        scripts.add(late)
        assert late.wait(timeout=30) != 0


def test_a_work_that_is_killed_leaves_no_script_behind(entry, tmp_path):
    (tmp_path / "script.py").write_text(
        "import os, time\n__import__('pathlib').Path('begun').write_text(str(os.getpid()))\ntime.sleep(60)"
    )
    making = "from pathlib import Path; from snakebench.scoring.making import Scripts, make_entry; "
    code = making + f"make_entry(Path({str(entry)!r}), Path({str(tmp_path / 'results')!r}), Scripts())"
    with subprocess.Popen([sys.executable, "-c", code]) as work:
        until(lambda: (tmp_path / "begun").exists() and (tmp_path / "begun").read_text())
        work.kill()
    script = int((tmp_path / "begun").read_text())
    until(lambda: not running(script))


def running(process):
    """Whether a process still runs."""
    with suppress(ProcessLookupError, FileNotFoundError):
        os.kill(process, 0)
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"  # has ended, unread
    return False


def until(true, seconds=30.0):
    """Wait until something is true."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_one_process_at_a_time_makes_a_leaderboard(entry, tmp_path):
    with locked(tmp_path / "results" / "leaderboard"), pytest.raises(StoreError, match="by another snakebench"):
        make_leaderboard(tmp_path / "leaderboard", tmp_path / "results", 1, print)
    assert (entry / "gait.json").read_text() == GAITS[0]


@pytest.mark.slow
def test_the_leaderboard_is_made_and_scored(entry, tmp_path):
    lines = []
    make_leaderboard(tmp_path / "leaderboard", tmp_path / "results", 2, lines.append)
    (one,) = read_leaderboard(tmp_path / "leaderboard")
    check(one, swims=2)
    assert lines == [f"made: {entry}", f"scored: {entry}"] and "mine" in (entry / "score.html").read_text()
    score = (entry / "score.json").read_bytes()
    make_leaderboard(tmp_path / "leaderboard", tmp_path / "results", 1, lines.append)
    assert (entry / "score.json").read_bytes() == score


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("sinusoid", marks=pytest.mark.slow),
        pytest.param("wider_sinusoid", marks=pytest.mark.slow),
        pytest.param("sea_snake", marks=pytest.mark.slow),
        pytest.param("free_waveform", marks=pytest.mark.slow),
        "limit",
        "student",
        "robust_student",
        "preference_student",
        "imitator",
    ],
)
def test_committed_entries_are_what_the_results_make(name, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [str(ROOT / "examples"), *sys.path])
    import study_entries

    study_entries.main([name, "--results", str(ROOT / "results"), "--out", str(tmp_path / name)])
    committed, made = read_card(ROOT / "leaderboard" / name), read_card(tmp_path / name)
    known = {"file", "name", "information", "training_steps", "hours"}
    assert made.model_dump(include=known) == committed.model_dump(include=known)
    if made.file == "gait.json":
        files = [folder / name / "gait.json" for folder in (ROOT / "leaderboard", tmp_path)]
        assert json.loads(files[0].read_text()) == json.loads(files[1].read_text())


@pytest.mark.parametrize(
    ("entry_name", "study", "policy"),
    [
        ("teacher", "teacher_student", "teacher-10"),
        ("symmetric", "ablations", "symmetric_long-10"),
        ("imitator", "imitation", "imitator_positive-10"),
        ("robust_student", "robust", "robust_student-10"),
    ],
)
def test_the_policies_of_entries_are_those_of_the_studies(entry_name, study, policy):
    folder, manifest = ROOT / "leaderboard" / entry_name, read_manifest(ROOT / "results" / study)
    digests = manifest["files"] | left_out_files(manifest)
    file = folder / read_card(folder).file
    assert file_digest(file.read_bytes()) == digests[f"policies/{policy}.safetensors"]


def test_a_folder_without_a_card_is_refused_beforehand(entry):
    (entry.parent / "empty").mkdir()
    with pytest.raises(SnakebenchError, match="has no card"):
        making_seconds(entry.parent, workers=2)
