"""The study of the limit: its search, its tables and page, its published front, and the command for one point."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pages import page_of

import snakebench as sb
from snakebench.collocation import front, solver
from snakebench.collocation.front import FINER, REFINED, SHARPER, limit_gait
from snakebench.collocation.search import BASE, Point, Search, finer
from snakebench.collocation.solver import Goal, Optimum, plain
from snakebench.collocation.transcription import SHORTEST, Cycle, Mesh
from snakebench.errors import InvalidValue
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.limit import run
from snakebench.studies.limit.page import page
from snakebench.studies.published import published as read_results
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

RESULTS = Path(__file__).parents[2] / "results"
SMALL = {"lengths": (0.28, 0.44, 0.44, 0.32), "masses": (1.0, 1.5, 1.5, 1.2)}  # three joints: solved in a second


def config(**changes):
    settings = study_settings(study_path("limit"), "smoke") | {"name": "limit", "robot": SMALL, "duration": 10.0}
    settings |= {"powers": [0.5, 1.0], "anchors": [1.0], "shown": 1.0, "currencies": ["net", "positive"]}
    settings |= {"bounds": {"policies": {"target": 1.0}, "held": {"target": 1.0, "held": True, "powers": [1.0]}}}
    return study_config(settings | changes)


@pytest.fixture(scope="module")
def results(run_counted, tmp_path_factory):
    return run_counted(config(), tmp_path_factory.mktemp("limit"))[0]


@pytest.fixture(scope="module")
def limit(results):
    return read_table(results / "limit.csv")


# The search, on a made-up body: a start's number of the half period decides in which of two optima it ends.


def made_up(failing=frozenset()):
    goals = {
        Point(m, 0, b, p): Goal(1e-6 * 10**m, 1000.0, "net", float(power), 1.0)
        for m in (0, 1)
        for b in (0, 1)
        for p, power in enumerate((1, 4, 9))
        if (m, b) != (1, 1)
    }

    def solve_all(tasks):
        for task in tasks:
            valley = task.cycle["valley"]
            speed = np.sqrt(goals[task.point].power) * (1.0 if valley == "good" else 0.8) / (1 + task.point.medium)
            status = "failed" if task.point in failing else "optimal"
            cycle = task.cycle | {"half_period": 0.6 + 1e-6 * len(asked)}
            asked.append(task)
            yield Optimum(status, speed, goals[task.point].power, 0.1, 1e-6, 10, cycle)

    asked = []
    return Search(goals, lambda tasks: list(solve_all(tasks)), step=1 / 30), asked


def starts(good=1, bad=1):
    names = [("good", k) for k in range(good)] + [("bad", k) for k in range(bad)]
    return {
        f"{valley} {k}": {"valley": valley, "half_period": 0.5 + 0.01 * k + (valley == "bad")} for valley, k in names
    }


def test_every_point_is_reached_and_the_best_start_wins():
    search, _ = made_up()
    search.run({Point(0, 0, 0, 1): starts(good=1, bad=3)})
    assert set(search.found) == set(search.goals)
    for point, goal in search.goals.items():
        assert search.best(point).optimum.speed == pytest.approx(np.sqrt(goal.power) / (1 + point.medium))
        assert search.finest(point).task.mesh != BASE


def test_what_is_found_under_other_bounds_starts_the_first():
    search, _ = made_up()
    search.run({Point(0, 0, 0, 1): starts(good=0, bad=2), Point(0, 0, 1, 1): starts(good=1, bad=0)})
    for point, goal in search.goals.items():
        assert search.best(point).optimum.speed == pytest.approx(np.sqrt(goal.power) / (1 + point.medium))


def test_starts_agree_that_end_at_nearly_the_same_speed():
    search, _ = made_up()
    anchor = Point(0, 0, 0, 1)
    search.run({anchor: starts(good=2, bad=3)})
    agreeing, tried = search.agreeing(anchor)
    assert tried - agreeing == 3


def test_a_start_counts_once():
    search, asked = made_up()
    search.run({Point(0, 0, 0, 1): starts()})
    keys = [(task.point, task.mesh, task.near, json.dumps(task.cycle)) for task in asked]
    assert len(set(keys)) == len(keys)


def test_two_starts_of_one_period_both_count():
    search, asked = made_up()
    cycles = {valley: {"valley": valley, "half_period": 0.5} for valley in ("good", "bad")}
    search.run({Point(0, 0, 0, 1): cycles})
    assert [task.kind for task in asked[:2]] == ["good", "bad"]
    assert search.agreeing(Point(0, 0, 0, 1))[1] - search.agreeing(Point(0, 0, 0, 1))[0] == 1


def test_a_point_without_an_optimum_has_none():
    anchor, lost = Point(0, 0, 0, 1), Point(1, 0, 0, 2)
    search, _ = made_up(failing={lost})
    search.run({anchor: starts()})
    assert search.best(lost) is None
    assert search.finest(lost) is None


POWERS = (1.0, 4.0, 9.0)


def searched(goals, speed):
    """A search in which a solution has the `speed` of its task and its start's valley, which it keeps as targets."""

    def solve_all(tasks):
        for task in tasks:
            valley = float(np.mean(task.cycle["targets"]))
            reached, valley = speed(task, valley)
            count.append(task)
            cycle = motion(valley, task.mesh, 0.6 + 1e-6 * len(count))
            yield Optimum("optimal", reached, goals[task.point].power, 0.1, 1e-6, 10, cycle)

    count = []
    return Search(goals, lambda tasks: list(solve_all(tasks)), step=1 / 30)


