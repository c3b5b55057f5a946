"""The adaptation study and its page, end to end on a small budget."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of

import snakebench as sb
import snakebench.execution
from snakebench.store import read_manifest
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

FLUIDS = ["water", "oil2"]
COURSES = {
    "still": {"along": "time", "knots": [0.0], "fluids": ["oil2"], "duration": 4.0},
    "step": {"along": "time", "knots": [0.0, 4.0], "fluids": FLUIDS, "between": "step", "duration": 10.0},
    "ramp": {"along": "time", "knots": [1.0, 2.0], "fluids": FLUIDS, "duration": 4.0},
    "edge": {"along": "x", "knots": [0.0, 0.2], "fluids": FLUIDS, "between": "step", "duration": 4.0},
}
SWIMMERS = ["student", "paper", "extended", "sea_snake"]
TABLES = ("steady", "courses", "switching", "recoveries", "traces", "contenders")


def config(**changes):
    settings = study_settings(study_path("adaptation"), "smoke") | {"name": "adaptation", "fluids": FLUIDS}
    small = {
        "courses": COURSES,
        "pilots": ["student"],
        "shown": ["student", "paper", "symmetric"],
        "found": {"waveforms": ""},
        "viscosities": 2,
    }
    return study_config(settings | small | changes)


@pytest.fixture(scope="module")
def tables(results):
    return {name: read_table(results / f"{name}.csv") for name in TABLES}


def test_everything_swims_in_every_fluid_and_over_viscosities(tables):
    counts = tables["steady"].groupby(["method", "tuned_to"]).size()
    assert counts.to_dict() == {("student", "adaptive"): 4} | {
        (method, tuned_to): 4 for method in SWIMMERS[1:] for tuned_to in (*FLUIDS, "integrated")
    }
    over = tables["steady"][tables["steady"]["fluid"].isna()]
    assert sorted(set(over["viscosity"])) == pytest.approx([1e-7, 1e-2])


def test_policies_and_gaits_for_all_swim_every_course_in_both_engines(tables):
    counts = tables["courses"].groupby(["course", "method", "engine", "physics_rate"]).size().to_dict()
    steps = [("pybullet", 960), ("pybullet", 480), ("planar", 90)]
    assert counts == {(course, method, *step): 1 for course in COURSES for method in SWIMMERS for step in steps}
    gaits = tables["courses"].query("method != 'student'")
    assert set(gaits["tuned_to"]) == {"integrated"}


def test_a_course_that_stays_as_it_is_is_a_plain_swim(tables, gait_of):
    row = tables["courses"].query("course == 'still' and method == 'paper' and variant == 'finer step'").iloc[0]
    gait = sb.SinusoidalTorque(**gait_of("integrated"))
    swim = sb.simulate(gait, fluid="oil2", physics_rate=960, duration=4.0)
    assert row["distance"] == swim.center[-1, 0] - swim.center[0, 0]
    powers = swim.command_work[-1] / 4, swim.positive_work[-1] / 4
    assert (row["speed"], row["power"], row["positive_power"]) == pytest.approx((row["distance"] / 4, *powers))


def test_the_ideal_of_a_course_that_stays_as_it_is_is_the_steady_speed(tables):
    steady = tables["steady"].query("fluid == 'oil2'").set_index(["method", "tuned_to"])["speed"]
    still = tables["courses"].query("course == 'still'")
    for row in still.to_dict("records"):
        assert row["ideal_distance"] == pytest.approx(4.0 * steady[row["method"], row["tuned_to"]])


def test_ideal_switching_takes_the_fastest_gait_of_a_kind(tables):
    steady = tables["steady"][tables["steady"]["tuned_to"].isin(FLUIDS)].dropna(subset="fluid")
    best = steady.groupby(["method", "fluid"])["speed"].max()
    switched = tables["switching"].set_index(["course", "method"])["distance"]
    for method in SWIMMERS[1:]:
        assert switched["still", method] == pytest.approx(4.0 * best[method, "oil2"])
        assert switched["step", method] == pytest.approx(4.0 * best[method, "water"] + 6.0 * best[method, "oil2"])


def test_ideal_switching_takes_both_powers_of_the_gait_that_it_takes(tables):
    steady = tables["steady"].query("fluid == 'oil2' and tuned_to in @FLUIDS")
    best = steady.loc[steady.groupby("method")["speed"].idxmax()].set_index("method")
    still = tables["switching"].query("course == 'still'").set_index("method")
    for name in ("power", "positive_power"):
        assert still[name].to_dict() == pytest.approx(best[name].to_dict())


def test_only_sudden_changes_in_time_have_recoveries(tables):
    found = tables["recoveries"]
    assert found[["course", "time", "from", "to"]].drop_duplicates().to_numpy().tolist() == [
        ["step", 4.0, "water", "oil2"]
    ]
    assert sorted(found["method"]) == sorted(SWIMMERS)
    assert found["held"].between(0, 1).all()


def test_a_trace_tells_the_fluid_that_is_met(tables):
    traces = tables["traces"].query("method == 'student'").set_index("course")
    water, oil2 = (sb.named_fluid(name).kinematic_viscosity for name in FLUIDS)
    np.testing.assert_allclose(traces.loc["step", "viscosity"], np.where(traces.loc["step", "time"] < 4, water, oil2))
    np.testing.assert_allclose(traces.loc["edge", "viscosity"], np.where(traces.loc["edge", "x"] < 0.2, water, oil2))
    middle = traces.loc["ramp"][traces.loc["ramp", "time"] == 1.5]["viscosity"]
    assert middle.iloc[0] == pytest.approx(np.sqrt(water * oil2))


def test_traces_add_up_to_the_way(tables):
    trace = tables["traces"].query("method == 'student' and course == 'step'")
    way = trace["x"].iloc[-1] - trace["x"].iloc[0]
    assert trace["speed"].mean() * (trace["time"].iloc[-1] - trace["time"].iloc[0]) == pytest.approx(way, rel=0.03)


def test_traces_add_up_to_the_works(tables):
    trace = tables["traces"].query("method == 'student' and course == 'step'")
    whole = tables["courses"].query("method == 'student' and course == 'step' and variant == 'finer step'").iloc[0]
    assert (trace["positive_power"] >= trace["power"]).all()
    for name in ("power", "positive_power"):
        assert trace[name].mean() == pytest.approx(whole[name], rel=0.1)  # but for half a second at either end


def test_what_is_asked_for_never_exceeds_what_is_expected(counted, results):
    assert all(done <= total for done, total in counted)
    assert counted[-1][0] == counted[-1][1] == read_manifest(results)["evaluations"]


def test_again_nothing_is_simulated_anew_and_all_bytes_are_equal(results, monkeypatch):
    monkeypatch.setattr(snakebench.execution, "simulate", lambda *_, **__: pytest.fail("a swim is simulated again"))
    before = {path.name: path.read_bytes() for path in [*results.glob("*.csv"), *results.glob("trajectories/*")]}
    again = run_study(config(), results.parent, workers=1)
    assert {path.name: path.read_bytes() for path in [*again.glob("*.csv"), *again.glob("trajectories/*")]} == before
    assert read_manifest(again)["computed"] == 0


def test_the_runs_shown_are_those_asked_for(results):
    shown = {path.stem for path in (results / "trajectories").iterdir()}
    assert shown == {f"{course}-{method}" for course in COURSES for method in ("student", "paper")}  # of those compared
    assert sb.Trajectory.load(results / "trajectories" / "step-student.npz").rate == 30


def test_recoveries_are_listed_by_seed_and_those_that_never_came_are_counted(results):
    row = {"course": "step", "method": "student", "tuned_to": "adaptive", "time": 4.0, "from": "water", "to": "oil2"}
    seeds = [{"seconds": 1.0, "held": 1.0}, {"seconds": 3.0, "held": 0.5}, {"seconds": np.nan, "held": 0.0}]
    made_up = pd.DataFrame([row | {"seed": k, "steady_speed": 0.2} | seed for k, seed in enumerate(seeds)])
    table = page_of(results, recoveries=made_up)["recoveries"]
    assert [cells(table, name)[table.rows[0][0]] for name in ("n", "each", "never")] == ["3", "1.00, 3.00", "1"]


def test_distances_are_shares_of_the_own_ideal_and_of_ideal_switching(results, tables):
    own = tables["courses"].query("course == 'still' and method == 'student' and variant == 'finer step'")
    seeds = [own.assign(seed=k, distance=distance, ideal_distance=10.0) for k, distance in enumerate((8.0, 9.0))]
    switching = pd.DataFrame([{"course": "still", "method": "paper", "distance": 5.0, "speed": 1.0, "power": 7.0}])
    others = tables["courses"].query("course != 'still' or method != 'student'")
    fine = page_of(results, courses=pd.concat([*seeds, others]), switching=switching)["findings"]["fine"]
    shown = fine.query("course == 'still' and method == 'student'")
    assert shown["of_own_ideal"].tolist() == pytest.approx([0.8, 0.9])
    assert shown["of_paper"].tolist() == pytest.approx([1.6, 1.8])


def test_a_page_is_made_of_what_is_there(results, tables):
    whole = page_of(results)
    assert whole["switching"].rows and whole["recoveries"].rows
    alone = {name: table[table["method"] == "student"] for name, table in tables.items()}
    page = page_of(results, **alone | {"switching": tables["switching"][:0]})
    assert not page["switching"].rows
    assert {row[0].split(",")[0] for course in page["courses"].values() for row in course["table"].rows} == {"student"}
    page = page_of(results, recoveries=tables["recoveries"][:0], traces=tables["traces"][:0])
    assert not page["recoveries"].rows and all(course["figure"] is None for course in page["courses"].values())
    gone = tables["courses"].assign(status="diverged", distance=np.nan, speed=np.nan)
    assert page_of(results, courses=gone)["failed"] == {"diverged": 16}
