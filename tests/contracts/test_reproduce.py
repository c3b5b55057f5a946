"""One command reproduces everything: checked beforehand, in order, and continued after any interruption."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from functools import cache
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from snakebench import progress
from snakebench.errors import InvalidValue, StoreError, WorkersLost
from snakebench.manifest import read_manifest
from snakebench.names import STUDIES
from snakebench.studies.config import StudyConfig, study_names, study_path, study_profiles, study_settings
from snakebench.studies.reproduction import checked_configs, reproduce
from snakebench.studies.sea_snake import run as sea_snake

PAIR = ("fourier", "sea_snake")
LESS = {
    "fourier": {"harmonics": (1,), "prices": (0.05,), "trials": 12, "price_trials": 12, "duration": 2.0},
    "sea_snake": {"compared": (), "duration": 2.0},
}


def test_every_study_of_the_library_has_its_place():
    assert sorted(STUDIES) == [name for name in study_names() if name != "quickstart"]


@pytest.mark.parametrize(
    ("study", "profile"), [(name, profile) for name in study_names() for profile in study_profiles(study_path(name))]
)
def test_every_study_is_planned_from_its_settings_alone(tmp_path, monkeypatch, study, profile):
    monkeypatch.chdir(tmp_path)  # where there are no results
    (config,) = checked_configs(profile, [study])
    own = study_settings(study_path(study))["profile"]
    assert config.name == (study if profile == own else f"{study}-{profile}")
    assert not list(tmp_path.iterdir())


@cache
def every_config(profile: str) -> list[StudyConfig]:
    return checked_configs(profile)


def outcome(results: Path) -> dict[str, bytes]:
    """Every table, trajectory and policy; manifests and the validation's costs, which tell the time, are left out."""
    files = [path for path in results.glob("*-smoke/**/*.*") if path.name not in {"manifest.json", "costs.csv"}]
    return {str(path.relative_to(results)): path.read_bytes() for path in files}


@pytest.mark.parametrize("profile", ["smoke", "quick", "full"])
def test_what_a_study_reads_is_made_before_it(profile):
    made, reads = set(), {}
    for config in every_config(profile):
        studies = getattr(config, "contenders", None)
        read = set(studies.model_dump(exclude={"gaits"}).values()) | set(studies.gaits) if studies else set()
        for job in config.training_jobs() if hasattr(config, "training_jobs") else []:
            read |= {getattr(job.settings, "demonstrations", "")}
        read |= {getattr(config, "robust", ""), getattr(config, "policies", "") if config.method == "limit" else ""}
        assert read - {""} <= made, config.name
        made.add(config.name)
        reads |= {config.method: read - {""}}
    methods = {"adaptation", "learned_front", "limit", "operating_point", "robustness"}
    assert all(reads[method] for method in methods - ({"limit"} if profile != "full" else set())), reads


@pytest.mark.parametrize("profile", ["smoke", "quick", "full"])
def test_policies_that_a_study_asks_for_are_trained_before_it(profile):
    trained: dict[str, set[tuple[str, int]]] = {}
    compared = set()
    for config in every_config(profile):
        if (studies := getattr(config, "contenders", None)) and studies.policies:
            asked = {(name, seed) for name in config.pilots for seed in config.seeds or ()}
            assert asked <= trained[studies.policies], config.name
            compared.add(config.method)
        if hasattr(config, "training_jobs"):
            trained[config.name] = {(job.name, job.seed) for job in config.training_jobs()}
    assert compared >= {"adaptation", "cross", "robustness"}


def test_studies_run_in_order_under_one_progress_and_a_second_time_from_the_cache(tmp_path, capsys):
    configs = [config.model_copy(update=LESS[config.method]) for config in checked_configs("smoke", PAIR)]
    finished = []
    directories = reproduce(configs, tmp_path, 1, lambda path: finished.append((path, read_manifest(path)["study"])))
    assert finished == [(tmp_path / name, name) for name in ("fourier-smoke", "sea_snake-smoke")]
    out, err = capsys.readouterr()
    lines = err.splitlines()
    assert directories == [tmp_path / "fourier-smoke", tmp_path / "sea_snake-smoke"]
    assert out == ""
    weighed = [k for k, line in enumerate(lines) if line.startswith("all: about ") and "1 at a time" in line]
    begun = [k for k, line in enumerate(lines) if "evaluations, 1 at a time" in line]
    assert [lines[k].split(":")[0] for k in begun] == ["1 of 2, fourier-smoke", "2 of 2, sea_snake-smoke"]
    assert len(weighed) == 1 and weighed[0] < begun[0]
    assert "; all: about " in err and lines[-1].endswith("; all: done")
    found = outcome(tmp_path)
    assert len(found) > 5
    reproduce(configs, tmp_path, workers=1)
    assert outcome(tmp_path) == found
    assert [read_manifest(directory)["computed"] for directory in directories] == [0, 0]


