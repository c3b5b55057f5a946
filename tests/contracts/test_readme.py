"""README and docs are true: their figures are those of the committed results, and CI runs the test command."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from pathlib import Path

import comparison_audit
import numpy as np
import pytest
import readme_audit

import snakebench as sb
from snakebench.manifest import read_manifest
from snakebench.names import CURRENCIES, STUDIES
from snakebench.scoring.leaderboard import read_leaderboard, value_in
from snakebench.scoring.page import worth_table
from snakebench.scoring.tasks import TASKS
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.published import published
from snakebench.studies.running import study_config
from snakebench.tables import read_table, table_file

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
MEASURED = ["speed", "power", "return"]
FOUND = (ROOT / "docs" / "results.md").read_text()
PHYSICS = (ROOT / "docs" / "physics.md").read_text()


def test_ci_runs_the_test_command_of_the_readme():
    command = re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL)[1].strip()
    assert command in (ROOT / ".ci" / "run").read_text()


def test_the_layers_in_contributing_are_those_that_are_enforced():
    import tomllib

    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    enforced = " > ".join(contracts[0]["layers"]).replace(" | version", "")
    drawn = re.search(r"```text\n(cli >.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), flags=re.DOTALL)
    assert " ".join(drawn[1].split()) == enforced


def test_a_second_script_finds_the_leaderboard_of_the_readme():
    rows = readme_audit.leaderboard(ROOT / "leaderboard")
    assert len(rows) > 10 and "\n".join(["|---|---|---|---|---|---|---|", *rows, "\n"]) in README


def test_the_changelog_tells_the_findings_of_the_readme():
    rows = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").split("| finding (water, oil1, oil2) | 1.0 | 2.0 |")[1]
    told = [row.split("|")[3].strip() for row in rows.split("\n\n")[0].splitlines()[2:]]
    findings = README[README.index("| finding | case | value | tables") :].split("\n\n")[0]
    known = re.findall(r"\| ([-+]?[\d.]+) ± ", findings)
    # rows of the findings
    places = [3, 4, 5], [6, 7, 8], [16], [17], [19], [-3, -2, -1], [29], [35, 36, 37], [20, 21, 22]
    assert [re.findall(r"[-+]?[\d.]+", cell) for cell in told[:-1]] == [[known[k] for k in of] for of in places]
    counts = re.search(r"(\d+) are reproduced .* (\d+) in part .* and (\d+) not", " ".join(README.split()))
    assert told[-1] == ", ".join(counts.groups())


def test_the_second_scripts_import_nothing_of_snakebench():
    for script in (readme_audit, comparison_audit):
        nodes = ast.walk(ast.parse(Path(script.__file__).read_text(encoding="utf-8")))
        imports = [ast.unparse(node) for node in nodes if isinstance(node, ast.Import | ast.ImportFrom)]
        assert len(imports) > 5 and [line for line in imports if "snakebench" in line] == []


def test_what_parts_are_worth_are_differences_of_scores():
    entries = read_leaderboard(ROOT / "leaderboard")
    table, scores = worth_table(entries), {entry.card.name: entry.score for entry in entries}
    assert len(table.rows) == 10
    for _, pair, *cells in table.rows:
        one, other = pair.split(" − ")
        found = [value_in(scores[one], task) - value_in(scores[other], task) for task in TASKS[1:]]
        assert cells == [f"{difference:+.3f}" for difference in found]
    assert "\n".join(f"| {' | '.join(row)} |" for row in table.rows) in (ROOT / "docs" / "baselines.md").read_text()


def test_baselines_are_as_their_cards_and_scores_say():
    page = (ROOT / "docs" / "baselines.md").read_text(encoding="utf-8")
    table = page.split("| entry | each seed |")[1].split("\n\n")[0]
    told = [[cell.strip() for cell in row.split("|")[1:-1]] for row in table.splitlines()[2:]]
    known = {entry.card.name: entry for entry in read_leaderboard(ROOT / "leaderboard")}
    assert len(told) >= 10
    for name, seeds, mean, n, first, steps, hours in told:
        card, score = known[name].card, known[name].score
        assert (first, hours) == (f"{score.total:.3f}", f"{card.hours:g}")
        assert steps == (f"{card.training_steps:,}".replace(",", " ") if card.training_steps else "–")
        totals = [float(total) for total in seeds.split(", ")] if seeds != "–" else []
        assert len(totals) == (int(n) if totals else 0)
        if totals:
            told_mean, _, deviation = mean.partition(" ± ")
            assert float(told_mean) == pytest.approx(np.mean(totals), abs=0.001)
            assert not deviation or float(deviation) == pytest.approx(np.std(totals, ddof=1), abs=0.001)


def test_a_second_script_finds_the_findings_of_the_readme():
    table = README[README.index("| finding | case | value | tables") :].split("\n\n")[0]
    told = [row.split("|")[3].strip() for row in table.splitlines()[2:]]
    assert readme_audit.findings(ROOT / "results") == told
    named = {name for row in table.splitlines()[2:] for name in re.findall(r"\w+/\w+", row.split("|")[4])}
    assert len(named) >= 10 and all(table_file(ROOT / "results" / f"{name}.csv").exists() for name in named)
    text = " ".join(README.split())
    assert [sentence for sentence in readme_audit.sentences(ROOT / "results") if sentence not in text] == []


SHOWN = [("pybullet", 480), ("pybullet", 960), ("planar", 90), ("planar", 240)]


def between(texts: Iterable[str]) -> str:
    """A range, or its ends where they are the same."""
    return " to ".join(dict.fromkeys(texts))


def accuracy_rows() -> list[str]:
    """The table of accuracy in the docs, from the committed validation study."""
    results = ROOT / "results" / "validation"
    runs, costs = read_table(results / "runs.csv"), read_table(results / "costs.csv")
    reference = runs[(runs["engine"] == "planar") & (runs["physics_rate"] == 1920)].set_index(["gait", "fluid"])
    rows = []
    for engine, rate in SHOWN:
        part = runs[(runs["engine"] == engine) & (runs["physics_rate"] == rate)].set_index(["gait", "fluid"])
        cells = []
        for metric in ("speed", "power", "positive_power"):
            error = (part[metric] / reference[metric].loc[part.index] - 1).abs()
            cells.append(f"{100 * error.median():.2g} % / {100 * error.max():.2g} %")
        cost = costs[(costs["engine"] == engine) & (costs["physics_rate"] == rate)]["seconds_per_second"]
        speeds = between(f"{1 / seconds:.0f}" for seconds in sorted(cost, reverse=True))
        name = {"pybullet": "PyBullet", "planar": "planar"}[engine]
        rows.append(f"| {name}, {rate} Hz | {' | '.join(cells)} | {speeds} |")
    return rows


@pytest.mark.parametrize("row", range(len(SHOWN)))
def test_the_accuracy_in_the_docs_is_that_of_the_committed_study(row):
    assert accuracy_rows()[row] in PHYSICS


def test_the_accuracy_in_the_readme_is_that_of_the_docs():
    _, _, v, p, _, seconds, _ = (cell.strip() for cell in accuracy_rows()[SHOWN.index(("pybullet", 960))].split("|"))
    text = " ".join(README.split())
    assert f"an error of {v} in v (median / largest) and {p} in P, and simulates {seconds} seconds" in text


def test_the_committed_engines_agree_in_the_limit_of_small_steps():
    runs = read_table(ROOT / "results" / "validation" / "runs.csv").set_index(["gait", "fluid"])
    bullet, planar = (runs[runs["engine"] == engine] for engine in ("pybullet", "planar"))
    coarse, fine, limit = (
        table[table["physics_rate"] == rate] for table, rate in ((bullet, 960), (bullet, 1920), (planar, 1920))
    )
    assert len(limit) == 36
    for metric in ("speed", "power", "positive_power"):
        gap = ((4 * fine[metric] - coarse[metric]) / 3 / limit[metric] - 1).abs()
        assert gap.max() < 5e-5
        shown = f"{100 * gap.max():.2g} %"
        assert shown in README and shown in PHYSICS


@pytest.mark.parametrize("study", STUDIES)
def test_the_committed_results_are_of_the_studys_own_profile(study):
    committed = read_manifest(ROOT / "results" / study)["config"]
    own = study_settings(study_path(study))
    assert study_config(committed | {"question": own["question"]}) == study_config(own)  # it may be worded anew


def sea_snake_rows() -> list[str]:
    """The table of single sea snakes in the docs: of each fluid the best of all searches."""
    optima = read_table(ROOT / "results" / "sea_snake" / "optima.csv")
    rows = []
    for fluid in ("water", "oil1", "oil2"):
        own = optima[(optima["objective"] == fluid) & (optima["fluid"] == fluid)]
        coarse, fine = (own[own["variant"] == name].set_index("seed") for name in ("searched", "finer step"))
        seed = coarse["return"].idxmax()
        gait, change = fine.loc[seed], (fine.loc[seed, MEASURED] - coarse.loc[seed, MEASURED]).abs()
        bound = ", at its bound" if gait["amplitude"] > 0.99 * np.pi / 3 else ""
        figures = [f"{gait[name]:#.3g} (Δ {change[name]:.1g})" for name in MEASURED]
        cells = [f"{gait['amplitude']:.2f}{bound}", f"{gait['frequency']:.2f}", f"{gait['phase']:.2f}", *figures]
        rows.append(f"| {fluid} | {' | '.join([*cells, format(gait['cost_of_transport'], '.3f')])} |")
    return rows


def test_the_sea_snakes_in_the_docs_are_those_of_the_committed_study():
    assert [row for row in sea_snake_rows() if row not in FOUND] == []


METHODS = {
    "sea_snake": "sea snake",
    "paper": "sinusoid",
    "extended": "wider sinusoid",
    "fourier": "free waveform",
    "student": "preference-conditioned student",
}


def front_rows(study: str, currency: str) -> list[str]:
    """A study's part of the table of fronts in the docs: means over the seeds, if it has several.

    A dash is at powers that not every seed reaches.
    """
    power = f"fastest_{CURRENCIES[currency]}"
    table = published(ROOT / "results" / study).tables["indicators"]
    table["space"] = table["space"].str.replace(r" \d+$", "", regex=True)
    chosen = table[table["space"].isin(METHODS) & (table["currency"] == currency)]
    rows = []
    for (space, front), part in chosen.groupby(["space", "front"], sort=False):
        worth = part.mean(numeric_only=True)
        reached = part[power].min()
        speeds = [f"{worth[f'speed_at_{p}_W']:.3f}" if p <= reached else "–" for p in (1, 3, 5, 10, 20)]
        fastest = f"{worth.fastest_speed:.3f} at {worth[power]:.1f} W"
        rows.append(f"| {' | '.join([METHODS[space], front, *speeds, fastest, f'{worth.hypervolume:.2f}'])} |")
    return rows


def limit_rows(currency: str) -> list[str]:
    """The limit's part of the same table."""
    table = read_table(ROOT / "results" / "limit" / "limit.csv")
    table = table[(table["bounds"] == "policies") & (table["currency"] == currency)]
    rows = []
    for fluid in ("water", "oil1", "oil2"):
        best = table[table["fluid"] == fluid].nlargest(1, "speed").iloc[0]
        speeds = [f"{sb.limit(fluid, power, currency=currency).speed:.3f}" for power in (1, 3, 5, 10, 20)]
        fastest = f"{best['speed']:.3f} at {best[CURRENCIES[currency]]:.1f} W"
        rows.append(f"| {' | '.join(['limit', fluid, *speeds, fastest, '–'])} |")
    return rows


