"""The adaptation study and its page, end to end on a small budget."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of
from writing import list_files, write_manifest, write_table

import snakebench as sb
import snakebench.execution
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.metrics import stored_energy
from snakebench.studies.adaptation.run import limit_fronts
from snakebench.studies.adaptation.settings import Course
from snakebench.studies.adaptation.swimmers import candidates, preferred
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
GAITS = ["paper", "extended", "sea_snake", "fourier"]  # compared over viscosity
SINGLE = ["extended", "fourier"]  # methods of which many gaits are tried
PREFERRED = ["student_3_W", "imitator_3_W"]
SWIMMERS = ["student", *PREFERRED, *GAITS]
TABLES = ("steady", "courses", "switching", "recoveries", "traces", "ideal", "worth", "contenders")
PRICES = {0.01: 9.0, 0.3: 3.2, 3.0: 0.1}  # of power [1/W], and mean powers of policies with a preference [W]
LIMIT = {"water": 0.1, "oil2": 0.05}  # v / P of the limit up to 20 W [m/s/W]


def config(**changes):
    settings = study_settings(study_path("adaptation"), "smoke") | {"name": "adaptation", "fluids": FLUIDS}
    small = {
        "courses": COURSES,
        "pilots": ["student"],
        "shown": ["student", "paper", "fourier", "symmetric"],
        "contenders": {},
        "viscosities": 2,
        "preferred": {"learned_front": ["student"], "imitation": ["imitator"]},
        "limit": "limit",
        "worth": {"fluids": [FLUIDS, ["oil2"]], "powers": [1.0, 3.0, 300.0]},
    }
    return study_config(settings | small | changes)


@pytest.fixture(scope="module")
def run(tmp_path_factory, write_contenders, run_counted):
    results = write_contenders(tmp_path_factory.mktemp("adaptation"))
    write_front_of_waveforms(results / "fourier")
    write_preferred(results / "learned_front", "student")
    write_preferred(results / "imitation", "imitator")
    write_limit(results / "limit")
    return run_counted(config(), results)


def write_front_of_waveforms(directory):
    """A weak and a strong waveform on the front of each fluid and of all."""
    rows = [
        {"space": "fourier", "front": tuned_to, "currency": "net", "tuned_to": tuned_to, "harmonics": harmonics}
        | {"objective": "return", "price": np.nan, "seed": 0.0, "power": power}
        for tuned_to in ("water", "oil1", "oil2", "integrated")
        for harmonics, power in ((1.0, 1.0), (2.0, 5.0))
    ]
    write_table(directory / "fronts.csv", pd.DataFrame(rows))
    list_files(directory)


def write_preferred(directory, policy):
    """A preference-conditioned student of the committed results by any name, and made-up mean powers at its prices."""
    (directory / "policies").mkdir(parents=True)
    published = Path(__file__).parents[2] / "results" / "learned_front" / "policies" / "student-10.safetensors"
    (directory / "policies" / f"{policy}-0.safetensors").write_bytes(published.read_bytes())
    rows = [
        {"policy": policy, "seed": 0, "price": price, "variant": "finer step", "status": "ok", "power": power + more}
        for price, power in PRICES.items()
        for more in (-0.05, 0.05)
    ]
    write_table(directory / "dial.csv", pd.DataFrame(rows))
    write_manifest(directory, {"commit": "abc", "config": {"robot": sb.Robot().model_dump(mode="json")}})


def write_limit(directory, **robot):
    """A limit whose speed is proportional to its power, of one currency."""
    directory.mkdir()
    rows = [
        {
            "viscosity": sb.named_fluid(name).kinematic_viscosity,
            "currency": "net",
            "bounds": "policies",
            "bound": 1.0,
            "speed_limit": np.nan,
        }
        | {"power": power, "positive_power": power, "speed": slope * power}
        for name, slope in LIMIT.items()
        for power in np.geomspace(10.0, 20.0, 41).tolist()
    ]
    write_table(directory / "limit.csv", pd.DataFrame(rows))
    write_table(directory / "gaits.csv", pd.DataFrame({"fluid": [*LIMIT]}))
    write_manifest(directory, {"commit": "abc", "config": {"robot": sb.Robot(**robot).model_dump(mode="json")}})


@pytest.fixture(scope="module")
def tables(results):
    return {name: read_table(results / f"{name}.csv") for name in TABLES}


@pytest.fixture(scope="module")
def fine(tables):
    """The swims of the courses as they are published."""
    return tables["courses"].query("variant == 'finer step'")


def test_everything_that_is_compared_swims_in_every_fluid_and_over_viscosities(tables):
    compared = tables["steady"][tables["steady"]["gait"].isna() & ~tables["steady"]["method"].isin(PREFERRED)]
    assert compared.groupby(["method", "tuned_to"]).size().to_dict() == {("student", "adaptive"): 4} | {
        (method, tuned_to): 4 for method in GAITS for tuned_to in (*FLUIDS, "integrated")
    }
    assert sorted(set(compared.loc[compared["fluid"].isna(), "viscosity"])) == pytest.approx([1e-7, 1e-2])


def test_others_on_the_courses_swim_in_the_fluids_only(tables):
    others = tables["steady"][tables["steady"]["gait"].notna() | tables["steady"]["method"].isin(PREFERRED)]
    counts = others.groupby(["method", "gait"], dropna=False).size()
    assert set(counts) == {2} and {method for method, _ in counts.index} == {*PREFERRED, *SINGLE}


def test_policies_and_single_gaits_swim_every_course_in_both_engines(tables):
    swims = tables["courses"]
    steps = swims.groupby(["course", "method", "gait"], dropna=False)[["engine", "physics_rate"]]
    for (course, method, _), part in steps:
        assert course in COURSES and method in SWIMMERS
        assert part.to_numpy().tolist() == [["pybullet", 960], ["pybullet", 480], ["planar", 180]]
    assert set(zip(swims["course"], swims["method"], strict=True)) == {(c, m) for c in COURSES for m in SWIMMERS}


def test_no_single_gait_is_dominated_in_both_currencies_by_another_of_its_method(tables):
    planar = tables["courses"].query("variant == 'planar'").dropna(subset="gait")
    for _, part in planar.groupby(["course", "method"]):
        for row in part.to_dict("records"):
            better = part[part["distance"] > row["distance"]]
            assert any((better[power] > row[power]).all() for power in ("power", "positive_power"))


def test_a_preference_is_that_of_the_nearest_mean_power_over_the_fluids(tables):
    row = tables["contenders"].query("method == 'student_3_W'").iloc[0]
    assert row["price"] == 0.3
    assert tables["contenders"].query("method == 'student'")["price"].isna().all()


def test_a_policy_that_has_no_preference_is_refused(tmp_path):
    write_preferred(tmp_path / "imitation", "imitator")
    settings = config(preferred={"imitation": ["emulator"]})
    with pytest.raises(InvalidValue, match="has no policy emulator with an adjustable preference"):
        preferred(settings, tmp_path)


def test_every_single_gait_is_listed_with_its_digest(tables):
    listed = tables["contenders"].dropna(subset="gait")
    swum = tables["courses"].dropna(subset="gait")
    names = ["method", "tuned_to", "gait"]
    assert set(map(tuple, swum[names].to_numpy())) == set(map(tuple, listed[names].to_numpy()))
    assert listed["digest"].is_unique


def test_in_one_fluid_the_limit_gets_as_far_as_its_steady_speed(fine):
    still = fine.query("course == 'still' and 0 < power < 20")
    assert len(still) >= 3
    np.testing.assert_allclose(still["ideal_net"], 4.0 * LIMIT["oil2"] * still["power"], rtol=1e-4)


def test_in_two_fluids_the_limit_spends_its_power_where_a_watt_is_worth_more(fine):
    step = fine.query("course == 'step' and 0 < power < 8")  # 20 W in water alone are a mean of 8 W
    assert len(step) >= 3
    np.testing.assert_allclose(step["ideal_net"], 10.0 * LIMIT["water"] * step["power"], rtol=1e-4)


def test_a_currency_without_a_limit_has_no_ideal(fine, tables):
    assert fine["ideal_positive"].isna().all() and set(tables["ideal"]["currency"]) == {"net"}


def test_a_limit_of_another_robot_is_refused(tmp_path):
    assert limit_fronts(config(), tmp_path) == {"net": None, "positive": None}
    write_limit(tmp_path / "limit", diameter=0.2)
    with pytest.raises(InvalidValue, match="is of another robot"):
        limit_fronts(config(), tmp_path)


def test_in_one_fluid_tuning_is_worth_nothing_and_in_two_it_is_never_a_loss(tables):
    worth = tables["worth"].dropna(subset="gain")
    by_set = dict(iter(worth.groupby("fluids")["gain"]))
    np.testing.assert_allclose(by_set["oil2"], 0.0, atol=1e-12)
    assert (by_set["water / oil2"] >= -1e-12).all() and by_set["water / oil2"].max() > 0


def test_what_no_single_gait_can_use_is_not_compared(tables):
    beyond = tables["worth"].query("power == 300")
    assert len(beyond) and beyond[["single_speed", "gain", "limit_speed"]].isna().all(axis=None)


def test_a_course_that_stays_as_it_is_is_a_plain_swim(tables, gait_of):
    row = tables["courses"].query("course == 'still' and method == 'paper' and variant == 'finer step'").iloc[0]
    gait = sb.SinusoidalTorque(**gait_of("integrated"))
    swim = sb.simulate(gait, fluid="oil2", physics_rate=960, duration=4.0)
    assert row["distance"] == swim.center[-1, 0] - swim.center[0, 0]
    stored = stored_energy(swim)
    powers = (swim.command_work[-1] - stored[-1] + stored[0]) / 4, swim.positive_work[-1] / 4
    assert (row["speed"], row["power"], row["positive_power"]) == pytest.approx((row["distance"] / 4, *powers))


def test_the_ideal_of_a_course_that_stays_as_it_is_is_the_steady_speed(tables):
    steady = tables["steady"].query("fluid == 'oil2' and gait.isna()").set_index(["method", "tuned_to"])["speed"]
    still = tables["courses"].query("course == 'still'").dropna(subset="ideal_distance")
    assert {"student", "paper"} <= set(still["method"])
    for row in still.to_dict("records"):
        assert row["ideal_distance"] == pytest.approx(4.0 * steady[row["method"], row["tuned_to"]])


def test_ideal_switching_takes_the_fastest_gait_of_a_kind(tables):
    steady = tables["steady"].query("tuned_to in @FLUIDS and gait.isna()").dropna(subset="fluid")
    best = steady.groupby(["method", "fluid"])["speed"].max()
    switched = tables["switching"].set_index(["course", "method"])["distance"]
    for method in GAITS:
        assert switched["still", method] == pytest.approx(4.0 * best[method, "oil2"])
        assert switched["step", method] == pytest.approx(4.0 * best[method, "water"] + 6.0 * best[method, "oil2"])


def test_ideal_switching_takes_both_powers_of_the_gait_that_it_takes(tables):
    steady = tables["steady"].query("fluid == 'oil2' and tuned_to in @FLUIDS and gait.isna()")
    best = steady.loc[steady.groupby("method")["speed"].idxmax()].set_index("method")
    still = tables["switching"].query("course == 'still'").set_index("method")
    for name in ("power", "positive_power"):
        assert still[name].to_dict() == pytest.approx(best[name].to_dict())


def test_only_sudden_changes_in_time_have_recoveries(tables):
    found = tables["recoveries"]
    assert found[["course", "time", "from", "to"]].drop_duplicates().to_numpy().tolist() == [
        ["step", 4.0, "water", "oil2"]
    ]
    assert set(found["method"]) == set(SWIMMERS)
    assert found["held"].between(0, 1).all()


@pytest.mark.parametrize(
    ("knots", "before", "after"),
    [((0.0, 20.0, 40.0), "water", "oil1"), ((-5.0, -1.0, 20.0), "oil1", "oil2")],
)
def test_changes_before_or_after_the_swim_have_no_recovery(knots, before, after):
    course = Course(knots=knots, fluids=("water", "oil1", "oil2"), between="step", duration=30.0)
    assert list(course.stretches()) == [(before, after, 20.0, 30.0)]


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
    assert shown == {f"{course}-{method}" for course in COURSES for method in ("student", "paper", "fourier")}
    assert sb.Trajectory.load(results / "trajectories" / "step-student.npz").rate == 30


def test_recoveries_are_listed_by_seed_and_those_that_never_came_are_counted(results, tables):
    row = {"course": "step", "method": "student", "tuned_to": "adaptive", "time": 4.0, "from": "water", "to": "oil2"}
    seeds = [{"seconds": 1.0, "held": 1.0}, {"seconds": 3.0, "held": 0.5}, {"seconds": np.nan, "held": 0.0}]
    made_up = pd.DataFrame([row | {"seed": k, "steady_speed": 0.2, "loss": 0.0} | seed for k, seed in enumerate(seeds)])
    own = tables["courses"].query("course == 'step' and method == 'student'")
    courses = pd.concat([*(own.assign(seed=k) for k in range(3)), tables["courses"].drop(own.index)])
    table = page_of(results, courses=courses, recoveries=made_up)["recoveries"]
    assert [cells(table, name)[table.rows[0][0]] for name in ("n", "each", "never")] == ["3", "1.00, 3.00", "1"]


def test_distances_are_shares_of_the_own_ideal(results, tables):
    own = tables["courses"].query("course == 'still' and method == 'student' and variant == 'finer step'")
    seeds = [own.assign(seed=k, distance=distance, ideal_distance=10.0) for k, distance in enumerate((8.0, 9.0))]
    others = tables["courses"].query("course != 'still' or method != 'student'")
    fine = page_of(results, courses=pd.concat([*seeds, others]))["findings"]["fine"]
    shown = fine.query("course == 'still' and method == 'student'")
    assert shown["of_own_ideal"].tolist() == pytest.approx([0.8, 0.9])


@pytest.mark.slow
def test_a_page_is_made_of_what_is_there(results, tables):
    whole = page_of(results)
    assert whole["switching"].rows and whole["recoveries"].rows
    alone = {name: table[table["method"] == "student"] for name, table in tables.items() if "method" in table}
    page = page_of(results, **alone | {"switching": tables["switching"][:0], "worth": tables["worth"][:0]})
    assert not page["switching"].rows and not page["worth"]["net"].rows
    assert {row[0].split(",")[0] for course in page["courses"].values() for row in course["table"].rows} == {"student"}
    page = page_of(results, recoveries=tables["recoveries"][:0], traces=tables["traces"][:0])
    assert not page["recoveries"].rows and all(course["figure"] is None for course in page["courses"].values())
    gone = tables["courses"].assign(status="diverged", distance=np.nan, speed=np.nan)
    assert page_of(results, courses=gone)["failed_courses"] == {
        "diverged": (tables["courses"]["variant"] == "finer step").sum()
    }


@pytest.mark.slow
def test_a_page_without_the_limit_names_the_command_that_computes_it(results, tables):
    assert page_of(results)["limit_missing"] is None
    assert page_of(results, ideal=tables["ideal"][:0])["limit_missing"] == "snakebench run-study limit"


def test_gains_are_shown_in_each_currency_beside_the_best_single_gaits(results):
    gains = page_of(results)["gains"]
    assert list(gains) == ["P", "P+"]
    for table in gains.values():
        assert {"single wider sinusoid [m]", "single free waveform [m]"} <= set(table.head)
        assert {"step, student", "step, single free waveform"} <= {row[0] for row in table.rows}


def test_gaits_of_the_limit_for_any_viscosity_are_candidates_for_the_best_single_gait():
    published = Path(__file__).parents[2] / "results"
    none = dict.fromkeys(("policies", "sinusoids", "sea_snakes", "waveforms"), "")
    tried = candidates(config(contenders=none | {"limit": "limit"}, candidates=3), published)
    limit = read_table(published / "limit" / "limit.csv").query("bounds == 'policies' and 0.3 <= power < 30")
    assert {one.method for one in tried} == {"limit"}
    assert {*FLUIDS, "1e-07 m²/s", "0.01 m²/s"} <= {one.tuned_to for one in tried}
    assert 2 < len(tried) / len(limit.groupby(["viscosity", "currency"])) <= 3
    assert [one.gait for one in tried] == list(range(len(tried)))
    assert len({one.controller.digest() for one in tried}) == len(tried)
