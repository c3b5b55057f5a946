"""The cross-environment study and its page, end to end on a small budget."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pages import cells, page_of

import snakebench as sb
import snakebench.studies
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.report import paper
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.cross.page import feedback, matrices, page
from snakebench.studies.published import published
from snakebench.studies.replays import replay, replays
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

FLUIDS = ["water", "oil2"]
GAIT = sb.SinusoidalTorque(amplitude=3.0, frequency=0.7, phase=0.84)


def config(**changes):
    settings = study_settings(study_path("cross"), "smoke") | {"name": "cross", "fluids": FLUIDS, "contenders": {}}
    return study_config(settings | changes)


@pytest.fixture(scope="module")
def matrix(results):
    return read_table(results / "matrix.csv")


def test_the_replay_of_a_sinusoid_is_that_sinusoid():
    swim = sb.simulate(GAIT, fluid="water", physics_rate=960, duration=6.0)
    played = replay(swim, GAIT.frequency)
    start = 6.0 - 1 / 960 - 2 / GAIT.frequency  # two periods before the last torque that was held
    times = np.linspace(0, 7, 500)
    bend = (2 * np.pi * GAIT.frequency / 960) ** 2 / 8 * GAIT.amplitude  # of a sine over a sample
    np.testing.assert_allclose(played.commands(times, 7), GAIT.commands(start + times, 7), atol=3 * bend)


def test_a_replayed_sinusoid_swims_as_the_sinusoid_itself():
    place = {"fluid": "oil1", "engine": "planar", "duration": 12.0}
    itself = sb.evaluate(GAIT, **place)
    replayed = sb.evaluate(replay(sb.simulate(GAIT, **place), GAIT.frequency), **place)
    assert (replayed.speed, replayed.power) == pytest.approx((itself.speed, itself.power), rel=2e-3)
    assert replayed.swim_frequency == pytest.approx(GAIT.frequency, rel=1e-3)


def test_the_replay_of_periodic_swimming_has_no_seam():
    gait = sb.SeaSnake(amplitude=0.8, frequency=0.6, phase=0.7)
    swim = sb.simulate(gait, fluid="oil1", engine="planar", physics_rate=240, duration=12.0)
    torque = np.array(replay(swim, gait.frequency).torque)
    steps = np.abs(np.diff(torque, axis=0)).max(axis=0)
    assert (np.abs(torque[0] - torque[-1]) <= 1.1 * steps).all()
    np.testing.assert_allclose(torque[: len(torque) // 2], torque[len(torque) // 2 :], atol=0.01 * np.ptp(torque))


def test_the_matrix_has_every_gait_in_every_fluid_at_two_rates(matrix):
    gaits = [("student", "closed", "adaptive")]
    gaits += [("student", "open", fluid) for fluid in FLUIDS]
    gaits += [
        (method, loop, fluid)
        for method in ("paper", "extended", "sea_snake", "fourier")
        for loop in ("closed", "open")
        for fluid in FLUIDS
    ]
    assert matrix.groupby(["method", "loop", "gait_of", "fluid", "physics_rate"]).size().to_dict() == {
        (*gait, fluid, rate): 1 + (gait[0] == "student") for gait in gaits for fluid in FLUIDS for rate in (480, 960)
    }


def test_a_row_is_what_a_published_policy_does(results, matrix):
    row = matrix.query("method == 'student' and loop == 'closed' and fluid == 'oil2' and physics_rate == 960").iloc[0]
    policy = sb.Policy.load(results.parent / "teacher_student" / "policies" / "student-0.safetensors")
    again = sb.evaluate(policy, fluid="oil2", physics_rate=960, duration=5.0)
    assert (row["speed"], row["power"]) == (again.speed, again.power)


def test_a_torque_gait_is_its_own_replay(matrix):
    own = matrix[
        (matrix["method"] == "paper") & (matrix["gait_of"] == matrix["fluid"]) & (matrix["physics_rate"] == 960)
    ]
    by_loop = own.pivot(index="fluid", columns="loop", values="power")
    np.testing.assert_allclose(by_loop["open"], by_loop["closed"], rtol=0.02)  # 5 s from rest, begun elsewhere in time


def test_what_is_asked_for_never_exceeds_what_is_expected(counted, results):
    assert all(done <= total for done, total in counted)
    assert counted[-1][0] == counted[-1][1] == read_manifest(results)["evaluations"]


def test_what_was_read_is_noted_and_every_swim_and_recording_is_counted(results):
    assert set(read_manifest(results)["read"]) == {"teacher_student", "pareto", "sea_snake", "fourier"}
    assert read_manifest(results)["evaluations"] == len(read_table(results / "matrix.csv")) + 2 * 6


@pytest.mark.slow
def test_again_nothing_is_computed_and_all_bytes_are_equal(results):
    before = {path.name: path.read_bytes() for path in [*results.glob("*.csv"), *results.glob("trajectories/*")]}
    again = run_study(config(), results.parent, workers=1)
    assert {path.name: path.read_bytes() for path in [*again.glob("*.csv"), *again.glob("trajectories/*")]} == before
    assert read_manifest(again)["computed"] == 0


def test_the_runs_shown_are_the_policys_and_its_replays(results):
    shown = {path.stem for path in (results / "trajectories").iterdir()}
    own = {f"{method}-{fluid}" for method in ("student", "paper") for fluid in FLUIDS}
    assert shown == own | {f"replayed-{gait}-{fluid}" for gait in FLUIDS for fluid in FLUIDS}
    assert sb.Trajectory.load(results / "trajectories" / "student-water.npz").rate == 30


def test_the_limit_is_the_reference_of_every_swim_at_its_own_power():
    study = published(Path(__file__).parents[2] / "results" / "cross")
    swims = study.tables["matrix"].query("method == 'student' and variant == 'finer step' and fluid == 'oil2'")
    replays = swims.query("loop == 'open' and gait_of == 'water'")
    reached = [row.speed / sb.limit("oil2", row.power).speed for row in replays.itertuples()]
    shown = cells(page(study)["of_limit"], "water's gait [%]")["P, student, oil2"]
    assert float(shown.split()[0]) == pytest.approx(100 * np.mean(reached), abs=0.06)


def test_the_papers_own_gaits_are_the_best_of_its_matrix():
    for fluid, gaits in paper.CROSS.items():
        assert max(gaits, key=lambda name: gaits[name].speed) == fluid
        assert min(gaits, key=lambda name: gaits[name].cost_of_transport) == fluid


def made_up(**speeds):
    """Swims of a policy in two fluids: speeds by loop, first letter of the fluid and of the gait; CoT is 1 / v."""
    rows = []
    for name, values in speeds.items():
        loop, fluid, gait = name.split("_")
        fluids = {"w": "water", "o": "oil2", "a": "adaptive"}
        for seed, speed in enumerate(values):
            row = {"method": "student", "seed": seed, "loop": loop, "gait_of": fluids[gait], "fluid": fluids[fluid]}
            numbers = {"speed": speed, "cost_of_transport": 1 / speed, "power": 1.0, "status": "ok", "steady": True}
            rows.append(row | numbers)
    return pd.DataFrame(rows).assign(positive_cost_of_transport=1.0)


SPEEDS = {
    "closed_w_a": [0.5, 0.5],
    "closed_o_a": [0.2, 0.2],
    "open_w_w": [0.5, 0.4],
    "open_w_o": [0.25, 0.2],
    "open_o_o": [0.2, 0.2],
    "open_o_w": [0.3, 0.1],
}


def test_the_wrong_gait_is_told_from_the_lost_feedback():
    wrong = replays(made_up(**SPEEDS)).query("not home").groupby("seed")["speed_change"].mean()
    assert wrong.tolist() == pytest.approx([0.0, -0.5])  # half in water; in oil2 half as fast again, and half
    lost = feedback(made_up(**SPEEDS)).set_index(["seed", "fluid"])["speed_lost"]
    assert lost.to_dict() == pytest.approx({(0, "water"): 0.0, (1, "water"): -0.2, (0, "oil2"): 0.0, (1, "oil2"): 0.0})


def test_the_best_gait_of_a_fluid_is_marked():
    own = replays(made_up(**SPEEDS)).query("home")
    assert own["speed_best"].sum() == own["cost_of_transport_best"].sum() == 3 and own["speed_best"].count() == 4


def test_where_two_gaits_are_equally_good_the_fluids_own_counts():
    equal = SPEEDS | {"open_o_w": [0.2, 0.2], "open_w_o": [0.5, 0.4]}
    assert replays(made_up(**equal)).query("home")["speed_best"].sum() == 4


def test_gaits_that_left_no_replay_are_named():
    lone = {name: speeds for name, speeds in SPEEDS.items() if not name.endswith("_o")}
    left = feedback(made_up(**lone)).query("not recorded")
    assert left[["seed", "fluid"]].values.tolist() == [[0, "oil2"], [1, "oil2"]]
    assert feedback(made_up(**SPEEDS))["recorded"].all()


@pytest.mark.slow
def test_a_page_is_made_of_what_is_there(results, matrix):
    policy = matrix[matrix["method"] == "student"]
    methods = {row[0].split(",")[0] for row in page_of(results)["lost"].rows}
    assert methods >= {"student", "sea snake", "free waveform"}
    assert {row[0].split(",")[0] for row in page_of(results, matrix=policy)["lost"].rows} == {"student"}
    study = published(results)
    gaits = study._replace(tables=study.tables | {"matrix": matrix[matrix["method"] == "sea_snake"]})
    assert "paper's policy" in matrices(study) and "paper's policy" not in matrices(gaits)
    lost = policy.assign(status=policy["status"].mask(policy["gait_of"] == "water", "diverged"))
    assert page_of(results, matrix=lost)["failed"] == {"diverged": 4}  # with the finer step: two seeds in two fluids


def test_seeds_that_are_not_there_are_refused_in_one_line(tmp_path, write_contenders):
    write_contenders(tmp_path, "teacher_student")
    with pytest.raises(InvalidValue, match="student-4 is no policy of") as error:
        run_study(
            config(seeds=[4], contenders={"sinusoids": "", "sea_snakes": "", "waveforms": ""}), tmp_path, workers=1
        )
    assert "\n" not in str(error.value)
