"""No published gait or policy is faster than the limit of the body at equal power."""

import re
from pathlib import Path

import pandas as pd
import pytest

from snakebench.collocation.front import under_first_bounds
from snakebench.collocation.search import CONVERGED
from snakebench.report.table import POWERS
from snakebench.store import CURRENCIES
from snakebench.studies.limit.rivals import rivals, shares, shares_at
from snakebench.studies.published import published
from snakebench.tables import read_table

RESULTS = Path(__file__).parents[2] / "results"
ABOVE = 1.01  # share of the limit that its own error may explain
FURTHER = {  # of studies that are not beside the limit on its page
    "robust/evaluations": "variant == 'finer step'",
    "operating_point/points": "variant == 'finer step' and as_trained and diameter == 0.1",
    "adaptation/steady": "fluid in ['water', 'oil1', 'oil2']",
}


@pytest.fixture(scope="module")
def points():
    """The limit's points in the named fluids under the first bounds, and what is compared with them."""
    study = published(RESULTS / "limit")
    return under_first_bounds(study.tables["limit"], study.config), rivals(study)


@pytest.fixture(scope="module")
def compared(points):
    limit, others = points
    tables = [read_table(RESULTS / f"{name}.csv").query(rows) for name, rows in FURTHER.items()]
    further = [table.rename(columns={"policy": "method"}).query("status == 'ok'") for table in tables]
    swims = pd.concat(
        [table[["method", "fluid", "seed", "speed", *POWERS]].assign(is_front=False) for table in further]
    )
    return limit, shares(limit, pd.concat([others, swims], ignore_index=True))


@pytest.mark.parametrize("currency", CURRENCIES)
def test_no_published_gait_or_policy_is_above_the_limit(compared, currency):
    _, reached = compared
    rows = reached[reached["currency"] == currency]
    kinds = {"sinusoid", "wider sinusoid", "sea snake", "free waveform", "teacher", "student", "symmetric"}
    assert kinds | {"imitator", "imitator_positive", "robust_student"} <= set(rows["method"])
    assert set(rows["fluid"]) == {"water", "oil1", "oil2"}
    above = rows[rows["share"] > ABOVE]
    assert above.empty, above[["method", "fluid", "speed", *POWERS, "share"]].to_string()


@pytest.mark.parametrize("bounds", ["policies", "wide"])
def test_at_nearly_every_point_two_starts_agree(bounds):
    points = published(RESULTS / "limit").tables["limit"].query("bounds == @bounds")
    assert (points["agreeing"] >= 2).mean() >= 0.95


def test_no_single_start_decides_a_point(compared):
    usual, _ = compared
    assert (usual["starts"] >= 2).all()


def test_more_power_is_never_slower(compared):
    usual, _ = compared
    for _, front in usual.groupby(["fluid", "currency"]):
        speeds = front.sort_values("allowed")["optimal_speed"]
        assert (speeds.diff().dropna() > -CONVERGED * speeds.max()).all()  # their meshes differ


def test_the_readme_has_the_students_share_of_the_limit(points):
    reached = shares_at(*points).query("method == 'student' and currency == 'net' and allowed == 5")
    text = (RESULTS.parent / "README.md").read_text(encoding="utf-8")
    mean = r"([\d.]+) ± .*\n"
    rows = re.search(rf"\*limit of the body\*, at 5 W \| water \| {mean}\| \| oil1 \| {mean}\| \| oil2 \| {mean}", text)
    means = reached.groupby("fluid")["share"].mean()
    assert list(rows.groups()) == [f"{100 * means[name]:.1f}" for name in ("water", "oil1", "oil2")]