def motion(valley, mesh=BASE, half_period=0.6):
    points = len(mesh.places)
    return plain(Cycle(half_period, np.full((mesh.knots, 2), valley), np.zeros((points, 8)), np.zeros((points - 1, 5))))


def test_faster_held_targets_start_linear_ones_and_those_their_neighbours():
    goals = {
        Point(0, 0, b, p): Goal(1e-6, 1000.0, "net", power, 1.0, held=b == 1)
        for b, p in ((0, 0), (0, 1), (0, 2), (1, 1))
        for power in [POWERS[p]]
    }

    def speed(task, valley):
        valley = 1.0 if task.point.bound == 1 or valley > 0.5 else 0.1  # held targets find the better one themselves
        return np.sqrt(goals[task.point].power) * (1.0 if valley > 0.5 else 0.9), valley

    search = searched(goals, speed)
    search.run({Point(0, 0, 0, 1): {"start": motion(0.1)}})
    for point, goal in goals.items():
        assert search.finest(point).optimum.speed == pytest.approx(np.sqrt(goal.power))


def test_faster_gaits_of_narrower_bounds_start_wider_ones_but_not_the_other_way_round():
    bounds = {0: (1.0, None), 1: (1.5, None), 2: (1.0, 4.0)}  # of targets and of joints' rates
    goals = {Point(0, 0, b, 0): Goal(1e-6, 1000.0, "net", 1.0, *bound) for b, bound in bounds.items()}

    def speed(task, valley):
        own = {0: 0.2, 1: 0.1, 2: 0.3}[task.point.bound]
        return (max(own, valley) if task.kind in REFINED else own), own

    search = searched(goals, lambda task, valley: (speed(task, valley)[0],) * 2)
    search.run({point: {"start": motion(0.0)} for point in goals})
    assert [search.finest(point).optimum.speed for point in goals] == pytest.approx([0.3, 0.3, 0.3])
    assert search.agreeing(Point(0, 0, 0, 0))[0] == 1


def test_what_narrower_bounds_gain_on_later_meshes_starts_the_wider_ones_too():
    goals = {Point(0, 0, b, 0): Goal(1e-6, 1000.0, "net", 1.0, bound) for b, bound in ((0, 1.0), (1, 1.5))}

    def speed(task, valley):
        own = 0.005 * task.mesh.intervals if task.point.bound == 0 else 0.05
        return (max(own, valley),) * 2

    search = searched(goals, speed)
    search.run({point: {"start": motion(0.0)} for point in goals})
    narrow, wide = (search.finest(point) for point in goals)
    assert len({one.task.mesh for one in search.found[Point(0, 0, 0, 0)]}) > 3
    assert wide.optimum.speed == pytest.approx(narrow.optimum.speed)


