"""Numbers of the comparison can be followed to rows of tables; verdicts ask for whole intervals; bugs raise."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import comparison_audit
import numpy as np
import pandas as pd
import pytest
from markdown_it import MarkdownIt
from scipy import stats
from writing import write_manifest, write_table

from snakebench.comparison.claims import CLAIMS, Claim, claims, markdown
from snakebench.comparison.gain_ledger import added, change, ledger, orders, switched
from snakebench.comparison.judges import JUDGES
from snakebench.comparison.results import Measurement, Missing, Results, rising
from snakebench.report.table import COSTS
from snakebench.tables import read_table

COMMITTED = Path(__file__).parents[2] / "results"


def of(*values: float) -> Measurement:
    seeds = tuple(range(len(values)))
    return Measurement("a", "m/s", values, seeds, "study/table.csv", "all", "snakebench run-study study")


@pytest.fixture(scope="module")
def committed():
    return Results(COMMITTED)


@pytest.fixture(scope="module")
def judged(committed):
    return claims(committed)


def test_a_measurement_has_one_value_a_seed_and_names_its_rows(committed):
    chosen = committed.rows("teacher_student", "evaluations", policy="student", fluid="water")
    found = chosen.measure("a", "m/s", "speed")
    table = read_table(COMMITTED / "teacher_student" / "evaluations.csv")
    rows = table[(table["policy"] == "student") & (table["fluid"] == "water")]
    assert found.values == pytest.approx(rows.groupby("seed")["speed"].mean().tolist())
    assert found.row()["table"] == "teacher_student/evaluations.csv"
    assert found.row()["rows"] == "policy = student, fluid = water: speed"
    assert found.row()["command"] == "snakebench run-study teacher_student"


def test_an_interval_is_students_t():
    low, high = of(1.0, 2.0, 4.0).interval
    half = stats.t.ppf(0.975, 2) * pd.Series([1.0, 2.0, 4.0]).sem()
    assert (low, high) == pytest.approx((7 / 3 - half, 7 / 3 + half))
    assert of(1.0).interval is None


@pytest.mark.parametrize(
    ("take", "named"),
    [
        (lambda r: r.rows("sea_snake", "optima", fluid="tar"), "no rows with fluid = tar in optima.csv"),
        (
            lambda r: r.rows("sea_snake", "optima", fluid="oil1").measure("a", "m/s", pd.Series([np.nan])),
            "sea_snake/optima.csv: a is not defined",
        ),
        (lambda r: r.study("nothing"), "nothing: no results; snakebench run-study nothing makes them"),
    ],
)
def test_what_is_missing_is_named_with_the_command_that_makes_it(committed, take, named):
    with pytest.raises(Missing) as error:
        take(committed)
    assert named in str(error.value) and "snakebench run-study" in str(error.value)


def test_the_published_profile_comes_before_a_smaller_one(tmp_path):
    for name in ("bench", "sea_snake", "sea_snake-quick"):
        (tmp_path / name).mkdir()
        write_manifest(tmp_path / name, {"study": name, "config": {"method": "sea_snake"}, "fluids": {}})
    assert Results(tmp_path).study("sea_snake").directory.name == "sea_snake"
    (tmp_path / "sea_snake" / "manifest.json").unlink()
    assert Results(tmp_path).study("sea_snake").directory.name == "sea_snake-quick"


def test_a_students_return_is_a_share_of_its_own_teachers(committed, judged):
    share = next(one for one in committed.measurements if one.id == "student/share of its teacher's return")
    table = read_table(COMMITTED / "teacher_student" / "range.csv").groupby(["policy", "seed"])["return"].mean()
    assert share.values == pytest.approx((100 * table["student"] / table["teacher"]).tolist())


def test_paired_seeds_differ_by_their_differences_and_others_by_welch():
    before, after = of(1.0, 2.0, 3.0), of(1.5, 2.4, 3.6)
    center, low, high = change(before, after, paired=True)
    half = stats.t.ppf(0.975, 2) * pd.Series([0.5, 0.4, 0.6]).sem()
    assert (center, low, high) == pytest.approx((0.5, 0.5 - half, 0.5 + half))
    _, wide_low, wide_high = change(before, after)
    assert wide_low < low and wide_high > high
    assert change(before, after._replace(seeds=(0, 1, 3)), paired=True) == change(before, after)
    assert change(of(1.0), of(2.0)) == (1.0, 1.0, 1.0)
    center, low, high = change(of(1.0), after)
    half = stats.t.ppf(0.975, 2) * pd.Series(after.values).sem()
    assert (center, low, high) == pytest.approx((1.5, 1.5 - half, 1.5 + half))


def test_a_change_is_wider_by_the_errors_of_both_sides():
    before, after = of(1.0, 2.0, 3.0), of(1.5, 2.4, 3.6)
    center, low, high = change(before, after)
    found = change(before._replace(error=0.1), after._replace(error=0.2))
    assert found == pytest.approx((center, low - 0.3, high + 0.3))


def test_two_changes_add_the_same_in_either_order_but_for_their_interaction():
    alone = {"paper": 1.0, "frequency": 1.3, "torque": 1.1}
    independent, found = added(**alone, both=1.4), added(**alone, both=1.9)
    assert independent["interaction"] == pytest.approx(0.0) and found["interaction"] == pytest.approx(0.5)
    assert found["frequency"] + found["torque after frequency"] == pytest.approx(0.9)
    assert found["torque"] + found["frequency after torque"] == pytest.approx(0.9)


def test_switching_spends_the_mean_power_where_it_gains_most():
    water, oil = (
        pd.DataFrame({"speed": speeds, "power": [1.0, 5.0], "positive_power": [2.0, 6.0]})
        for speeds in ([0.2, 0.5], [0.1, 0.2])
    )
    means = switched([water, oil]).to_numpy().tolist()
    # For 1, 3 and 5 W of P in the mean: at 3 W the 5 W are better spent in water.
    assert means == [pytest.approx(of) for of in ((0.15, 1.0, 2.0), (0.3, 3.0, 4.0), (0.35, 5.0, 6.0))]


def test_a_front_that_ends_below_the_power_asked_for_is_compared_at_that_of_its_fastest_point(committed):
    steps = ledger(committed).query("view == 'equal' and place == 'water'").set_index("step")
    fronts = read_table(COMMITTED / "pareto" / "fronts.csv").query("space == 'paper' and front == 'water'")
    assert steps.loc["sinusoid", "power"] == fronts.loc[fronts["speed"].idxmax(), "power"] < 10  # the fastest one
    assert steps.loc[["wider sinusoid", "teacher", "student"], "power"].tolist() == pytest.approx([10.0] * 3)


def test_a_count_of_seeds_has_no_interval():
    counted = of(1.0, 0.0, 1.0)._replace(counted=True)
    assert counted.text() == "2 of 3" and counted.interval is None and counted.row()["low"] is None


def test_a_rule_asks_for_the_whole_interval():
    assert of(1.0, 1.1, 1.2).above(0.8) and not of(0.5, 1.0, 1.5).above(0.8) and of(0.9).above(0.8)
    assert of(1.0, 1.1, 1.2).below(1.4) and not of(0.5, 1.0, 1.5).below(1.4) and of(0.9).below(1.4)
    assert rising([of(1.0, 2.0), of(1.5, 2.5)]) and not rising([of(1.0, 2.0), of(1.5, 1.9)])
    assert not rising([of(1.0, 2.0), of(1.5)])


def test_every_claim_has_a_judge_and_is_judged_from_the_committed_results(judged):
    found, missing = judged
    assert missing == [] and list(found) == list(CLAIMS)
    assert {claim.verdict for claim in found.values()} <= {"reproduced", "in part", "not"}


def test_a_second_judge_reads_the_same_verdicts_from_the_tables(judged):
    found, _ = judged
    assert comparison_audit.verdicts(COMMITTED) == {id: claim.verdict for id, claim in found.items()}


def links(results: Path, *rewritten: str) -> Path:
    """The committed results, of which the files of some studies can be written again."""
    for study in COMMITTED.iterdir():
        if study.name in rewritten:
            (results / study.name).mkdir()
            for path in study.iterdir():
                (results / study.name / path.name).symlink_to(path)
        else:
            (results / study.name).symlink_to(study)
    return results


def rewrite(results: Path, study: str, name: str, change) -> None:
    """Write a table of linked results with a change."""
    table = read_table(COMMITTED / study / f"{name}.csv")
    for path in (results / study).glob(f"{name}.csv*"):
        path.unlink()
    write_table(results / study / f"{name}.csv", change(table))


def scaled(column: str, factor: float, **where: str):
    """Multiply a column where other columns have some values."""

    def change(table: pd.DataFrame) -> pd.DataFrame:
        rows = (table[list(where)] == pd.Series(where, dtype=object)).all(axis=1)
        return table.assign(**{column: table[column].mask(rows, factor * table[column])})

    return change


HOME = {"gait_of": "water", "fluid": "water"}
cheap = scaled("cost_of_transport", 0.1, **HOME)
OTHERWISE = {  # changes of tables, and verdicts that follow from the rules
    "a tail that grows": (
        "operating_point",
        "points",
        scaled("tail_amplitude", 2, fluid="oil2"),
        {"tail": "reproduced"},
    ),
    "a frequency that rises": (
        *("operating_point", "points", scaled("swim_frequency", 9, fluid="oil2")),
        {"frequency": "not"},
    ),
    "torques of 4.5 N m": (
        *("operating_point", "points", lambda table: table.assign(torque_amplitude=4.5)),
        {"torque": "reproduced"},
    ),
    "equal torques that are too large": (
        *("operating_point", "points", lambda table: table.assign(torque_amplitude=9.0)),
        {"torque": "in part"},
    ),
    "a policy at a fifth of its speed": (
        *("operating_point", "points", scaled("speed", 0.2)),
        {"beats-each-fluid": "not", "beats-switching": "not", "cheaper-than-switching": "not", "sea-snake": "in part"},
    ),
    "a fast gait in oil2": (
        *("operating_point", "points", scaled("speed", 9, fluid="oil2")),
        {"own-fluid": "in part"},
    ),
    "a fast gait in oil1": (
        *("operating_point", "points", scaled("speed", 1.5, fluid="oil1")),
        {"beats-each-fluid": "reproduced"},
    ),
    "a gait of oil1 that is fast in oil1": (
        *("operating_point", "matrix", scaled("speed", 9, gait_of="oil1", fluid="oil1")),
        {"fastest-at-home": "reproduced"},
    ),
    "a gait of water that needs little power": (
        *("operating_point", "matrix", lambda table: cheap(scaled("power", 0.1, **HOME)(table))),
        {"cheapest-at-home": "reproduced"},
    ),
    "a fixed tail that grows": (
        *("operating_point", "sinusoid", scaled("link_half", 9, fluid="oil2")),
        {"fixed-sinusoid": "in part"},
    ),
    "a policy at a fifth of its speed, in one gait for all fluids": (
        *("operating_point", "points", scaled("speed", 0.2)),
        {"beats-integrated": "not"},
    ),
    "a student at nine tenths of its return": (
        *("teacher_student", "range", scaled("return", 0.9, policy="student")),
        {"imitation": "not"},
    ),
    "no privilege, no return": (
        *("teacher_student", "range", scaled("return", 0.01, policy="symmetric")),
        {"privilege": "reproduced"},
    ),
    "a student that swims half as far": (
        *("adaptation", "courses", scaled("distance", 0.5, method="student")),
        {"adapts": "in part"},
    ),
    "a top speed that is nothing": (
        "teacher_student",
        "evaluations",
        scaled("speed", 0.1),
        {"own-fluid": "reproduced"},
    ),
}


@pytest.mark.parametrize("name", OTHERWISE)
def test_both_judges_follow_the_rules_where_results_are_otherwise(tmp_path, monkeypatch, name):
    study, table, change, verdicts = OTHERWISE[name]
    rewrite(links(tmp_path, study), study, table, change)
    monkeypatch.setattr("snakebench.comparison.claims.CLAIMS", {id: CLAIMS[id] for id in verdicts})
    monkeypatch.setattr(comparison_audit, "RULES", {id: comparison_audit.RULES[id] for id in verdicts})
    found, missing = claims(Results(tmp_path))
    assert missing == []
    assert {id: claim.verdict for id, claim in found.items()} == verdicts == comparison_audit.verdicts(tmp_path)


def test_claims_about_gaits_are_not_judged_without_the_operating_point(tmp_path):
    for study in COMMITTED.iterdir():
        if study.name != "operating_point":
            (tmp_path / study.name).symlink_to(study)
    found, missing = claims(Results(tmp_path))
    assert {"own-fluid", "tail", "fastest-at-home", "beats-switching"}.isdisjoint(found)
    assert {"imitation", "adapts"} <= set(found)
    assert set(missing) == {"operating_point: no results; snakebench run-study operating_point makes them"}


def test_claims_are_of_the_papers_fluids_only(monkeypatch):
    found, missing = claims(SimpleNamespace(fluids=["honey"]))
    assert found == {} and "honey" not in missing[0] and "water" in missing[0]


def test_a_bug_in_a_judge_is_not_reported_as_damaged_results(committed, monkeypatch):
    monkeypatch.setitem(JUDGES, "frequency", lambda results, _: results.mispelt)
    with pytest.raises(AttributeError, match="mispelt"):
        claims(committed)


@pytest.fixture
def twice(tmp_path):
    """The committed results with fronts whose P+ is twice their P."""
    studies = ("pareto", "learned_front")
    links(tmp_path, *studies)
    for study, name in product(studies, ("fronts", "switching")):
        rewrite(tmp_path, study, name, lambda table: table.assign(positive_power=2 * table["power"]))
    return Results(tmp_path)


def test_the_ledger_has_both_costs_of_the_gaits_whose_speeds_it_compares(twice):
    steps = ledger(twice).query("view == 'equal' and not step.str.contains('waveform')")
    cost, positive_cost = (steps[name].to_numpy() for name in COSTS)
    assert len(steps) and positive_cost == pytest.approx(2 * cost)


@pytest.mark.slow
def test_the_ledgers_speeds_do_not_depend_on_the_other_currency(twice, committed):
    with_it, without = ([one["speed"].values for one in ledger(r)["measured"]] for r in (twice, committed))
    assert with_it == without


APART = ["faster", "stronger"]  # spaces of more frequency, and of more torque


def with_spaces(root: Path, change: Callable[[pd.DataFrame], pd.DataFrame]) -> Results:
    """The committed results with other fronts of sinusoids, made of those of the paper's and of the wider range."""
    links(root, "pareto")
    for name in ("fronts", "switching"):
        rewrite(root, "pareto", name, lambda table: change(table[~table["space"].isin(APART)]))
    return Results(root)


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    """With the paper's fronts as those of higher torque and the wider as of higher frequency."""
    names = {"space": {"paper": "stronger", "extended": "faster"}}
    return with_spaces(
        tmp_path_factory.mktemp("split"),
        lambda table: pd.concat([table, table.replace(names)], ignore_index=True),
    )


