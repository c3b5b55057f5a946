"""What is compared: the best of what earlier studies found, read from their results."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from writing import list_files, write_manifest, write_table

import snakebench as sb
from snakebench.errors import InvalidValue, StoreError
from snakebench.manifest import read_manifest
from snakebench.publication import note_read, published_digest, reads_noted
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.contenders import contenders
from snakebench.studies.fourier.starts import limit_starts, start_at
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

KINDS = ("policies", "sinusoids", "sea_snakes", "waveforms")


def config(*kinds, **changes):
    """A study that compares some kinds of contenders, or all."""
    without = {kind: "" for kind in KINDS if kinds and kind not in kinds}
    settings = study_settings(study_path("cross"), "full")
    return study_config(settings | {"seeds": [0], "contenders": without} | changes)


@pytest.fixture(scope="module")
def results(tmp_path_factory, write_contenders):
    return write_contenders(tmp_path_factory.mktemp("found"))


def test_every_kind_has_one_for_each_fluid_and_one_for_all(results):
    compared = contenders(config(), results)
    tuned = {}
    for one in compared:
        tuned.setdefault(one.method, []).append(one.tuned_to)
    assert tuned.pop("student") == ["adaptive"]
    assert set(tuned) == {"paper", "extended", "sea_snake", "fourier"}
    assert all(names == ["water", "oil1", "oil2", "integrated"] for names in tuned.values())
    assert {one.commit for one in compared} == {"abc"}


def test_what_is_read_is_noted_with_a_digest_of_its_files(results):
    with reads_noted() as read:
        contenders(config("sea_snakes", "sinusoids"), results)
    manifests = {study: read_manifest(results / study) for study in ("pareto", "sea_snake")}
    assert read == {study: published_digest(manifest) for study, manifest in manifests.items()}
    changed = manifests["pareto"]["files"] | {"fronts.csv": "0" * 64}
    assert published_digest(manifests["pareto"] | {"files": changed}) != read["pareto"]


def test_results_that_change_while_they_are_read_are_refused():
    with reads_noted():
        note_read("pareto", {"files": {"fronts.csv": "1"}})
        note_read("pareto", {"files": {"fronts.csv": "1"}})
        with pytest.raises(StoreError, match="the results of pareto have changed while they were read"):
            note_read("pareto", {"files": {"fronts.csv": "2"}})


def test_as_many_are_expected_as_there_are_with_five_seeds_of_each_search(results, tmp_path, write_contenders):
    write_contenders(tmp_path)
    for study, names in (("sea_snake", ["optima"]), ("fourier", ["optima", "gaits"])):
        for name in names:
            table = read_table(tmp_path / study / f"{name}.csv")
            seeds = [table.assign(seed=seed) for seed in range(5)]
            write_table(tmp_path / study / f"{name}.csv", pd.concat(seeds, ignore_index=True))
        list_files(tmp_path / study)
    settings = config(pilots=["student", "teacher"])
    expected, compared = settings.expected(), contenders(settings, tmp_path)
    for drives in ("angle", "torque"):
        counts = [sum(one.controller.drives == drives for one in some) for some in (expected, compared)]
        assert counts[0] == counts[1]


def searches(path, gait_of, values):
    """Optima of sea snakes tuned to water: of each seed one as searched, of a strength and a return."""
    gaits = [gait_of("water", strength) for strength, _ in values.values()]
    rows = [
        {"objective": "water", "seed": seed, "variant": "searched", "return": earned, **gait}
        for (seed, (_, earned)), gait in zip(values.items(), gaits, strict=True)
    ]
    write_table(path / "sea_snake" / "optima.csv", pd.DataFrame(rows))
    list_files(path / "sea_snake")


def test_every_seed_of_a_search_has_its_gait_not_only_the_best_of_them(tmp_path, write_contenders, gait_of):
    write_contenders(tmp_path, "sea_snake")
    searches(tmp_path, gait_of, {3: (0.2, 9.0), 7: (0.1, 10.0)})
    compared = contenders(config("sea_snakes", fluids=["water"]), tmp_path)
    assert {one.seed: one.controller for one in compared} == {
        3: sb.SeaSnake(**gait_of("water", 0.2)),
        7: sb.SeaSnake(**gait_of("water", 0.1)),
    }


def test_without_seeds_all_policies_that_are_there_are_compared(results):
    compared = contenders(config("policies", pilots=["student", "teacher"], seeds=None), results)
    assert [(one.method, one.seed) for one in compared] == [("student", 0), ("student", 1), ("teacher", 0)]


def test_without_seeds_policies_that_are_left_out_are_not_passed_over(tmp_path, write_contenders):
    write_contenders(tmp_path, "teacher_student")
    left_out = {"command": "", "files": {"policies/teacher-12.safetensors": "0" * 64}}
    directory = tmp_path / "teacher_student"
    write_manifest(directory, read_manifest(directory) | {"left_out": left_out})
    with pytest.raises(InvalidValue, match="teacher-12 is left out of"):
        contenders(config("policies", pilots=["teacher"], seeds=None), tmp_path)


def test_a_policy_without_any_seed_is_named_with_those_that_are_there(results):
    with pytest.raises(
        InvalidValue, match=r"symmetric-0 is no policy of .*: student-0, student-1, teacher-0 are there"
    ):
        contenders(config("policies", pilots=["symmetric"], seeds=None), results)


def test_the_best_sinusoid_is_the_fastest_within_the_reference(results, gait_of):
    for one in contenders(config("sinusoids"), results):
        assert one.controller == sb.SinusoidalTorque(**gait_of(one.tuned_to))
    weak = contenders(config("sinusoids", reference=(0.0, 5.0)), results)
    assert weak[0].controller == sb.SinusoidalTorque(**gait_of("water", 0.5))


def test_the_best_sea_snake_is_of_the_highest_return_as_searched(results, gait_of):
    for one in contenders(config("sea_snakes"), results):
        assert one.controller == sb.SeaSnake(**gait_of(one.tuned_to, 0.25))


def test_the_best_waveform_is_the_sum_of_its_published_coefficients(results):
    one = next(one for one in contenders(config("waveforms"), results) if one.tuned_to == "oil1")
    times, joints = np.linspace(0, 3, 50)[:, None], np.arange(1, 8)
    wave = sum(0.8 / h**3 * np.sin(2 * np.pi * h * 0.65 * times - 0.7 * joints) for h in (1, 2))
    np.testing.assert_allclose(one.controller.commands(times[:, 0], 7), np.clip(wave, -1, 1), atol=1e-12)


def test_policies_are_the_published_ones(results):
    compared = contenders(config("policies", pilots=["teacher", "student"]), results)
    for one in compared:
        path = results / "teacher_student" / "policies" / f"{one.method}-{one.seed}.safetensors"
        assert one.controller.digest() == sb.Policy.load(path).digest()


@pytest.mark.parametrize(
    ("kind", "directory", "command"),
    [
        ("policies", "teacher_student", "run-study teacher_student"),
        ("sinusoids", "pareto-quick", "run-study pareto --profile quick"),
        ("sea_snakes", "sea_snake", "run-study sea_snake"),
        ("waveforms", "fourier-smoke", "run-study fourier --profile smoke"),
    ],
)
def test_missing_results_name_the_command_that_makes_them(tmp_path, kind, directory, command):
    settings = config(kind)
    settings = config(contenders={**settings.contenders.model_dump(), kind: directory})
    with pytest.raises(InvalidValue, match=f"run snakebench {command} first") as error:
        contenders(settings, tmp_path)
    assert "\n" not in str(error.value)


def test_a_study_says_so_too_and_leaves_nothing_behind(tmp_path):
    with pytest.raises(InvalidValue, match="run snakebench run-study teacher_student first"):
        run_study(config("policies"), tmp_path, workers=1)
    assert not (tmp_path / "cross" / "manifest.json").exists()


@pytest.mark.parametrize(("kind", "study"), [("sea_snakes", "fourier"), ("waveforms", "sea_snake")])
def test_results_of_another_kind_are_refused_in_a_line(results, kind, study):
    settings = config(kind)
    settings = config(contenders={**settings.contenders.model_dump(), kind: study})
    with pytest.raises(StoreError, match="it has no column") as error:
        contenders(settings, results)
    assert "\n" not in str(error.value)


def test_fluids_whose_names_are_numbers_are_found(tmp_path, write_contenders):
    results = write_contenders(tmp_path, "pareto")
    fronts = read_table(results / "pareto" / "fronts.csv")
    write_table(results / "pareto" / "fronts.csv", fronts[fronts["front"] == "oil1"].assign(front="5e-4"))
    list_files(results / "pareto")
    compared = contenders(config("sinusoids", fluids=["5e-4"]), results)
    assert {one.tuned_to for one in compared} == {"5e-4"}


@pytest.mark.parametrize("kind", ["sinusoids", "sea_snakes", "waveforms"])
def test_a_fluid_to_which_nothing_was_tuned_is_named(results, kind):
    with pytest.raises(InvalidValue, match=re.escape("1e-3: nothing in")) as error:
        contenders(config(kind, fluids=["water", "1e-3"]), results)
    assert "only to integrated, oil1, oil2, water" in str(error.value)


def test_a_policy_that_is_not_there_is_named_with_those_that_are(results):
    with pytest.raises(InvalidValue, match=r"teacher-7 is no policy of .*: student-0, student-1, teacher-0 are there"):
        contenders(config("policies", pilots=["teacher"], seeds=[7]), results)


def test_a_policy_that_the_repository_leaves_out_is_named_with_the_command_that_makes_it(tmp_path, write_contenders):
    write_contenders(tmp_path, "teacher_student")
    left_out = {"command": "", "files": {"policies/symmetric-0.safetensors": "0" * 64}}
    directory = tmp_path / "teacher_student"
    write_manifest(directory, read_manifest(directory) | {"left_out": left_out})
    with pytest.raises(InvalidValue, match=r"symmetric-0 is left out of .*: run snakebench run-study teacher_student"):
        contenders(config("policies", pilots=["symmetric"]), tmp_path)


def test_a_study_that_has_no_fronts_of_a_gait_is_refused(tmp_path, write_contenders):
    write_contenders(tmp_path, "fourier")
    manifest = read_manifest(tmp_path / "fourier")
    about = {"method": "fourier", "robot": manifest["config"]["robot"]}
    write_table(tmp_path / "fourier" / "fronts.csv", pd.DataFrame({"space": ["fourier"], "front": ["water"]}))
    write_manifest(tmp_path / "fourier", {"commit": "abc", "config": about})
    study = config(contenders={**dict.fromkeys(KINDS, ""), "gaits": ["fourier"]})
    with pytest.raises(InvalidValue, match="fourier is no study of the fronts of a gait: its method is fourier"):
        contenders(study, tmp_path)


def test_a_comparison_of_nothing_is_refused(tmp_path):
    with pytest.raises(InvalidValue, match="nothing to compare"):
        contenders(config(contenders=dict.fromkeys(KINDS, "")), tmp_path)


def test_results_of_another_profile_are_named(tmp_path, write_contenders):
    write_contenders(tmp_path, "pareto")
    (tmp_path / "pareto").rename(tmp_path / "pareto-smoke")
    with pytest.raises(InvalidValue, match=r"no results in .*pareto; there is pareto-smoke: run"):
        contenders(config("sinusoids"), tmp_path)


def test_policies_to_compare_are_named_or_left_out_as_a_whole():
    with pytest.raises(InvalidValue, match="pilots"):
        config(pilots=[])


def write_limit(results):
    """A limit of three fluids, each with a slow gait, a fast one, one of P+, and one beyond the reference."""
    (results / "limit").mkdir(parents=True)
    points, gaits = [], []
    for f, fluid in enumerate(("water", "oil1", "oil2")):
        for k, (currency, power) in enumerate((("net", 1.0), ("net", 5.0), ("positive", 9.0), ("net", 40.0))):
            point = {"fluid": fluid, "viscosity": sb.named_fluid(fluid).kinematic_viscosity, "bounds": "policies"}
            point |= {"currency": currency, "allowed": power}
            points.append(point | {"power": power, "speed": power / 100, "multiplier": 0.1 / power})
            gaits += [point | {"knot": i, "period": 1.0 + f + k / 10} | wave(i / 8) for i in range(8)]
    write_table(results / "limit" / "limit.csv", pd.DataFrame(points))
    write_table(results / "limit" / "gaits.csv", pd.DataFrame(gaits))
    config = {"bounds": {"policies": {}}, "robot": sb.Robot().model_dump(mode="json")}
    write_manifest(results / "limit", {"commit": "abc", "config": config})


def wave(share):
    """Targets at a share of a period: a cosine at the first joint, the third harmonic of a sine at the last."""
    angle = 2 * np.pi * share
    return {f"joint_{j + 1}": (j == 0) * 0.5 * np.cos(angle) + (j == 6) * 0.3 * np.sin(3 * angle) for j in range(7)}


def test_the_limits_gait_of_a_fluid_is_the_fastest_of_net_power_within_the_reference(tmp_path):
    write_limit(tmp_path)
    found = dict.fromkeys(KINDS, "") | {"limit": "limit"}
    compared = contenders(config(contenders=found), tmp_path)
    assert [(one.method, one.tuned_to) for one in compared] == [("limit", name) for name in ("water", "oil1", "oil2")]
    assert [one.controller.period for one in compared] == pytest.approx([1.1, 2.1, 3.1])


def test_a_search_at_a_price_starts_at_the_limits_gait_for_which_a_watt_is_worth_it(tmp_path):
    write_limit(tmp_path)
    settings = study_settings(study_path("fourier"), "full") | {"limit": "limit"}
    starts = limit_starts(study_config(settings), tmp_path)
    assert set(starts) == {(fluid, currency) for fluid in ("water", "oil1", "oil2") for currency in ("net", "positive")}
    point = start_at(starts["water", "net"], 10 * 0.1 / 5.0, harmonics=3)
    amplitudes = point[1:].reshape(3, 2, 7)
    assert np.exp(-point[0]) == pytest.approx(1.1)
    # A wave that is linear between eight knots has somewhat less of its harmonics: sinc(h / 8)^2 of each.
    assert amplitudes[0, 0, 0] == pytest.approx(0.5 * np.sinc(1 / 8) ** 2, rel=1e-3)
    assert amplitudes[2, 1, 6] == pytest.approx(0.3 * np.sinc(3 / 8) ** 2, rel=1e-2)
    rest = amplitudes.copy()
    rest[0, 0, 0] = rest[2, 1, 6] = 0.0
    assert np.abs(rest).max() < 2e-3


def test_a_limit_that_is_not_there_is_named_with_its_command(tmp_path):
    settings = study_settings(study_path("fourier"), "full") | {"limit": "limit"}
    with pytest.raises(InvalidValue, match="run snakebench run-study limit first"):
        limit_starts(study_config(settings), tmp_path)


def test_a_limit_of_another_robot_is_no_start(tmp_path):
    write_limit(tmp_path)
    settings = study_settings(study_path("fourier"), "full") | {"limit": "limit", "robot": {"diameter": 0.07}}
    with pytest.raises(InvalidValue, match="limit is of another robot"):
        limit_starts(study_config(settings), tmp_path)