@pytest.mark.parametrize("currency", CURRENCIES)
def test_the_fronts_in_the_docs_are_those_of_the_committed_studies(currency):
    fixed = [row for study in ("sea_snake_front", "pareto", "fourier") for row in front_rows(study, currency)]
    learned = front_rows("learned_front", currency)
    assert (len(fixed), len(learned)) == (20, 5)
    assert "\n".join([*fixed, *limit_rows(currency)]) in FOUND and "\n".join(learned) in FOUND


def policy_rows(study: str) -> list[str]:
    """A study's part of the table of policies in the docs."""
    swims, ranged = (read_table(ROOT / "results" / study / f"{name}.csv") for name in ("evaluations", "range"))
    fine = swims[swims["variant"] == "finer step"]
    returns = ranged.groupby(["policy", "seed"], sort=False)["return"].mean()
    rows = []
    for policy, part in fine.groupby("policy", sort=False):
        means = part.groupby("fluid", sort=False)[["speed", "power"]].mean()
        cells = [f"{row['speed']:z.3f} at {row['power']:.1f}" for row in means.to_dict("records")]
        earned = returns[policy]
        rows.append(f"| {policy.replace('_', ' ')} | {len(earned)} | {' | '.join(cells)} | {earned.mean():.1f} |")
    return rows


