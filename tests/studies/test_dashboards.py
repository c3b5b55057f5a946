"""What dashboards of others open: searches as Optuna studies, trainings as TensorBoard's scalars."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import optuna
import pandas as pd
import pytest
from optuna.trial import TrialState
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tensorboard.backend.event_processing.event_multiplexer import EventMultiplexer

import snakebench as sb
from snakebench.errors import InvalidValue, StoreError
from snakebench.learning.resume import TrainingFolder
from snakebench.learning.settings import Training
from snakebench.learning.training import train
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config
from snakebench.studies.samplers import Search, StoredStudies

BUDGET = {
    "fluids": ["water", "oil2"],
    "engine": "planar",
    "physics_rate": 90,
    "trials": 8,
    "batch": 4,
    "verify": "planar",
}
COMPARED = {"compared": ["tpe", "cmaes"], "compared_rate": 120}


def config(**changes):
    settings = study_settings(study_path("quickstart"), "smoke") | BUDGET | COMPARED
    return study_config(settings | {"seeds": [0, 1], "duration": 1.0} | changes)


def tables(directory):
    return {path.name: path.read_bytes() for path in directory.glob("*.csv")}


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Results of a study, and the file of its Optuna studies."""
    here = tmp_path_factory.mktemp("stored")
    return run_study(config(), here / "results", workers=1, optuna=here / "studies.db"), here / "studies.db"


def opened(path):
    url = f"sqlite:///{path}"
    return {name: optuna.load_study(study_name=name, storage=url) for name in optuna.get_all_study_names(url)}


def test_there_is_a_study_of_each_objective_seed_and_sampler_that_maximises(stored):
    studies = opened(stored[1])
    searches = [("tpe", "planar90"), ("tpe", "planar120"), ("cmaes", "planar120")]
    assert set(studies) == {
        f"{config().name}-{objective}-{sampler}-seed{seed}-{engine}"
        for objective in ("water", "oil2", "mean")
        for seed in (0, 1)
        for sampler, engine in searches
    }
    assert {tuple(study.metric_names) for study in studies.values()} == {("return J",)}
    assert {study.direction for study in studies.values()} == {optuna.study.StudyDirection.MAXIMIZE}
    assert studies[f"{config().name}-mean-tpe-seed0-planar90"].user_attrs["fluids"] == ["water", "oil2"]


@pytest.mark.parametrize(("table", "engine"), [("trials", "planar90"), ("samplers", "planar120")])
def test_its_trials_are_the_rows_of_the_table(stored, table, engine):
    rows = pd.read_csv(stored[0] / f"{table}.csv").drop_duplicates(["objective", "seed", "trial"])
    rows = rows[rows.get("sampler", "tpe") == "tpe"] if table == "samplers" else rows
    studies = opened(stored[1])
    for (objective, seed), group in rows.groupby(["objective", "seed"]):
        trials = studies[f"{config().name}-{objective}-tpe-seed{seed}-{engine}"].trials
        assert [trial.number for trial in trials] == group["trial"].tolist() == list(range(8))
        assert [trial.value for trial in trials] == group["value"].tolist()
        for name, bounds in sb.SeaSnake.SPACE.items():
            assert [trial.params[name] for trial in trials] == group[name].tolist()
            assert {(trial.distributions[name].low, trial.distributions[name].high) for trial in trials} == {bounds}


def test_gaits_that_are_worth_nothing_are_failed_trials(tmp_path):
    with closing(StoredStudies(tmp_path / "s.db")) as studies:
        search = Search("tpe", 0, 4, {"x": (0.0, 1.0)}, studies.begin("failing", "x"))
        gaits = search.ask(4)
        search.tell([1.0, None, 2.0, None])
    trials = opened(tmp_path / "s.db")["failing"].trials
    assert [trial.state for trial in trials] == [TrialState.COMPLETE, TrialState.FAIL] * 2
    assert [trial.params for trial in trials] == gaits
    assert [trial.value for trial in trials] == [1.0, None, 2.0, None]