def test_a_gait_of_more_power_that_takes_less_starts_the_point():
    goals = {Point(0, 0, 0, p): Goal(1e-6, 1000.0, "net", power, 1.0) for p, power in enumerate(POWERS)}

    def speed(task, valley):
        own = (0.1, 0.3, 0.5)[task.point.power]
        return (max(own, valley) if task.kind in REFINED else own,) * 2

    search = searched(goals, speed)
    solve = search._solve_all
    search._solve_all = lambda tasks: [one._replace(power=min(one.power, 3.9)) for one in solve(tasks)]
    search.run({Point(0, 0, 0, p): {"start": motion(0.0)} for p in range(3)})
    assert [search.finest(point).optimum.speed for point in goals] == pytest.approx([0.1, 0.5, 0.5])


def root_of_smoothing(task, valley):
    """A speed that smoothing lessens, though little at the lowest power."""
    return 1.0 - (10 if task.point.power else 0.1) * (task.smoothing or 1e-3) ** 0.5, valley


@pytest.fixture
def sharpest(monkeypatch):
    """Searches three powers, of which simulations have the given speeds, and chooses the smoothing of each.

    A speed may depend on what was found. With `whole`, meshes are chosen too.
    """

    def chosen(simulated, status=lambda task: "optimal", whole=False):
        goals = {Point(0, 0, 0, p): Goal(1e-6, 1000.0, "net", power, 1.0) for p, power in enumerate(POWERS)}
        search = searched(goals, root_of_smoothing)
        solve = search._solve_all
        search._solve_all = lambda tasks: [
            one._replace(status=status(task)) for task, one in zip(tasks, solve(tasks), strict=True)
        ]

        def simulate(config, evaluate, search, found):
            speeds = {point: simulated[point.power] for point in found}
            speeds = {point: speed(found[point]) if callable(speed) else speed for point, speed in speeds.items()}
            gaps = {point: speeds[point] / one.optimum.speed - 1 for point, one in found.items()}
            return {point: run.Swum(one, None, (), (gaps[point], gaps[point] / 2)) for point, one in found.items()}

        monkeypatch.setattr(run, "_simulate", simulate)
        search.run({point: {"start": motion(0.0)} for point in goals})
        counted = [search.agreeing(point) for point in goals]
        swum = run._simulated(None, None, search) if whole else run._sharpest(None, None, search, goals)
        assert [search.agreeing(point) for point in goals] == counted  # it is no start
        of = [[one.task.smoothing for one in search.found[point] if one.task.kind == SHARPER] for point in goals]
        return search, [one.found for one in swum.values()], of

    return chosen


def test_smoothing_becomes_less_while_that_changes_the_speed_and_brings_simulation_nearer(sharpest):
    search, chosen, tried = sharpest([1.0, 0.9, 1.0])  # the second is that of 0.1 mm/s
    assert tried == [[3e-4], [3e-4, 1e-4, 3e-5], [3e-4, 1e-4, 3e-5, 1e-5]]
    assert [one.task.smoothing for one in chosen] == [3e-4, 1e-4, 1e-5]  # the first changes too little to go on
    assert all(search.change(one.task.point, one.task.mesh) == 0 for one in chosen)  # smoothing is no change of mesh


def test_a_failed_solution_with_less_smoothing_leaves_that_with_more(sharpest):
    _, chosen, tried = sharpest([1.0, 1.0, 1.0], lambda task: "failed" if task.smoothing == 1e-4 else "optimal")
    assert tried[2] == [3e-4, 1e-4]
    assert [one.task.smoothing for one in chosen] == [3e-4, 3e-4, 3e-4]


def test_what_simulation_does_not_confirm_is_solved_on_a_finer_mesh_and_kept_where_that_is_nearer(sharpest):
    def off(coarse, fine):
        return lambda one: one.optimum.speed * (coarse if one.task.mesh.parts < 3 else fine)

    search, chosen, _ = sharpest([off(1.0, 1.1), off(1.05, 1.0), off(1.05, 1.1)], whole=True)
    assert [one.task.mesh for one in chosen] == [Mesh(18, 2), Mesh(18, 3), Mesh(18, 2)]
    assert [any(one.task.mesh.parts == 3 for one in found) for found in search.found.values()] == [False, True, True]


