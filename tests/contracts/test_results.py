"""What the committed results are claimed to show."""

from __future__ import annotations

import json
import re
import subprocess
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from snakebench.execution import physics_fingerprint
from snakebench.manifest import left_out_files, read_manifest
from snakebench.names import STUDIES
from snakebench.publication import published_digest, snapshot
from snakebench.report.equal_power import speeds_within, top_power
from snakebench.studies.columns import FRONT_TABLES
from snakebench.studies.config import SMALLER, study_path, study_settings
from snakebench.studies.running import study_config
from snakebench.studies.training_jobs import LearningConfig
from snakebench.tables import read_table
from snakebench.trajectory import Trajectory

RESULTS, REPORTS = (Path(__file__).parents[2] / name for name in ("results", "reports"))
FLUIDS = ["water", "oil1", "oil2"]
NO_NUMBERS = (
    *("*.md", "*.html", "*.css", "snakebench/play/*", "snakebench/report/*", "snakebench/comparison/*"),
    *("*/page.py", "*/figures.py", "snakebench/cli/*", "snakebench/site.py", "snakebench/scoring/leaderboard.py"),
    *("snakebench/studies/seed_fronts.py", "snakebench/scoring/checking.py", "snakebench/store.py"),
    *("snakebench/files.py", "snakebench/identification/*", "snakebench/scoring/measurement.py"),
)  # files that make pages from tables, compare a score with its swims, keep texts, identify robots, or refuse
# swims: with the present rules, `snakebench leaderboard --check --whole` makes the same scores of all entries


def worth(study: str) -> pd.DataFrame:
    """What fronts of P are worth, means over the seeds, by method and front."""
    table = read_table(RESULTS / study / "indicators.csv", FRONT_TABLES["indicators"])
    table = table[table["currency"] == "net"].drop(columns="currency")
    table["space"] = table["space"].str.replace(r" \d+$", "", regex=True)
    return table.groupby(["space", "front"]).mean(numeric_only=True)


@pytest.mark.parametrize("front", [*FLUIDS, "integrated", "simple-sum"])
def test_the_front_of_the_student_is_worth_more_than_the_wider_sinusoids(front):
    learned, fixed = worth("learned_front"), worth("pareto")
    assert learned.loc[("student", front), "hypervolume"] > fixed.loc[("extended", front), "hypervolume"]


@pytest.mark.parametrize(("fluid", "gain"), [("water", 0.20), ("oil1", 0.05), ("oil2", 0.10)])
@pytest.mark.parametrize("power", [5, 10, 15, 20])
def test_the_student_is_faster_than_the_papers_sinusoids_at_equal_power(fluid, gain, power):
    of_policies, of_gaits = (read_table(RESULTS / study / "fronts.csv") for study in ("learned_front", "pareto"))
    fixed = of_gaits[(of_gaits["space"] == "paper") & (of_gaits["front"] == fluid)]
    students = of_policies[of_policies["space"].str.startswith("student") & (of_policies["front"] == fluid)]
    seeds = [seed for _, seed in students.groupby("space")]
    shared = np.array([min(power, *(top_power(one) for one in (fixed, *seeds)))])
    assert np.mean([speeds_within(seed, shared) for seed in seeds]) >= (1 + gain) * speeds_within(fixed, shared)


@pytest.mark.parametrize("front", [*FLUIDS, "simple-sum"])
def test_the_student_keeps_the_front_of_its_teacher(front):
    hypervolume = worth("learned_front")["hypervolume"]
    assert hypervolume[("student", front)] >= 0.97 * hypervolume[("teacher", front)]


def test_five_students_swam_at_fifteen_positions_or_more_in_every_fluid():
    dial = read_table(RESULTS / "learned_front" / "dial.csv")
    swims = dial[(dial["variant"] == "finer step") & (dial["policy"] == "student")]
    assert set(swims["engine"]) == {"pybullet"} and set(swims["physics_rate"]) == {960}
    positions = swims.groupby(["seed", "fluid"])["price"].nunique()
    assert len(positions) == 5 * 3 and (positions >= 15).all()
    manifest = read_manifest(RESULTS / "learned_front")
    names = {*manifest["files"], *manifest["left_out"]["files"]}
    assert {f"policies/student-{seed}.safetensors" for seed in range(10, 15)} <= names
    assert (RESULTS / "learned_front" / "policies" / "student-10.safetensors").stat().st_size < 1e6


def test_students_are_back_at_their_speed_within_three_seconds_of_a_step():
    back = read_table(RESULTS / "adaptation" / "recoveries.csv")
    students = back[back["method"] == "student"]
    assert students.groupby(["from", "to"])["seed"].nunique().to_dict() == {("water", "oil2"): 5, ("oil2", "water"): 5}
    assert (students["seconds"] <= 3.0).all()


@pytest.mark.parametrize("kind", ["paper", "extended", "fourier"])
@pytest.mark.parametrize("course", ["step", "ramp", "gradient"])
def test_students_get_as_far_as_nine_tenths_of_ideal_switching(course, kind):
    swims, ideal = (read_table(RESULTS / "adaptation" / f"{name}.csv") for name in ("courses", "switching"))
    students = swims[(swims["method"] == "student") & (swims["course"] == course) & (swims["variant"] == "finer step")]
    assert len(students) == 5 and (students["status"] == "ok").all()
    best = ideal[(ideal["method"] == kind) & (ideal["course"] == course)][
        "distance"
    ].mean()  # over the seeds of a search
    assert (students["distance"] >= 0.9 * best).all()