@pytest.mark.slow
def test_the_ledger_shows_frequency_before_torque(split):
    steps = ledger(split)
    assert (steps["step"] == "faster sinusoid").sum() == 3 * 4
    assert (steps[steps["step"] == "wider sinusoid"]["change"] == 0).all()  # here all of the gain is the frequency's


def test_either_order_of_frequency_and_torque_is_shown(split):
    found = orders(split)
    assert len(found) == 3 * 4
    assert (found["torque"] == 0).all() and (found["frequency"] == found["both"]).all() and found["both"].max() > 0


HOSTILE = {
    "a pipe": "a | b || c",
    "an escaped pipe": r"a \| b",
    "lines": "a\n\n| b |\r\n# c\x0b\u2028- d",
    "code": "`a` ``b",
    "HTML": "<img src=x onerror=alert(1)><!-- a",
    "an entity": "&lt;b&gt; &#60;",
    "a link": "[a](https://a.example) [b][c] [d]: e <https://f.example>",
    "a picture": "![a](https://a.example/a.png)",
    "emphasis": "*a* **b** _c_ __d__ ~~e~~ f_g",
    "a formula": "$x^2$ $$y$$",
    "a bare address": "https://a.example www.a.example WWW.A.EXAMPLE ftp://a.example me@a.example",
    "a backslash at the end": "a\\",
}


def table_of(text: str) -> str:
    return markdown([Claim(text, text, text, "5", "reproduced", "", "")] * 2)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_cell_of_the_claims_is_the_text_that_it_was_given(name):
    text = HOSTILE[name]
    tokens = MarkdownIt("commonmark").enable(["table", "strikethrough"]).parse(table_of(text))
    assert {token.type.partition("_")[0] for token in tokens} == {"table", "thead", "tbody", "tr", "th", "td", "inline"}
    cells = [after for before, after in zip(tokens, tokens[1:], strict=False) if before.type == "td_open"]
    assert len(cells) == 2 * 5
    children = cells[0].children or []
    assert {child.content for child in children if child.type == "html_inline"} <= {"<span>", "</span>"}
    assert {child.type for child in children} <= {"text", "text_special", "html_inline"}
    assert "".join(child.content for child in children if child.type != "html_inline") == " ".join(text.split())


@pytest.mark.parametrize("sign", ["://", "www.", "WWW.", "@", "$"])
def test_no_address_or_formula_is_left_for_github_to_find(sign):
    assert sign not in table_of(HOSTILE["a bare address"] + HOSTILE["a formula"])