@pytest.mark.parametrize("status", ["failed", "feasible"])
def test_a_finer_mesh_that_fails_is_tried_again_without_more_smoothing(sharpest, status):
    def off(one):
        return one.optimum.speed * (1.05 if one.task.mesh.parts < 3 else 1.0)

    search, chosen, _ = sharpest(
        [off] * 3, lambda task: status if task.mesh.parts == 3 and not task.smoothing else "optimal", whole=True
    )
    for one, found in zip(chosen, search.found.values(), strict=True):
        first, second = (each for each in found if each.task.mesh.parts == 3 and each.task.kind == FINER)
        assert (first.task.smoothing, second.task.smoothing) == (None, 1e-3)
        assert second.task.cycle == (first.optimum.cycle if status == "feasible" else first.task.cycle)
        assert one.task.mesh.parts == 3


def test_no_point_is_slower_than_one_of_less_power():
    goals = {Point(0, 0, 0, p): Goal(1e-6, 1000.0, "net", power, 1.0) for p, power in enumerate(POWERS)}

    def speed(task, valley):
        own = (0.1, 0.5, 0.3)[task.point.power]
        valley = (
            max(own, valley) if task.kind in REFINED else own
        )  # from neighbours nothing is learned on the base mesh
        return valley, valley

    search = searched(goals, speed)
    search.run({Point(0, 0, 0, p): {"start": motion(0.0)} for p in range(3)})
    assert [search.finest(point).optimum.speed for point in goals] == pytest.approx([0.1, 0.5, 0.5])
    assert [search.change(point, search.finest(point).task.mesh) for point in goals] == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("knots", [*range(4, 40, 3), 12])
@pytest.mark.parametrize("half_period", [0.2, 0.45, 0.7, 1.5, 4.0])
def test_a_finer_mesh_is_finer_and_its_knots_have_nearly_room(knots, half_period):
    mesh = Mesh(knots, 1)
    if half_period < knots * SHORTEST:
        pytest.skip("no gait on this mesh is so fast")
    new, room = finer(mesh, half_period), half_period / SHORTEST
    assert new == Mesh(8, 3) if mesh == BASE and room < 12.06 else new.intervals > mesh.intervals
    assert new.knots <= max(knots, room + 1e-9)


# The tables.


def test_all_points_are_published_and_agree_with_their_replays(limit):
    assert limit["bounds"].value_counts().to_dict() == {"policies": 4, "held": 2}
    assert (limit["gap"].abs() <= 0.01).all() and (limit["planar_gap"].abs() <= 0.01).all()
    assert (limit["optimal_power"] <= limit["allowed"] * (1 + 1e-3)).all()


def test_the_published_figures_are_pybullets_of_the_published_gait(results, limit):
    gaits = read_table(results / "gaits.csv")
    row = limit.iloc[0]
    gaits = gaits[gaits["bounds"] == row["bounds"]]
    gait = limit_gait(gaits[(gaits["currency"] == row["currency"]) & (gaits["allowed"] == row["allowed"])])
    swim = sb.evaluate(gait, "water", robot=sb.Robot(**SMALL), physics_rate=960, duration=30.0)
    assert swim.path_speed == pytest.approx(row["path_speed"], rel=2e-3)
    assert swim.power == pytest.approx(row["power"], rel=5e-3)


def test_more_power_is_faster_and_positive_power_buys_less(limit):
    by = limit[limit["bounds"] == "policies"].set_index(["currency", "allowed"])["optimal_speed"]
    assert by["net", 1.0] > by["net", 0.5] and by["positive", 1.0] > by["positive", 0.5]
    assert (by["net"] > by["positive"]).all()


def test_gaits_mirror_themselves_after_half_a_period(results):
    for _, rows in read_table(results / "gaits.csv").groupby(["bounds", "currency", "allowed"]):
        targets = np.array(limit_gait(rows).targets)
        half = len(targets) // 2
        np.testing.assert_allclose(targets[half:], -targets[:half], atol=1e-6)


def test_held_targets_lose_little_and_last_whole_control_steps(results, limit):
    speeds = limit[limit["allowed"] == 1.0].pivot(index="currency", columns="bounds", values="optimal_speed")
    assert (1 - speeds["held"] / speeds["policies"]).between(-0.002, 0.1).all()
    gaits = read_table(results / "gaits.csv")
    for _, rows in gaits[gaits["bounds"] == "held"].groupby("currency"):
        each = 30 * rows["period"].iloc[0] / len(rows)
        assert each == pytest.approx(round(each))