def test_what_is_stored_changes_neither_the_course_of_the_search_nor_the_tables(stored, tmp_path):
    assert tables(run_study(config(), tmp_path, workers=1)) == tables(stored[0])


@pytest.mark.slow
def test_a_rerun_replaces_studies_of_the_same_name_and_leaves_others(stored, tmp_path):
    shutil.copytree(stored[0].parent, tmp_path / "results")
    path = shutil.copy(stored[1], tmp_path / "s.db")
    optuna.create_study(study_name="somebody else's", storage=f"sqlite:///{path}")
    before = {name: [trial.params for trial in study.trials] for name, study in opened(path).items()}
    results = run_study(config(), tmp_path / "results", workers=1, optuna=path)
    assert {name: [trial.params for trial in study.trials] for name, study in opened(path).items()} == before
    assert tables(results) == tables(stored[0])


@pytest.mark.slow
def test_a_study_that_was_stopped_is_stored_whole_when_it_is_run_again(stored, tmp_path, monkeypatch):
    tell, told = Search.tell, []

    def tell_three(self, values):
        if len(told) == 3:  # in the middle of the second search
            raise KeyboardInterrupt
        told.append(tell(self, values))

    with monkeypatch.context() as patch:
        patch.setattr(Search, "tell", tell_three)
        with pytest.raises(KeyboardInterrupt):
            run_study(config(), tmp_path / "results", workers=1, optuna=tmp_path / "s.db")
    assert [len(study.trials) for study in opened(tmp_path / "s.db").values()] == [8, 4]
    results = run_study(config(), tmp_path / "results", workers=1, optuna=tmp_path / "s.db")
    assert tables(results) == tables(stored[0])
    assert {name: [t.value for t in study.trials] for name, study in opened(tmp_path / "s.db").items()} == {
        name: [t.value for t in study.trials] for name, study in opened(stored[1]).items()
    }


def test_other_tables_in_sqlite_are_not_touched(tmp_path):
    path = tmp_path / "cache.sqlite"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE evaluations (key TEXT)")
    before = path.read_bytes()
    with pytest.raises(InvalidValue, match="no storage of Optuna"):
        StoredStudies(path)
    assert path.read_bytes() == before


def test_a_storage_of_another_version_of_optuna_is_refused_in_a_line(tmp_path):
    StoredStudies(tmp_path / "s.db").close()
    with closing(sqlite3.connect(tmp_path / "s.db")) as database:
        database.execute("UPDATE alembic_version SET version_num = 'v9.9.9.a'")
        database.commit()
    with pytest.raises(StoreError, match="cannot write Optuna's studies to"):
        StoredStudies(tmp_path / "s.db")


def test_bad_paths_are_refused_in_a_line_with_code_2_before_anything_is_run(snakebench_command, tmp_path):
    (tmp_path / "text.db").write_text("no database " * 1000)
    (tmp_path / "folder").mkdir()
    for path, reason in {
        "missing/s.db": "missing is not a directory",
        "folder": "not a regular file",
        "text.db": "no storage of Optuna",
        "sqlite:///s.db": "no URL",
    }.items():
        code, out, err = snakebench_command("run-study", "quickstart", "--profile", "smoke", "--optuna", path)
        assert code == 2 and reason in err and err.count("\n") == 1 and not out
    assert not (tmp_path / "results").exists()


def test_studies_without_optuna_refuse_the_flag_in_a_line(snakebench_command, tmp_path):
    code, _, err = snakebench_command("run-study", "validation", "--profile", "smoke", "--optuna", "s.db")
    assert code == 2 and err.count("\n") == 1
    assert "optuna = s.db: validation does not search with Optuna; sea_snake does" in err
    assert not (tmp_path / "s.db").exists() and not (tmp_path / "results").exists()