def test_the_policies_in_the_docs_are_those_of_the_committed_studies():
    named = [line for line in FOUND.splitlines() if re.match(r"\| [a-z ]+ \| [135] \|", line)]
    ablations = [row for row in policy_rows("ablations") if not row.startswith("| teacher |")]  # the same as before
    assert named == policy_rows("teacher_student") + ablations + policy_rows("memory")


def test_the_fastest_swims_of_imitators_in_the_docs_are_those_of_the_committed_study():
    fronts = read_table(ROOT / "results" / "imitation" / "fronts.csv")
    fastest = fronts.groupby(["method", "front", "seed"])["speed"].max().groupby(["method", "front"]).mean()
    told = " ".join(FOUND.split())
    for method, sentence in (
        ("imitator", "they swim {:.3f}, {:.3f} and {:.3f} m/s in water, oil1 and oil2"),
        ("imitator_positive", "those of P⁺ {:.3f}, {:.3f} and {:.3f}:"),
    ):
        assert sentence.format(*fastest[method][["water", "oil1", "oil2"]]) in told


@pytest.mark.parametrize(
    ("study", "currency", "power", "sentence"),
    [
        ("imitation", "net", 5.0, "reach {} % of the limit's speed at 5 W of P in water, oil1 and oil2, and"),
        ("imitation", "positive", 5.0, "oil1 and oil2, and {} % at 5 W of P⁺;"),
        ("imitation", "positive", 10.0, "at 10 W of P⁺ {} %. At low power they lose more"),
        ("imitation", "net", 1.0, "they reach {} % at 1 W of P, and"),
        ("imitation", "positive", 3.0, "at 1 W of P, and {} % at 3 W of P⁺."),
        ("gain_schedule", "net", 3.0, "{} % at 3 W of P in water, oil1 and oil2,"),
        ("gain_schedule", "net", 5.0, "oil1 and oil2, {} % at 5 W and"),
        ("gain_schedule", "net", 10.0, "at 5 W and {} % at 10 W;"),
        ("gain_schedule", "positive", 3.0, "{} % at 3 W of P⁺, "),
        ("gain_schedule", "positive", 5.0, "at 3 W of P⁺, {} % at 5 W and"),
        ("gain_schedule", "positive", 10.0, "at 5 W and {} % at 10 W of P⁺."),
        ("gain_schedule", "net", 1.0, "At 1 W of P it reaches {} %"),
    ],
)
def test_the_shares_of_the_limit_in_the_docs_are_those_of_the_committed_studies(study, currency, power, sentence):
    shares = [
        f"{readme_audit.imitating(ROOT / 'results', fluid, currency, power, study=study).mean():.0f}"
        for fluid in ("water", "oil1", "oil2")
    ]
    assert sentence.format("{}, {} and {}".format(*shares)) in " ".join(FOUND.split())


