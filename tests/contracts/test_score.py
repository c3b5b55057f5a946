"""The yardstick: draws that anybody can recompute, scores that adversaries do not gain, entries that are checked."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import random
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import onnx
import pytest
from adversaries import targets
from scipy.stats import kendalltau
from writing import random_policy

import snakebench as sb
from snakebench.deployment import export_policy
from snakebench.errors import InvalidValue, SnakebenchError
from snakebench.gain_schedule import WINDOW, ScheduledGait, features
from snakebench.perturbation import one_of
from snakebench.policy import Card
from snakebench.scoring.checking import check
from snakebench.scoring.entry import Setting, read_entry
from snakebench.scoring.leaderboard import place, read_leaderboard
from snakebench.scoring.page import leaderboard_page, score_page
from snakebench.scoring.result import read_score, summary, totals
from snakebench.scoring.score import planned
from snakebench.scoring.swims import scored
from snakebench.scoring.tasks import TASKS, draws, load_tasks
from snakebench.scoring.yardstick import Yardstick
from snakebench.simulation import check_scenario

ROOT = Path(__file__).parents[2]
STUDENT = ROOT / "results" / "teacher_student" / "policies" / "student-10.safetensors"
V1 = load_tasks("v1")
WAVE = sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=0.7)
PINNED = {"water": (0.179120, 1.95243), "oil1": (0.059971, 2.14162), "oil2": (0.0097391, 2.16808)}  # v [m/s], P+ [W]
FROZEN = "471e2bada924c73529ca41bd76c95311bdaef39776c67d96c80c1d540ec63188"


@pytest.fixture(scope="module")
def quick():
    """The score of a plain wave in all tasks, in the planar engine."""
    return sb.score(WAVE, seed="dev", quick=True, workers=1)


def uniform(*labels):
    """A number in [0, 1) by the rule in docs/compete.md."""
    return (int(hashlib.sha256(" ".join(map(str, labels)).encode()).hexdigest()[:14], 16) >> 3) / 2**53


# Draws


def test_the_same_file_has_the_same_draws_and_another_file_others():
    assert draws(V1, "a") == draws(V1, "a")
    assert not {str(draw) for draw in draws(V1, "a") if draw.task != "known"} & {str(draw) for draw in draws(V1, "b")}


def test_draws_are_recomputed_by_the_published_rule():
    first = draws(V1, "dev", ("unknown",))[0].fluid.kinematic_viscosity
    assert first == pytest.approx(1e-7 * 1e5 ** (uniform("v1 dev unknown", 0) / 32), rel=1e-12)


def test_every_part_of_the_range_of_viscosities_has_one_swim():
    shares = [np.log10(draw.fluid.kinematic_viscosity / 1e-7) / 5 for draw in draws(V1, "any", ("unknown",))]
    assert [int(32 * share) for share in shares] == list(range(32))


def test_courses_visit_every_third_of_the_range_in_all_orders():
    courses = draws(V1, "any", ("changing",))
    parts = [tuple(int(3 * np.log10(f.kinematic_viscosity / 1e-7) / 5) for f in one.fluid.fluids) for one in courses]
    assert all(sorted(order) == [0, 1, 2] for order in parts)
    assert len(courses) == 16 and len(set(parts[:6])) == len(set(parts[6:12])) == 6


def test_every_perturbation_is_in_every_fluid_and_in_every_third_of_its_range():
    for name, (low, high) in V1.robust.ranges.items():
        own = [draw for draw in draws(V1, "any", ("robust",)) if draw.perturbation == name]
        assert [draw.where for draw in own] == list(V1.fluids)
        assert all(low <= draw.value <= high for draw in own)
        if name != "dead_joint":
            assert {int(3 * (draw.value - low) / (high - low)) for draw in own} == {0, 1, 2}


# The yardstick


def test_the_yardstick_is_the_published_limit_and_constant_outside_its_range():
    yardstick = Yardstick(V1, "positive")
    for fluid in V1.fluids:
        known = sb.limit(fluid, 5.0, currency="positive").speed
        assert yardstick.at(sb.named_fluid(fluid), 5.0)[0] == pytest.approx(known, rel=1e-9)
    water = [yardstick.at(sb.named_fluid("water"), power)[0] for power in (1e-3, 0.1, 100.0, 1000.0)]
    assert water[0] == water[1] < water[2] == water[3]


@pytest.mark.parametrize("kind", ["known", "changing"])
def test_what_leaves_the_limits_bounds_is_compared_with_a_limit_that_grows_beyond_its_range(kind):
    fluid = {"known": sb.named_fluid("oil1"), "changing": draws(V1, "dev", ("changing",))[0].fluid}[kind]
    usual, wide = (
        [one.at(fluid, power)[0] if kind == "known" else one.through(fluid, power, 60.0)[0] for power in (5, 100, 400)]
        for one in (Yardstick(V1, "positive", leaves) for leaves in (False, True))
    )
    assert usual[0] == wide[0] < usual[1] == usual[2] < wide[1]
    assert wide[2] == pytest.approx(2 * wide[1])


def test_which_gaits_leave_the_limits_bounds():
    limits = read_entry(ROOT / "leaderboard" / "limit" / "gait.json").settings
    torque = sb.SinusoidalTorque(amplitude=0.1, frequency=0.5, phase=0.7)
    narrow, wide = (sb.SeaSnake(amplitude=amplitude, frequency=0.5, phase=0.7) for amplitude in (0.99, 1.01))
    assert not any(one.wide for one in limits)
    found = [Setting(controller=one).wide for one in (narrow, wide, torque, sb.Policy.load(STUDENT))]
    assert found == [False, True, True, False]


def test_version_1_is_frozen():
    assert V1.content == FROZEN, "v1 may not change: other tasks are a v2, in a folder of its own"


def test_version_1_gives_a_small_gait_the_same_numbers():
    swims = sb.score(WAVE, tasks="known", workers=1).swims
    for swim in swims:
        assert (swim.speed, swim.positive_power) == pytest.approx(PINNED[swim.where], rel=2e-3)
        assert swim.score == pytest.approx(swim.speed / swim.limit)


# Scores


def test_the_total_is_the_mean_of_the_tasks_and_a_task_the_mean_of_its_swims(quick):
    for name in TASKS:
        own = [swim.score for swim in quick.swims if swim.task == name]
        assert quick.scores[name].score == pytest.approx(np.mean(own))
    assert quick.total == pytest.approx(np.mean([quick.scores[name].score for name in TASKS]))
    assert [quick.scores[name].swims for name in TASKS] == [3, 32, 16, 54]
    assert quick.scores["known"].half_width is None and 0 < quick.half_width < 0.05


def test_the_same_bytes_on_one_and_two_workers_and_from_the_cache(tmp_path):
    one, two, again = (
        sb.score(WAVE, tasks="known", quick=True, workers=n, cache=path).text()
        for n, path in ((1, tmp_path), (2, None), (1, tmp_path))
    )
    assert one == two == again


@pytest.mark.slow
def test_the_same_bytes_on_a_cluster():
    here, there = (sb.score(WAVE, tasks="known", quick=True, workers=1, executor=e) for e in ("processes", "dask"))
    assert here.text() == there.text()


@pytest.mark.slow
def test_the_same_printed_digits_with_the_instructions_of_another_processor(tmp_path):
    printed = []
    for name, settings in (("own", {}), ("generic", {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""})):
        (out := tmp_path / name).mkdir()
        (out / "wave.json").write_text(WAVE.model_dump_json())
        command = [sys.executable, "-m", "snakebench.cli", "score", "wave.json", "--quick", "--workers", "1"]
        environment = os.environ | settings | {"NUMBA_CACHE_DIR": str(out)}
        done = subprocess.run(command, cwd=out, env=environment, capture_output=True, text=True, timeout=900)
        printed.append(done.stdout.split("written")[0])
    assert printed[0] == printed[1] and "total" in printed[0]


def test_a_score_is_read_back_as_it_was_written(quick, tmp_path):
    (tmp_path / "score.json").write_text(quick.text())
    assert read_score(tmp_path / "score.json") == quick


def test_the_command_writes_and_prints_a_score(snakebench_command, tmp_path, quick):
    (tmp_path / "wave.json").write_text(WAVE.model_dump_json())
    options = ("--task", "known", "--quick", "--seed", "dev", "--workers", "1")
    code, out, _ = snakebench_command("score", "wave.json", *options)
    found = read_score(tmp_path / "score.json")
    assert code == 0 and found.seed == "dev" and found.scores == {"known": quick.scores["known"]}
    assert out.splitlines()[-3:] == ["score: –", "written: score.json", "written: score.html"]


def test_an_interval_contains_the_score_of_other_draws(quick):
    other = sb.score(WAVE, tasks="unknown", quick=True, workers=1).scores["unknown"].score
    assert abs(other - quick.scores["unknown"].score) < 2 * quick.scores["unknown"].half_width


def test_a_preference_conditioned_policy_is_scored_at_the_powers_of_the_task():
    entry = read_entry(ROOT / "results" / "learned_front" / "policies" / "student-10.safetensors")
    assert entry.information == "sensors" and len(entry.settings) == 17
    assert entry.own().controller.price == min(one.controller.price for one in entry.settings)


def test_a_table_of_gaits_tells_the_fluid_in_known_only(tmp_path):
    rows = [{"fluid": name, "gait": WAVE.model_dump()} for name in ("water", "oil1", "oil2")]
    (tmp_path / "gait.json").write_text(json.dumps({"kind": "gait-table", "gaits": rows}))
    entry = read_entry(tmp_path / "gait.json")
    assert len(planned(V1, entry, "dev", entry.tasks, quick=True)) == 3
    for asked in ("unknown", ["known", "robust"]):
        with pytest.raises(InvalidValue, match="it can swim known only"):
            sb.score(tmp_path / "gait.json", tasks=asked)


@pytest.mark.parametrize(
    ("fluid", "why"),
    [
        ("water", "has no gait for oil1, and none for all fluids"),
        ("water@40", "unknown fluid 'water@40'"),
        ("1e-3,900", "unknown fluid '1e-3,900'"),
    ],
)
def test_a_table_of_gaits_for_other_fluids_than_the_known_ones_is_refused(tmp_path, fluid, why):
    (tmp_path / "gait.json").write_text(
        json.dumps({"kind": "gait-table", "gaits": [{"fluid": fluid, "gait": WAVE.model_dump()}]})
    )
    with pytest.raises(InvalidValue, match=why):
        sb.score(tmp_path / "gait.json", quick=True)


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("gait", [WAVE, sb.SinusoidalTorque(amplitude=3.5, frequency=0.7, phase=0.84)])
def test_engines_are_stable_under_all_perturbations(gait, quick):
    for name, value in ((name, value) for name, bounds in V1.robust.ranges.items() for value in bounds):
        place = V1.scenario(sb.named_fluid("water"), gait.drives, quick)
        check_scenario(sb.perturbed(gait, place, one_of(name, value))[1], gait.drives)


def test_pages_show_where_a_score_loses(quick):
    page = score_page(quick)
    for text in ("known:", "unknown:", "changing:", "robust:", "Where it loses most", "dead joint"):
        assert text in page


def test_the_page_does_without_courses_that_nobody_swam(quick):
    still = [swim.but(places=(), score=0.0) if swim.task == "changing" else swim for swim in quick.swims]
    assert "Speed over the limit" in score_page(quick)
    assert "Speed over the limit" not in score_page(quick.but(swims=tuple(still)))


# Other formats


def test_an_onnx_model_swims_as_its_policy(tmp_path):
    policy = sb.Policy.load(STUDENT)
    export_policy(policy, tmp_path / "student.onnx")
    entry = read_entry(tmp_path / "student.onnx")
    assert entry.information == "sensors"
    settings = {"fluid": "oil1", "engine": "planar", "duration": 5.0}
    model = pickle.loads(pickle.dumps(entry.own().controller))  # as a worker gets it
    assert sb.evaluate(model, **settings).speed == pytest.approx(sb.evaluate(policy, **settings).speed, rel=1e-4)


def test_an_archive_of_stable_baselines_swims_as_its_model(tmp_path):
    from stable_baselines3 import PPO

    environment = sb.SwimEnv(engine="planar", physics_rate=90, duration=2.0, feels=["sensors"])
    model = PPO("MlpPolicy", environment, n_steps=8, batch_size=8, seed=1, device="cpu")
    model.save(tmp_path / "mine.zip")
    entry, settings = read_entry(tmp_path / "mine.zip", trust=True), {"engine": "planar", "duration": 2.0}
    expected = sb.evaluate(sb.Predictor(model, ["sensors"]), **settings)
    assert entry.information == "sensors"
    assert sb.evaluate(entry.own().controller, **settings) == expected


# Refusals


class Trap:
    """What makes a file when it is unpickled."""

    def __reduce__(self):
        return Path.write_text, (Path("mark"), "executed")


def linear(path, inputs=31, card='{"card": {"feels": ["sensors"]}}', weight=0.1, memory=0):
    more = (f", float[{memory}] m", f", float[{memory}] next_m", "next_m = Identity(m)\n") if memory else ("", "", "")
    wires = f"(float[{inputs}] observation{more[0]}) => (float[7] action{more[1]})"
    graph = f'<ir_version: 8, opset_import: ["": 18]> g {wires} {{\n'
    model = onnx.parser.parse_model(graph + f"action = MatMul(observation, w)\n{more[2]}}}")
    model.graph.initializer.append(onnx.numpy_helper.from_array(np.full((inputs, 7), weight, np.float32), "w"))
    if card:
        model.metadata_props.add(key="snakebench", value=card)
    path.write_bytes(model.SerializeToString())


def archive(path):
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("data", pickle.dumps(Trap()))


UNFIT = {
    "kind": "gain-schedule",
    "gaits": [{"viscosity": 1e-6, "price": 0.1, "targets": [[0.1] * 7, [-0.1] * 7]}],
    "estimator": {"weights": [[[0.0]]], "biases": [[0.0]]},
}
WIDTH = features(np.zeros((WINDOW, 31), np.float32), ScheduledGait(**UNFIT["gaits"][0]), 0.0).size
EMPTY = {"weights": [[[0.0] * WIDTH]], "biases": [[]]}
BAD = {
    "missing.json": (lambda path: None, "cannot read .*No such file"),
    "code.zip": (archive, "--trust"),
    "code.pkl": (lambda path: path.write_bytes(pickle.dumps(Trap())), "is no entry"),
    "code.json": (lambda path: path.write_bytes(pickle.dumps(Trap())), "cannot read the gait"),
    "list.json": (lambda path: path.write_text("[]"), "a JSON object"),
    "table.json": (lambda path: path.write_text('{"kind": "gait-table", "gaits": []}'), "no table of gaits"),
    "row.json": (lambda path: path.write_text('{"kind": "gait-table", "gaits": [3]}'), "gaits.0"),
    "joints.json": (lambda path: path.write_text(targets("random", 1, joints=5).model_dump_json()), "5 joints"),
    "no.safetensors": (lambda path: path.write_bytes(b"nothing"), "damaged"),
    "joints.onnx": (lambda path: export_policy(random_policy(Card(joints=5)), path), "5 joints"),
    "no.onnx": (lambda path: path.write_bytes(b"nothing"), "no ONNX model"),
    "wide.onnx": (lambda path: linear(path, inputs=30), r"observation \[31\]"),
    "cardless.onnx": (lambda path: linear(path, card=""), "has no card"),
    "wrong.onnx": (lambda path: linear(path, card='{"card": {"feels": ["sight"]}}'), "unknown observation"),
    "estimator.json": (lambda path: path.write_text(json.dumps(UNFIT)), "estimator do not fit"),
    "empty.json": (lambda path: path.write_text(json.dumps(UNFIT | {"estimator": EMPTY})), "estimator do not fit"),
    "nan.onnx": (lambda path: linear(path, weight=np.nan), "finite"),
    "order.onnx": (lambda path: linear(path, card='{"card": {"layout": ["sight"]}}'), "another layout"),
    "huge.onnx": (lambda path: linear(path, memory=2**40), "at most 1000000 are allowed"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_file_that_cannot_be_scored_is_refused_in_a_line(snakebench_command, tmp_path, name):
    write, why = BAD[name]
    write(tmp_path / name)
    code, out, err = snakebench_command("score", name, "--task", "known", "--quick", "--workers", "1")
    lines = [line for line in err.splitlines() if not line.startswith(("compiling", "score:"))]
    assert (code, out, len(lines)) == (2, "", 1), (out, err)
    assert re.search(why, lines[0])
    assert not (tmp_path / "mark").exists() and not list(tmp_path.glob("score.*"))


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"tasks": "speed"}, "unknown task 'speed'"),
        ({"tasks": []}, "tasks is empty"),
        ({"seed": "7"}, "unknown seed '7'"),
        ({"workers": 0}, "workers = 0"),
    ],
)
def test_a_wrong_argument_is_refused(wrong, why):
    with pytest.raises(InvalidValue, match=why):
        sb.score(WAVE, quick=True, **wrong)


# Adversaries


class Clocked:
    """Swims fast, but only for some of the time: it watches the clock."""

    def __init__(self, first, last):
        self.first, self.last = first, last

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        step = 0 if state is None else state
        swims = self.first <= step / 30 < self.last
        return swims * 0.9 * np.sin(2 * np.pi * 0.9 * step / 30 - 0.7 * np.arange(7)), step + 1


def known(controller, *fluids):
    """Scores in `known`, in the planar engine."""
    swims = sb.score(controller, tasks="known", quick=True, workers=1).swims
    return {swim.where: swim for swim in swims if swim.where in (fluids or V1.fluids)}


def held(bias, wave):
    """A wave of target angles with a constant bend."""
    time, joint = np.arange(900)[:, None] / 30, np.arange(7)
    rows = bias + wave * np.sin(2 * np.pi * 0.8 * time - 0.7 * joint)
    return sb.HeldTargets(rate=30, targets=tuple(map(tuple, rows.tolist())))


def test_flipping_targets_deserve_little():
    assert max(swim.score for swim in known(targets("alternating", 30.0)).values()) < 0.05


def test_spinning_and_swimming_backwards_score_nothing():
    backwards = known(sb.SeaSnake(amplitude=0.9, frequency=0.6, phase=-0.7), "water")["water"]
    assert (backwards.status, backwards.score) == ("off course", 0.0)
    assert {swim.score for swim in known(held(0.5, 0.5), "water", "oil1").values()} == {0.0}


def test_a_gait_that_leaves_its_course_scores_nothing():
    drawn = draws(V1, "dev", ("known",))[0]
    yardsticks = {currency: Yardstick(V1, currency) for currency in ("net", "positive")}
    found = {"status": "ok", "speed": 0.4, "power": 5.0, "positive_power": 6.0, "places": ()}
    inside, outside = (scored(V1, drawn, found | {"course": angle}, yardsticks) for angle in (44.0, -46.0))
    assert inside.score > 0.8 and (outside.score, outside.status) == (0.0, "off course")


def test_who_does_no_work_or_gains_it_scores_nothing():
    still = known(sb.SeaSnake(amplitude=0.0, frequency=0.6, phase=0.7))
    assert {(swim.status, swim.score) for swim in still.values()} == {("invalid", 0.0)}


def test_nothing_is_gained_by_brute_force():
    strong = known(sb.SinusoidalTorque(amplitude=8.0, frequency=2.0, phase=0.12), "water")["water"]
    assert (
        strong.positive_power > 100.0 and strong.speed > Yardstick(V1, "positive").at(sb.named_fluid("water"), 100.0)[0]
    )
    assert strong.score < 0.65


def test_no_score_is_above_one_by_more_than_the_limits_error():
    drawn = draws(V1, "dev", ("known",))[0]
    yardsticks = {currency: Yardstick(V1, currency) for currency in ("net", "positive")}
    found = {"status": "ok", "speed": 9.0, "power": 5.0, "positive_power": 6.0, "course": 0.0, "places": ()}
    assert 1.0 < scored(V1, drawn, found, yardsticks).score < 1.05


@pytest.mark.slow
def test_nothing_is_gained_by_watching_the_clock():
    def water(first, last):
        controller = sb.Predictor(Clocked(first, last), ["sensors"], name=f"{first} {last}")
        return known(controller, "water")["water"].score

    always = water(0.0, 30.0)
    assert always > 0.5
    for first, last in ((0.0, 28.0), (10.0, 30.0), (8.0, 29.0)):
        assert water(first, last) < 1.01 * always
    for last in (10.0, 10.6, 12.0):  # it glides on what it did before its speed is measured
        assert water(0.0, last) == 0.0


# The leaderboard


@pytest.fixture
def board(tmp_path):
    """A leaderboard with one entry, as it is committed, in a directory like the repository."""
    shutil.copytree(ROOT / "leaderboard" / "sea_snake", tmp_path / "leaderboard" / "mine")
    return tmp_path / "leaderboard"


def edited(board, file, old, new):
    path = board / "mine" / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


ENTRIES = sorted(path.name for path in (ROOT / "leaderboard").iterdir())
# Of each kind of file one entry swims again; the others swim as slow tests.
OF_EACH_KIND = {"evolution_strategy", "gain_schedule", "sea_snake", "student"}


@pytest.mark.parametrize("folder", ENTRIES)
def test_a_committed_entry_is_as_it_was_scored(folder):
    random.seed(folder)
    (one,) = (one for one in read_leaderboard(ROOT / "leaderboard") if one.folder.name == folder)
    check(one, swims=1 if folder in OF_EACH_KIND else 0)


@pytest.mark.slow
@pytest.mark.parametrize("folder", ENTRIES)
def test_some_swims_of_every_committed_entry_are_as_they_were_scored(folder):
    random.seed(folder)
    (one,) = (one for one in read_leaderboard(ROOT / "leaderboard") if one.folder.name == folder)
    check(one, swims=4)


@pytest.mark.slow
def test_other_draws_give_the_same_ranking():
    entries = [one for one in read_leaderboard(ROOT / "leaderboard") if one.ranked]
    drawn = ("unknown", "changing", "robust")
    others = [sb.score(one.folder / one.card.file, tasks=drawn, quick=True, seed="dev", workers=2) for one in entries]
    for task in drawn:
        scores = [[score.scores[task].score for score in them] for them in ([one.score for one in entries], others)]
        assert kendalltau(*scores).statistic >= 0.9, task


@pytest.mark.slow
def test_all_swims_of_a_committed_entry_are_scored_again(board):
    check(*read_leaderboard(board), swims=None, workers=2)


def refused(board, why):
    with pytest.raises(SnakebenchError, match=why):
        [check(one, swims=1) for one in read_leaderboard(board)]


def test_two_entries_of_one_name_are_refused(board):
    shutil.copytree(board / "mine", board / "other")
    refused(board, "have the same name")


def test_an_entry_without_card_is_refused(board, snakebench_command):
    (board / "mine" / "card.toml").unlink()
    refused(board, "has no card")
    code, out, err = snakebench_command("leaderboard", "--check")
    assert (code, out, err.count("\n")) == (2, "", 1) and not (board.parent / "reports").exists()


def test_a_changed_file_under_an_old_score_is_refused(board):
    edited(board, "gait.json", "0.", "0.1")
    refused(board, "was changed since it was scored")


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('"tasks": "v1"', '"tasks": "v9"', "unknown version of the tasks"),
        ('"content": "', '"content": "0', "other tasks"),
        ('"engine": "pybullet"', '"engine": "planar"', "not scored in full"),
        ('"format": 1', '"format": 2', "format 2"),
        ('"score": 0.', '"score": 0.9', "not their mean"),
        ('"net_total": 0.', '"net_total": 0.9', "not their mean"),
        ('"half_width": 0.', '"half_width": 0.00', "not their mean"),
        ("{", "[", "damaged"),
    ],
)
def test_a_score_that_was_changed_is_refused(board, old, new, why):
    edited(board, "score.json", old, new)
    refused(board, why)


def test_swims_that_were_made_up_are_found_out(board):
    forged(board, lambda swim: swim.but(score=swim.score * 1.1))
    refused(board, "scored again")


def forged(board, change, folder="mine"):
    """The score of an entry with other swims, whose means are right."""
    one = read_score(board / folder / "score.json")
    swims = tuple(change(swim) for swim in one.swims)
    scores = summary(one.scores, swims)
    (board / folder / "score.json").write_text(
        one.but(swims=swims, scores=scores, **totals(list(scores.values()))).text()
    )


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda swim: swim.but(setting="another") if swim.task == "known" else swim, "not those of its file"),
        (lambda swim: swim.but(speed=9.0, positive_power=1e-3), "has speed = 9.0, and scored again"),
    ],
    ids=["a setting that it has not", "other speeds than were scored"],
)
def test_a_forged_swim_is_found_out(board, change, why):
    forged(board, change)
    refused(board, why)


def test_settings_that_are_farther_from_a_power_are_not_listed_for_it(board):
    shutil.copytree(ROOT / "leaderboard" / "gain_schedule", board / "other")
    swims = {swim.target: swim for swim in read_score(board / "other" / "score.json").swims if swim.where == "water"}
    forged(board, lambda swim: swims[20.0].but(target=1.0) if swim == swims[1.0] else swim, "other")
    refused(board, "comes nearer to 1 W in water than")


def test_an_option_task_without_tasks_is_refused(snakebench_command):
    code, out, err = snakebench_command("score", str(ROOT / "leaderboard" / "sea_snake" / "gait.json"), "--task")
    assert (code, out, err.count("\n")) == (2, "", 1) and "tasks is empty" in err


def test_folders_that_are_hidden_are_no_entries(board):
    (board / ".ipynb_checkpoints").mkdir()
    assert [one.folder.name for one in read_leaderboard(board)] == ["mine"]


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("open loop", "sensors", "by its file it is open loop"),
        ("gait.json", "gait.zip", "execute nothing"),
        ("gait.json", "../../../../etc/passwd.json", "no file inside"),
        ("name", "nickname", "field"),
    ],
)
def test_a_card_that_does_not_fit_is_refused(board, old, new, why):
    edited(board, "card.toml", old, new)
    refused(board, why)


def test_places_count_entries_that_have_one(quick):
    entries = read_leaderboard(ROOT / "leaderboard")
    ranked = [one.score.total for one in entries if one.ranked]
    assert place(quick, "total", entries) == 1 + sum(total > quick.total for total in ranked)
    assert place(quick.but(information="privileged"), "total", entries) is None
    assert place(quick.but(total=None), "known", entries) is None


def test_the_leaderboard_is_checked_printed_and_drawn(snakebench_command, board):
    code, out, _ = snakebench_command("leaderboard", "--check", "--workers", "1")
    assert code == 0 and out.startswith("checked: leaderboard/mine\n") and "sea snake" in out
    assert "Performance profiles" in (board.parent / "reports" / "leaderboard.html").read_text()
    assert leaderboard_page([]).count("<tr") == 1