def test_a_held_gait_swims_as_its_optimum(results, limit):
    gaits, row = read_table(results / "gaits.csv"), limit[limit["bounds"] == "held"].iloc[0]
    rows = gaits[(gaits["bounds"] == "held") & (gaits["currency"] == row["currency"])]
    gait = limit_gait(rows).stepped(30, 30.0)
    swim = sb.evaluate(gait, "water", robot=sb.Robot(**SMALL), physics_rate=960, duration=30.0)
    assert swim.path_speed == pytest.approx(row["path_speed"], rel=2e-3)


def test_run_again_it_computes_nothing_and_writes_the_same(results):
    before = {path.name: path.read_bytes() for path in results.glob("*.csv*")}
    run_study(config(), results.parent, workers=1)
    assert {path.name: path.read_bytes() for path in results.glob("*.csv*")} == before
    assert json.loads((results / "manifest.json").read_text())["computed"] == 0


def test_the_page_shows_every_point_and_how_many_starts_agree(results, limit):
    shown = page_of(results)
    assert len(shown["points"].rows) == 4
    assert shown["n_points"] == 4
    assert shown["agree"] == (limit[limit["bounds"] == "policies"]["agreeing"] >= 2).sum()
    assert len(shown["swimmers"]) == 2


def test_the_page_tells_how_often_each_kind_of_start_is_near_the_fastest(results):
    shown, solutions = page_of(results), read_table(results / "solutions.csv").query("bounds == 'policies'")
    rows = {row[0]: list(map(int, row[1:])) for row in shown["kinds"].rows}
    assert set(rows) == set(solutions["start"]) - set(REFINED) and {"thin", "power above"} <= set(rows)
    coarse = solutions[~solutions["start"].isin(REFINED)]
    fastest = coarse[coarse["status"] == "optimal"].groupby(["currency", "allowed"])["optimal_speed"].max()
    for kind, (tried, optima, near) in rows.items():
        own = coarse[coarse["start"] == kind]
        best = own.set_index(["currency", "allowed"]).index.map(fastest)
        assert (len(own), (own["status"] == "optimal").sum()) == (tried, optima)
        assert ((own["status"] == "optimal") & (own["optimal_speed"] >= 0.99 * best)).sum() == near
    assert shown["unpublished"] is None


def test_the_page_does_without_points_that_were_not_published(results):
    study = read_results(results)
    first = study.config["powers"][0]
    tables = {name: study.tables[name][study.tables[name]["allowed"] != first] for name in ("limit", "gaits")}
    manifest = study.manifest | {"config": study.config | {"shown": first}}
    shown = page(study._replace(tables=study.tables | tables, manifest=manifest))
    assert shown["waveforms"] is None and shown["speeds"]
    assert {row[2] for row in shown["unpublished"].rows} == {f"{first:g}"}
    assert shown["n_unpublished"] == len(study.tables["limit"].query("allowed == @first"))


# Refusals.


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"anchors": [2.0]}, "anchors, shown and those of bounds: 2 W is none of the powers 0.5, 1"),
        ({"powers": [1.0, 0.5]}, "each must be above the one before"),
        ({"robot": SMALL | {"proportional_gain": 0.0}}, "proportional_gain = 0: the limit is of servos"),
        (
            {"robot": SMALL | {"angle_limit": 0.3}},
            "angle_limit = 0.3: the limit is of joints without an end stop",
        ),
        ({"bounds": {"wide": {"target": 7.0}}}, "allowed are 0.05 to 2"),
        ({"bounds": {"held": {"target": 1.5, "held": True}}}, "target = 1.5: held targets are at most 1 rad"),
        ({"bounds": {"held": {"held": True}}}, "bounds.held.held: the first bounds are of linear targets"),
    ],
)
def test_wrong_settings_are_refused_in_a_line(changes, message):
    with pytest.raises(InvalidValue, match=message):
        config(**changes)