@pytest.mark.parametrize("error", [InvalidValue("every gait diverged"), WorkersLost("a worker was killed")])
def test_a_study_that_fails_is_named_and_those_before_it_stay(tmp_path, monkeypatch, error):
    message = str(error)

    def fail(*_):
        raise error

    configs = [config.model_copy(update=LESS[config.method]) for config in checked_configs("smoke", PAIR)]
    monkeypatch.setattr(sea_snake, "run", fail)
    with pytest.raises(type(error)) as caught:
        reproduce(configs, tmp_path, workers=1)
    assert str(caught.value) == f"sea_snake-smoke: {message}"
    assert (tmp_path / "fourier-smoke" / "manifest.json").exists()
    assert not (tmp_path / "sea_snake-smoke" / "manifest.json").exists()


def test_results_of_another_format_are_refused_before_anything_is_run(tmp_path):
    (tmp_path / "sea_snake-smoke").mkdir()
    (tmp_path / "sea_snake-smoke" / "manifest.json").write_text('{"format": 0}')
    with pytest.raises(StoreError, match="format 0"):
        reproduce(checked_configs("smoke", PAIR), tmp_path, workers=1)
    assert not (tmp_path / ".cache").exists()


def test_without_the_learning_libraries_it_is_refused_in_a_line_that_tells_how_to_get_them(tmp_path):
    script = """import sys
sys.modules["stable_baselines3"] = None
sys.argv = ["snakebench", "reproduce", "--profile", "smoke"]
from snakebench.cli import main
main()"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("snakebench: tuning: learning needs stable_baselines3")
    assert 'pip install -c constraints.txt ".[learning]"' in run.stderr and run.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_on_a_terminal_a_work_has_its_bar_beside_that_of_the_whole(monkeypatch):
    terminal = StringIO()
    monkeypatch.setattr(progress, "_CONSOLE", Console(file=terminal, force_terminal=True, width=100))
    with progress.Whole(["short", "long"]) as whole:
        whole.estimate.expect("short", {"units": 3600.0})
        whole.estimate.expect("long", {"units": 3600.0, "learning": 3 * 3600.0})
        with progress.Work("short", 2, whole) as work:
            work.begin(3600.0)
            work.advance(2, found=True)
            assert whole.left() == "about 4 h to go"
        with progress.Work("long", 4, whole) as work:
            work.begin(3600.0, learning=3 * 3600.0, known={"learning": 0.5})
            assert whole.left() == "about 2 h to go"
            work.reached("learning", 1.0, found=True)
            work.advance(2, found=True)
            assert whole.left() == "about 30 min to go"
            work.say("a word")
    shown = terminal.getvalue()
    assert "2/4" in shown and "all, 2 of 2" in shown and "2 of 2, a word" in shown
    assert whole.left() == "done"


def start(directory: Path, *command: str) -> subprocess.Popen[str]:
    directory.mkdir(exist_ok=True)
    words, pipe = [sys.executable, *command], subprocess.PIPE
    return subprocess.Popen(words, cwd=directory, stdout=pipe, stderr=pipe, text=True, start_new_session=True)


def finish(process: subprocess.Popen[str], seconds: float) -> list[str]:
    out, err = process.communicate(timeout=seconds)
    assert process.returncode == 0, err
    return out.splitlines()


@pytest.mark.slow
def test_killed_at_any_study_it_goes_on_to_the_same_bytes(tmp_path, wait_for):
    script = """from pathlib import Path
from snakebench.studies.reproduction import checked_configs, reproduce
reproduce(checked_configs("smoke", ["sea_snake", "learned_front", "fourier"]), Path("results"), workers=2)"""
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    for count in (50, 150, 200):
        process = start(stopped, "-c", script)
        wait_for(process, stopped, count)
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=60)
    for directory in (whole, stopped):
        finish(start(directory, "-c", script), 1200)
    assert len(outcome(whole / "results")) > 15
    assert outcome(stopped / "results") == outcome(whole / "results")


@pytest.mark.slow
def test_interrupted_the_same_command_continues_to_all_pages(tmp_path, wait_for):
    command = ("-m", "snakebench.cli", "reproduce", "--profile", "smoke", "--workers", "2")
    process = start(tmp_path, *command)
    wait_for(process, tmp_path, 70)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert "same command continues" in err.splitlines()[-1]
    lines = finish(start(tmp_path, *command), 3600)
    pages = sorted(f"report: reports/{study}-smoke.html" for study in STUDIES)
    assert lines == [*pages, "results: results", "index:   reports/index.html"]
    assert all((tmp_path / line.split()[1]).exists() for line in lines)
