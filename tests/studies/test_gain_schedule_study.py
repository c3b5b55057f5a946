"""Gain schedules in a study: trained, swum on a front, kept, and learned again if damaged."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from snakebench.errors import InvalidValue
from snakebench.site import write_report
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

PUBLISHED = Path(__file__).parents[2] / "results"
SCHEDULE = {
    "demonstrations": "limit",
    "estimator": 200,
    "randomisation": {"prices": [0.1, 1.0], "viscosities": [1e-6, 1.5e-6]},  # water only
}


def config(**changes):
    own = {"name": "schedules", "method": "learned_front", "profile": "full", "question": "?", "fluids": ["water"]}
    own |= {"currencies": ["net"], "seeds": [0, 1], "positions": 2, "swims": 2, "duration": 4.0, "published": []}
    return study_config(own | {"policies": {"schedule": SCHEDULE}} | changes)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    root = tmp_path_factory.mktemp("schedules") / "results"
    shutil.copytree(PUBLISHED / "limit", root / "limit")
    path = root / "limit" / "limit.csv"
    read_table(path).query("allowed in (1.0, 10.0)").to_csv(path, index=False)  # a few gaits, which are soon swum
    return run_study(config(), root, workers=1)


def test_every_seed_swims_at_every_price(results):
    dial = read_table(results / "dial.csv").query("variant == 'finer step'")
    assert dial.groupby("seed").size().to_dict() == {0: 2, 1: 2}
    assert (dial["speed"] > 0.1).all()
    cheap, dear = (dial[dial["price"] == price]["power"].mean() for price in sorted(set(dial["price"])))
    assert dear < cheap


def test_the_error_of_the_estimate_is_of_swims_in_all_fluids(results):
    errors = read_table(results / "curves.csv").set_index("seed")["error"]
    assert errors[0] != errors[1]
    assert (errors < 1.2).all()  # a guess of the mean of five decades has an error of 1.4


def test_the_page_shows_the_errors_and_the_share_of_the_limit(results, tmp_path):
    text = write_report(results, tmp_path).read_text()
    assert "Root mean square error of the estimate" in text and "as a share of the limit" in text


DAMAGE = {
    "cut": lambda path: path.write_bytes(path.read_bytes()[:1000]),
    "flipped": lambda path: path.write_text(path.read_text().replace("0.1", "0.2", 1)),
    "without a log": lambda path: path.with_name("log.csv").unlink(),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_schedule_is_learned_again(results, damage, capfd):
    before = {path.name: path.read_bytes() for path in results.glob("*.csv")}
    path = min((results.parent / ".cache" / "training").glob("schedule-*/schedule.json"))
    DAMAGE[damage](path)
    run_study(config(), results.parent, workers=1)
    assert "what was learned is damaged" in "".join(capfd.readouterr())
    assert {path.name: path.read_bytes() for path in results.glob("*.csv")} == before


@pytest.mark.slow
def test_another_control_rate_is_that_of_the_schedule(results):
    policies = {"fast": SCHEDULE | {"control_rate": 60}}
    fast = run_study(config(name="fast", policies=policies, seeds=[0], planar_rate=120), results.parent, workers=1)
    assert (read_table(fast / "dial.csv")["status"] == "ok").all()


STUDENT = {"teacher": "schedule", "feels": ["sensors", "preference"], "randomisation": SCHEDULE["randomisation"]}
POSED = SCHEDULE | {"randomisation": SCHEDULE["randomisation"] | {"pose": 0.1}}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"policies": {"schedule": SCHEDULE, "student": STUDENT}},
            "its teacher 'schedule' imitates itself or is a gain schedule",
        ),
        ({"published": ["schedule"]}, "schedule is a gain schedule, whose file is not published"),
        ({"policies": {"schedule": SCHEDULE | {"lstm": [8]}}}, "lstm: a gain schedule has no such setting"),
        ({"policies": {"schedule": POSED}}, "randomisation.pose: a gain schedule has no such setting"),
    ],
)
def test_what_a_gain_schedule_cannot_do_is_refused(changes, told):
    with pytest.raises(InvalidValue, match=told):
        config(**changes)


def test_a_limit_of_another_robot_is_refused(results):
    other = {"schedule": SCHEDULE | {"robot": {"diameter": 0.08}}}
    with pytest.raises(InvalidValue, match="limit is of another robot than the policy"):
        run_study(config(name="other", policies=other), results.parent, workers=1)