def test_every_published_file_is_as_its_manifest_lists_it():
    with snapshot(RESULTS) as taken:
        assert not taken.problems
        copied = {path.relative_to(taken.copy) for path in taken.copy.rglob("*") if path.is_file()}
    studies = [path.parent for path in RESULTS.glob("*/manifest.json")]
    assert studies and all("files" in read_manifest(study) for study in studies)
    assert copied == {path.relative_to(RESULTS) for study in studies for path in study.rglob("*") if path.is_file()}


def test_results_of_this_version_are_of_one_physics():
    manifests = [read_manifest(path.parent) for path in sorted(RESULTS.glob("*/manifest.json"))]
    physics = {one["study"]: one["physics"] for one in manifests if one.get("physics")}
    assert len(physics) >= 9
    now = {engine: physics_fingerprint(engine) for engine in ("pybullet", "planar")}
    assert {study: found for study, found in physics.items() if found.items() - now.items()} == {}


def test_studies_have_read_what_is_published():
    manifests = {path.parent.name: read_manifest(path.parent) for path in RESULTS.glob("*/manifest.json")}
    now = {study: published_digest(manifest) for study, manifest in manifests.items()}
    stale = {
        (name, study)
        for name, one in manifests.items()
        for study, seal in one.get("read", {}).items()
        if seal != now[study]
    }
    assert any(one.get("read") for one in manifests.values())
    assert stale == set()


@pytest.mark.parametrize(("directory", "most"), [(RESULTS, 25e6), (REPORTS, 10e6)], ids=["results", "reports"])
def test_the_repository_stays_light(directory, most):
    files = {RESULTS.parent / name for name in git("ls-files", str(directory)).splitlines()}
    assert len(files) > 20 and sum(path.stat().st_size for path in files) <= most


def test_a_second_of_a_published_swim_takes_little():
    files = list(RESULTS.glob("*/trajectories/*.npz"))
    assert len(files) >= 50
    assert all(path.stat().st_size <= 4000 * Trajectory.load(path).time[-1] for path in files)


def test_policies_that_are_left_out_are_listed_with_the_command_that_makes_them():
    left_out = read_manifest(RESULTS / "teacher_student")["left_out"]
    assert left_out["command"] == "snakebench run-study teacher_student --workers 2"
    assert left_out["files"].keys() == {
        f"policies/{name}-{seed}.safetensors" for name in ("teacher", "symmetric") for seed in range(10, 15)
    }


def test_what_is_left_out_is_ignored_by_git():
    ignored = (RESULTS.parent / ".gitignore").read_text().splitlines()
    for study in (path.parent for path in RESULTS.glob("*/manifest.json")):
        for path in _may_be_missing(study):
            name = str(path.relative_to(RESULTS.parent))
            assert any(fnmatch(name, line) for line in ignored), name


def _may_be_missing(study: Path) -> list[Path]:
    """What a manifest lists as left out, which lies there where the study was run."""
    return [study / name for name in left_out_files(read_manifest(study))]


def test_all_results_and_scores_are_of_one_commit_without_changes():
    manifests = [RESULTS / name / "manifest.json" for name in (*STUDIES, "bench")]
    scores = sorted((RESULTS.parent / "leaderboard").glob("*/score.json"))
    commits = {path.parent: json.loads(path.read_text(encoding="utf-8"))["commit"] for path in manifests + scores}
    assert scores
    assert len(set(commits.values())) == 1, commits
    assert re.fullmatch("[0-9a-f]{12}", commits[RESULTS / "limit"])


def git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=RESULTS.parent, capture_output=True, text=True, check=True)
    return done.stdout


def published_settings(text: str) -> dict[str, Any]:
    """A study file without the profiles that no published results are of."""
    content = tomllib.loads(text)
    profiles = {name: settings for name, settings in content.get("profiles", {}).items() if name not in SMALLER}
    return content | {"profiles": profiles}


@pytest.mark.skipif(not (RESULTS.parent / ".git").exists(), reason="needs the history")
def test_since_the_commit_of_the_results_only_texts_and_pages_and_smaller_profiles_have_changed():
    if git("rev-parse", "--is-shallow-repository").strip() == "true":
        pytest.skip("needs the whole history")
    commit = read_manifest(RESULTS / "limit")["commit"]
    assert subprocess.run(["git", "merge-base", "--is-ancestor", commit, "HEAD"], cwd=RESULTS.parent).returncode == 0
    changed = git("diff", "--name-only", commit, "HEAD", "--", "snakebench", "studies", "examples").splitlines()
    others = {name for name in changed if not any(fnmatch(name, kind) for kind in NO_NUMBERS)}
    studies = {name for name in others if fnmatch(name, "studies/*.toml")}
    assert others == studies
    for name in studies:
        then, now = git("show", f"{commit}:{name}"), (RESULTS.parent / name).read_text(encoding="utf-8")
        assert published_settings(then) == published_settings(now), name


def test_the_time_of_every_study_and_of_every_training_is_recorded():
    for name in STUDIES:
        manifest, config = read_manifest(RESULTS / name), study_config(study_settings(study_path(name)))
        trained = manifest["training_seconds"]
        assert manifest["seconds"] > 0 and all(0 < seconds < manifest["seconds"] for seconds in trained.values())
        jobs = config.training_jobs() if isinstance(config, LearningConfig) else []
        assert trained.keys() == {str(job) for job in jobs}, name
