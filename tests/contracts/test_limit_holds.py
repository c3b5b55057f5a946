"""No published gait or policy is faster than the limit of the body at equal power."""

import re
from pathlib import Path

import pytest

from snakebench.collocation.front import under_first_bounds
from snakebench.collocation.search import CONVERGED
from snakebench.report.table import POWERS
from snakebench.store import CURRENCIES
from snakebench.studies.limit.rivals import rivals, shares, shares_at
from snakebench.studies.published import published

RESULTS = Path(__file__).parents[2] / "results"
ABOVE = 1.01  # share of the limit that its own error may explain
SERVED = ["sea snake", "free waveform", "student"]  # whose targets are within ±1 rad, the limit's first bounds


@pytest.fixture(scope="module")
def points():
    """The limit's points in the named fluids under the first bounds, and what is compared with them."""
    study = published(RESULTS / "limit")
    return under_first_bounds(study.tables["limit"], study.config), rivals(study)


@pytest.fixture(scope="module")
def compared(points):
    return points[0], shares(*points)


@pytest.mark.parametrize("currency", CURRENCIES)
def test_no_published_controller_of_target_angles_is_above_the_limit(compared, currency):
    _, reached = compared
    rows = reached[(reached["currency"] == currency) & reached["method"].isin(SERVED)]
    assert set(rows["method"]) == set(SERVED)
    assert set(rows["fluid"]) == {"water", "oil1", "oil2"}
    above = rows[rows["share"] > ABOVE]
    assert above.empty, above[["method", "fluid", "speed", *POWERS, "share"]].to_string()


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
    rows = re.search(
        r"\*limit of the body\*, at 5 W \| water \| (\d+) % \|\n\| \| oil1 \| (\d+) %.*\n\| \| oil2 \| (\d+) %", text
    )
    means = reached.groupby("fluid")["share"].mean()
    assert [int(share) for share in rows.groups()] == [round(100 * means[name]) for name in ("water", "oil1", "oil2")]
