"""A full disk is said in one line; what was there is whole, and the same command goes on when there is room again."""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from writing import write_manifest

import snakebench as sb
from snakebench.identification.log import write_log
from snakebench.manifest import read_manifest

ROOM = 4 << 20  # of the small disk [bytes]
MORE = ("--results", "disk/results", "--reports", "disk/reports")


@pytest.fixture
def disk(tmp_path):
    """A disk of its own, small, in the test's directory."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={ROOM}", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("only root may mount a small disk")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def leave(disk: Path, room: int) -> None:
    """Fill the disk but for so many bytes."""
    filler = disk / "filler"
    filler.unlink(missing_ok=True)
    free = shutil.disk_usage(disk).free
    with filler.open("wb") as file, suppress(OSError):  # there is no room at all
        os.posix_fallocate(file.fileno(), 0, max(free - room, 1))


def refused(code: int, err: str) -> bool:
    """Whether a command ended in one clear line, not by success; anything else fails the test."""
    assert "Traceback" not in err
    if code == 0:
        return False
    (line,) = [line for line in err.splitlines() if line.startswith("snakebench: ")]
    assert code == 2 and err.endswith(line + "\n")
    return True


def states(disk: Path, contents) -> tuple[dict[str, bytes], dict[str, bytes]]:
    """Results and pages."""
    assert (disk / "results" / "tiny" / "manifest.json").exists()
    return contents(disk / "results"), contents(disk / "reports")


def changed(tmp_path: Path) -> None:
    """The study asks for more, so that its results change."""
    path = tmp_path / "tiny.toml"
    path.write_text(path.read_text().replace("trials = 4", "trials = 8"))


@pytest.fixture
def run(snakebench_command, tiny_toml):
    """Runs the study, or another command, with everything on the small disk."""
    return lambda *words: snakebench_command(*(words or ("run-study", "tiny.toml", "--workers", "1")), *MORE)


def test_a_study_on_a_full_disk_leaves_results_and_pages_whole_and_goes_on(run, disk, tmp_path, contents):
    assert run()[0] == 0
    old = states(disk, contents)
    changed(tmp_path)
    messages, left, new = set(), [], None
    for room in (0, 8, 40, 80, 120, 160, 200, 280, 400, 600, 1000):  # [kB]
        leave(disk, room << 10)
        code, _, err = run()
        (disk / "filler").unlink()
        now = states(disk, contents)
        if not refused(code, err):
            new = now
            break
        messages.add(err.splitlines()[-1])
        assert now[1] == old[1]
        left.append(now[0])
        assert not [path for path in disk.rglob(".*") if path.is_file() or path.name == ".new-results"]
    assert new is not None and new[0] != old[0] and new[1] != old[1]
    assert all(results in (old[0], new[0]) for results in left)  # the new ones are published before their page
    assert len(messages) > 1 and all("full" in text or "No space" in text or "I/O" in text for text in messages)
    shutil.rmtree(disk / "results")
    shutil.rmtree(disk / "reports")
    assert run()[0] == 0
    assert states(disk, contents)[0] == new[0]


def test_a_report_on_a_full_disk_leaves_the_old_pages(run, disk, contents):
    assert run()[0] == 0
    assert run("report")[0] == 0
    old = contents(disk / "reports")
    directory = disk / "results" / "tiny"
    manifest = read_manifest(directory)
    manifest["config"]["question"] = "Does it really survive?"
    write_manifest(directory, manifest)
    failed = 0
    for room in (0, 30, 100, 1000):  # [kB]
        leave(disk, room << 10)
        code, _, err = run("report")
        (disk / "filler").unlink()
        now = contents(disk / "reports")
        assert set(now) == set(old)
        if not refused(code, err):
            break
        failed += 1
        assert "No space left on device" in err
        for name, content in now.items():
            assert content == old[name] or content.rstrip().endswith(b"</html>")
    assert failed > 0 and b"really survive" in now["tiny.html"]


def test_a_score_on_a_full_disk_leaves_the_old_one_and_goes_on(snakebench_command, disk, tmp_path):
    wave = {"kind": "sea-snake", "amplitude": 0.9, "frequency": 0.6, "phase": 0.7}
    (disk / "out").mkdir()
    words = ["score", "wave.json", "--quick", "--task", "known", "--out", "disk/out", "--results", "disk/results"]

    def scored() -> tuple[int, str]:
        code, _, err = snakebench_command(*words, "--workers", "1")
        return code, err

    (tmp_path / "wave.json").write_text(json.dumps(wave))
    assert scored()[0] == 0
    old = {path.name: path.read_bytes() for path in (disk / "out").iterdir()}
    (tmp_path / "wave.json").write_text(json.dumps(wave | {"amplitude": 0.8}))
    failed, left = 0, []
    for room in (0, 8, 40, 80, 160, 1000):  # [kB]
        leave(disk, room << 10)
        code, err = scored()
        (disk / "filler").unlink()
        now = {path.name: path.read_bytes() for path in (disk / "out").iterdir()}
        if not refused(code, err):
            break
        failed += 1
        assert now["score.html"] == old["score.html"] and set(now) == set(old)
        left.append(now["score.json"])
    assert failed > 0 and now["score.html"] != old["score.html"]
    assert set(left) <= {old["score.json"], now["score.json"]}


def limited(directory: Path, most: int, *words: str) -> tuple[int, str]:
    """A command that can write no file beyond a size [bytes]: its exit code and standard error."""
    answer = subprocess.run(
        [sys.executable, "-m", "snakebench.cli", *words],
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=300,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
    )
    return answer.returncode, answer.stderr


@pytest.mark.slow
@pytest.mark.parametrize("most", [0, 3_000, 20_000, 60_000])  # of the largest file: cache, run or page do not fit
def test_a_study_that_may_write_small_files_only_leaves_what_was_there_and_goes_on(tiny, tmp_path, contents, most):
    assert tiny()[0] == 0
    results, pages = contents(tmp_path / "results"), contents(tmp_path / "reports")
    changed(tmp_path)
    code, err = limited(tmp_path, most, "run-study", "tiny.toml", "--workers", "1")
    assert refused(code, err)
    assert contents(tmp_path / "reports") == pages
    left = contents(tmp_path / "results")
    assert tiny()[0] == 0
    new = contents(tmp_path / "results")
    assert new != results and left in (results, new)


PUBLISHED = Path(__file__).parents[2] / "results"
LEADERBOARD = PUBLISHED.with_name("leaderboard")
STUDENT = PUBLISHED / "teacher_student" / "policies" / "student-10.safetensors"
WAVE = "simulate sea-snake --amplitude 0.9 --frequency 0.6 --phase 0.7 --duration 5"
SMALL = sb.Robot(lengths=(0.28, 0.44, 0.44, 0.32), masses=(1.0, 1.5, 1.5, 1.2))  # whose limit is found in seconds
WRITERS = {  # commands, the file that each writes, and the largest that there is room for [bytes]
    "animation": (f"{WAVE} --animate swim.html", "swim.html", 4096),
    "model": (f"export {STUDENT} student.onnx", "student.onnx", 0),
    "header": (f"export {STUDENT} student.h", "student.h", 0),
    "play": (f"play --results {PUBLISHED} --out play.html --no-open", "play.html", 4096),
    "leaderboard": (f"leaderboard --leaderboard {LEADERBOARD} --reports .", "leaderboard.html", 4096),
    "robot": ("identify log.csv --save found.json", "found.json", 0),
    "limit": ("limit --fluid water --power 2 --robot small.json --save fast.json", "fast.json", 0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_a_file_for_which_there_is_no_room_leaves_the_old_one(tmp_path, name):
    words, file, most = WRITERS[name]
    gait = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
    write_log(tmp_path / "log.csv", sb.simulate(gait, "water", engine="planar", duration=5.0).thinned(4))
    (tmp_path / "small.json").write_text(SMALL.model_dump_json())
    (tmp_path / file).write_text("what was there")
    code, err = limited(tmp_path, most, *words.split())
    assert refused(code, err)
    cache = "cannot use results/.cache/evaluations.sqlite: disk I/O error\n"
    assert err.endswith((f"cannot write {file}: File too large\n", "cannot go on: File too large\n", cache))
    assert (tmp_path / file).read_text() == "what was there"
    assert not list(tmp_path.glob(f".{file}*"))