@pytest.mark.slow
def test_the_command_says_how_to_open_the_studies(snakebench_command, tmp_path):
    words = ("--profile", "smoke", "--engine", "planar", "--workers", "1", "--optuna", "s.db")
    code, out, _ = snakebench_command("run-study", "quickstart", *words)
    assert code == 0 and out.endswith(f"studies: optuna-dashboard sqlite:///{tmp_path}/s.db\n")
    assert [len(study.trials) for study in opened(tmp_path / "s.db").values()] == [4] * 4


def scalars(folder, name):
    """Step and value of every row that TensorBoard shows; those written in one second may be read in another order."""
    shown = EventAccumulator(str(folder / "tensorboard")).Reload()
    return sorted((scalar.step, scalar.value) for scalar in shown.Scalars(name))


TRAINING = Training(steps=600, members=4, rollout=24, lstm=(8,), duration=1.0, checkpoints=3)


def test_tensorboard_shows_every_row_of_a_trainings_log(tmp_path):
    train(TRAINING, 0, tmp_path / "teacher-0")
    log = pd.read_csv(tmp_path / "teacher-0" / "log.csv")
    shown = EventAccumulator(str(tmp_path / "teacher-0" / "tensorboard")).Reload()
    assert set(shown.Tags()["scalars"]) == set(log) >= {"return_mean", "speed_water", "value_loss", "learning_rate"}
    for name, column in log.items():
        found = scalars(tmp_path / "teacher-0", name)
        assert [step for step, _ in found] == log["steps"][column.notna()].tolist()
        assert [value for _, value in found] == pytest.approx(column.dropna().tolist(), rel=1e-6)  # in 32 bits


def test_a_training_that_goes_on_is_one_curve(tmp_path, monkeypatch):
    keep, kept = TrainingFolder.write, []

    def keep_one(self, *args):
        if kept:
            raise KeyboardInterrupt
        kept.append(keep(self, *args))

    with monkeypatch.context() as patch:
        patch.setattr(TrainingFolder, "write", keep_one)
        with pytest.raises(KeyboardInterrupt):
            train(TRAINING, 0, tmp_path / "a")
    train(TRAINING, 0, tmp_path / "a")
    steps = pd.read_csv(tmp_path / "a" / "log.csv")["steps"].tolist()
    assert [step for step, _ in scalars(tmp_path / "a", "speed_water")] == steps


def test_a_training_that_begins_anew_takes_the_old_curve_back(tmp_path):
    train(TRAINING.but(steps=900), 1, tmp_path / "a")
    (tmp_path / "a" / "policy.safetensors").unlink()
    (tmp_path / "a" / "checkpoint.pt").write_bytes(b"half a checkpoint")
    train(TRAINING, 0, tmp_path / "a")
    log = pd.read_csv(tmp_path / "a" / "log.csv")
    found = scalars(tmp_path / "a", "speed_water")
    assert [value for _, value in found] == pytest.approx(log["speed_water"].tolist(), rel=1e-6)


def test_the_trainings_of_a_study_are_runs_that_tensorboard_finds(tmp_path):
    small = {"steps": 100, "members": 4, "rollout": 24, "lstm": [8], "checkpoints": 1}
    settings = study_settings(study_path("teacher_student"), "smoke") | {
        "training": small,
        "policies": {"teacher": {}},
        "only": [],
        "published": [],
        "left_out": [],
        "shown": [],
        "seeds": [0],
        "fluids": ["water"],
        "duration": 1.0,
        "viscosities": 2,
    }
    results = run_study(study_config(settings), tmp_path / "results", workers=1).parent
    logs = Path(results) / ".cache" / "training"
    runs = EventMultiplexer().AddRunsFromDirectory(str(logs)).Reload().Runs()
    (name,) = runs
    assert name.startswith("teacher-0-") and "speed_water" in runs[name]["scalars"]