def test_without_casadi_a_line_says_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "casadi", None)
    with pytest.raises(InvalidValue, match=r'needs CasADi: .*pip install .*"\.\[limit\]"'):
        run_study(config(), tmp_path, workers=1)


# The published front.


def test_the_limit_of_another_robot_is_not_the_papers(results, monkeypatch):
    monkeypatch.setattr(front, "_TABLES", (results / "limit.csv",))
    front._published.cache_clear()
    with pytest.raises(InvalidValue, match="limit is of another robot than the paper's"):
        sb.limit("water", 1.0)
    front._published.cache_clear()


@pytest.fixture
def published(monkeypatch):
    """A made-up limit: v = sqrt(P) / 10 in a thin fluid, half of that in one that is a hundred times thicker.

    Under the other bounds, each is half as fast.
    """
    rows = [
        {"viscosity": viscosity, "currency": "net", "bounds": bounds, "power": power, "positive_power": 2 * power}
        | {"speed": factor * share * np.sqrt(power) / 10, "change": 0.001, "gap": 0.002, "planar_gap": -0.001}
        | {"multiplier": factor * share / np.sqrt(power) / 20}
        for viscosity, factor in ((1.14e-6, 1.0), (2.32e-4, 0.5))
        for bounds, share in (("policies", 1.0), ("held", 0.5))
        for power in (1.0, 2.0, 4.0, 8.0)
    ]
    monkeypatch.setattr(front, "_published", lambda: pd.DataFrame(rows))


def test_at_a_point_the_limit_is_the_table(published):
    one = sb.limit("water", 4.0)
    assert one.speed == pytest.approx(0.2)
    assert one.error == pytest.approx(0.002 * 0.2)
    assert sb.limit("water", 4.0, bounds="held").speed == pytest.approx(0.1)


def test_between_points_the_error_covers_the_truth(published):
    for power in (1.3, 3.0, 6.0):
        one = sb.limit("water", power)
        assert abs(one.speed - np.sqrt(power) / 10) <= one.error
    assert (
        sb.limit("oil1", 2.0).speed
        < sb.limit(sb.Fluid(kinematic_viscosity=1e-5), 2.0).speed
        < sb.limit("water", 2.0).speed
    )


def test_a_viscosity_next_to_one_that_lacks_the_power_is_refused(published, monkeypatch):
    rows = front._published()
    thick = rows[rows["power"] > 1.5].assign(viscosity=4.79e-3)
    monkeypatch.setattr(
        front, "_published", lambda: pd.concat([rows[rows["power"] != 1], thick, rows[rows["power"] == 1]])
    )
    assert sb.limit("oil1", 1.0).speed == pytest.approx(0.05)
    with pytest.raises(InvalidValue, match="power = 1 W: in this fluid the limit is known from 2 to 8 W"):
        sb.limit("1e-3,890", 1.0)


def test_where_more_power_makes_no_gait_faster_the_limit_stays(published, monkeypatch):
    rows = front._published()
    last, water = rows["power"] == 8, rows["viscosity"] < 1e-5
    slower = rows[last & water].assign(power=9.0, speed=0.25, multiplier=0.0)  # than with 8 W
    full = rows.assign(multiplier=rows["multiplier"].where(~(last & water), 1e-9))
    monkeypatch.setattr(front, "_published", lambda: pd.concat([full, slower]))
    assert sb.limit("water", 50.0).speed == sb.limit("water", 8.5).speed == pytest.approx(np.sqrt(8) / 10)


def test_between_viscosities_the_error_covers_one_that_is_left_out(monkeypatch):
    table = read_table(RESULTS / "limit" / "limit.csv").query("bounds == 'policies'")
    known = [part for _, part in table.groupby("viscosity")]
    off, errors = [], []
    for k in range(1, len(known) - 1):
        rows, one = pd.concat([*known[:k], *known[k + 1 :]]), known[k]
        monkeypatch.setattr(front, "_published", lambda rows=rows: rows)
        for _, point in one.query("currency == 'net' and allowed in [3, 7, 15]").iterrows():
            found = sb.limit(sb.Fluid(kinematic_viscosity=point["viscosity"]), point["power"])
            off.append(abs(found.speed - point["speed"]))
            errors.append(found.error)
    assert len(off) >= 25 and np.mean(np.array(off) <= errors) >= 0.9


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (
            {"fluid": "oil2", "power": 2.0},
            "viscosity = 0.00479 m\\^2/s: the limit is known from 1.14e-06 to 0.000232",
        ),
        ({"fluid": "water", "power": 50.0}, "power = 50 W: in this fluid the limit is known from 1 to 8 W"),
        ({"fluid": "water", "power": 2.0, "currency": "gross"}, "unknown currency 'gross'"),
        ({"fluid": "water", "power": 2.0, "bounds": "none"}, "unknown bounds 'none'"),
        ({"fluid": "1.14e-6,700", "power": 2.0}, "density = 700 kg/m\\^3: the limit is known for 999"),
    ],
)
def test_outside_its_range_the_limit_is_refused(published, asked, message):
    with pytest.raises(InvalidValue, match=message):
        sb.limit(**asked)