def test_the_difference_between_the_engines_is_that_of_the_committed_study():
    swims = read_table(ROOT / "results" / "teacher_student" / "evaluations.csv")
    swims = swims[swims["policy"].isin(["teacher", "student"])]
    fine, coarse, planar = (
        swims[swims["variant"] == variant].set_index(["policy", "seed", "fluid"])["return"]
        for variant in ("finer step", "coarser step", "planar")
    )
    page = " ".join((ROOT / "docs" / "learning.md").read_text().split())
    one, other = (f"{100 * (found / planar - 1).abs().max():.2f} %" for found in (fine, coarse))
    assert f"at most {one} at 960 Hz and {other} at 480 Hz" in page
    sums = [returns.groupby(["policy", "seed"]).sum() for returns in (fine, coarse, planar)]
    one, other = (f"{100 * (found / sums[2] - 1).abs().max():.2f} %" for found in sums[:2])
    assert f"together by {one} and {other}" in page
    returns = fine.groupby("fluid").mean()
    assert f"J is small ({returns['oil2']:.0f}, in water {returns['water']:.0f})" in page
    left = ((4 * fine - coarse) / 3 / planar - 1).abs().max()
    assert f"within {100 * left:.2f} %" in page


def cost_rows() -> list[str]:
    """The table of the cluster's page, from the committed bench and validation study."""
    bench = read_table(ROOT / "results" / "bench" / "bench.csv")
    bench = bench[bench["workload"].isin(["one robot", "evaluator"])]
    costs = read_table(ROOT / "results" / "validation" / "costs.csv")
    costs["simulated"] = 1 / costs["seconds_per_second"]
    rows = []
    for engine, rate, table in (("planar", 90, bench), ("pybullet", 480, bench), ("pybullet", 960, costs)):
        speeds = sorted(table[(table["engine"] == engine) & (table["physics_rate"] == rate)]["simulated"])
        seconds = [30 / speed for speed in reversed(speeds)]
        ms, busy = ([f"{time / unit:.0f}" for time in seconds] for unit in (1e-3, 0.30e-3))
        hours = [f"{hour:.0f}" if hour > 100 else f"{hour:.1f}" for hour in (1e6 * (s + 1e-3) / 3600 for s in seconds)]
        name = {"pybullet": "PyBullet", "planar": "planar"}[engine]
        cells = map(between, ([f"{speed:.0f}" for speed in speeds], ms, hours, busy))
        rows.append(f"| {name}, {rate} Hz | {' | '.join(cells)} |")
    return rows


@pytest.mark.parametrize("row", range(3))
def test_the_costs_of_a_million_are_those_of_the_committed_speeds(row):
    assert cost_rows()[row] in (ROOT / "docs" / "cluster.md").read_text()