# The command.


COMMAND = ("limit", "--joints", "3", "--workers", "1")


def test_the_command_prints_an_optimum_and_writes_a_gait_that_swims_so(snakebench_command, tmp_path):
    code, out, _ = snakebench_command(
        *COMMAND, "--power", "1", "--json", "--save", "fast.json", "--animate", "fast.html"
    )
    numbers = json.loads(out)
    assert code == 0
    gait = tmp_path / "fast.json"
    swim = json.loads(
        snakebench_command("simulate", "file", str(gait), "--joints", "3", "--physics-rate", "960", "--json")[1]
    )
    assert swim["path_speed"] == pytest.approx(numbers["speed"], rel=2e-3)
    assert "<canvas" in (tmp_path / "fast.html").read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--power", "-1"), "powers"),
        (("--power", "1", "--fluid", "honey"), "unknown fluid 'honey'"),
        (("--power", "1", "--currency", "gross"), "gross"),
        (("--power", "1", "--bound", "9"), "allowed are 0.05 to 2"),
    ],
)
def test_the_command_refuses_in_a_line(snakebench_command, words, message):
    code, out, err = snakebench_command(*COMMAND, *words)
    assert (code, out) == (2, "")
    assert message in err and err.count("\n") == 1


def test_more_power_than_a_gait_can_use_is_refused_with_what_it_takes(snakebench_command):
    code, _, err = snakebench_command(*COMMAND, "--power", "500", "--bound", "0.3")
    assert code == 2
    assert "power = 500 W: the fastest gait within these bounds takes" in err.splitlines()[-1]


def test_an_optimum_that_does_not_hold_in_simulation_is_none(snakebench_command, monkeypatch):
    monkeypatch.setattr(run.Swum, "agrees", property(lambda _: False))
    code, out, err = snakebench_command(*COMMAND, "--power", "1")
    assert (code, out) == (3, "") and "no optimum holds in simulation" in err.splitlines()[-1]


@pytest.mark.parametrize(
    ("status", "reached"),
    [
        ("feasible", "the fastest motion, 0.25 m/s at 4 W, is none (status: feasible)"),
        ("failed", "no start swims"),
    ],
)
def test_the_error_without_an_optimum_names_the_best_motion_and_its_status(status, reached):
    goals = {Point(0, 0, 0, 0): Goal(1e-6, 1000.0, "net", 4.0, 1.0)}
    ends = iter([(0.2, 3.0), (0.25, 4.0)])
    search = Search(goals, lambda tasks: [Optimum(status, *next(ends), 0.1, 1.0, 300, {}) for _ in tasks], 1 / 30)
    search.run(
        {point: {name: motion(1.0, half_period=time) for name, time in (("a", 0.5), ("b", 0.6))} for point in goals}
    )
    assert f"limit: no optimum after 2 solutions: {reached}" in str(run._no_optimum(config(), search))


def test_without_an_optimum_a_line_says_so_and_the_exit_code_is_3(snakebench_command, monkeypatch):
    monkeypatch.setitem(solver._SETTINGS, "ipopt.max_iter", 2)
    solver._solver.cache_clear()
    try:
        code, out, err = snakebench_command(*COMMAND, "--power", "1")
    finally:
        solver._solver.cache_clear()
    assert (code, out) == (3, "")
    assert re.search(r"no optimum after \d+ solutions: .*; other powers or bounds are needed$", err.strip())
