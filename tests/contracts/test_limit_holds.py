"""No published gait or policy is faster than the limit of the body at equal power."""

import re
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import snakebench as sb
from snakebench.collocation.front import front_speeds, gait_at, of_held_targets, under_first_bounds
from snakebench.collocation.search import CONVERGED
from snakebench.errors import InvalidValue
from snakebench.fluid import density_at
from snakebench.names import CURRENCIES
from snakebench.report.table import POWERS
from snakebench.studies.limit_shares import rivals, shares, shares_at
from snakebench.studies.published import published
from snakebench.tables import read_table

RESULTS = Path(__file__).parents[2] / "results"
ABOVE = 1.01  # share of the limit that its own error may explain
FURTHER = {  # of studies that are not beside the limit on its page
    "robust/evaluations": "variant == 'finer step'",
    "ablations/evaluations": "variant == 'finer step'",
    "operating_point/points": "variant == 'finer step' and as_trained and diameter == 0.1",
    "cross/matrix": "variant == 'finer step' and loop == 'closed'",
    "relearned/evaluations": "variant == 'finer step' and policy not in ['teacher_slim', 'student_slim']",
    "adaptation/steady": "fluid in ['water', 'oil1', 'oil2']",
    "sensitivity/swims": "engine == 'pybullet' and physics_rate == 960 and robot == 'default'",
    "robustness/targets": "target == 'unperturbed'",
    "memory/evaluations": "variant == 'finer step'",
    "tuning/evaluations": "variant == 'finer step'",
    "learned_front/dial": "variant == 'finer step'",
    "imitation/dial": "variant == 'finer step'",
    "gain_schedule/dial": "variant == 'finer step'",
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


@pytest.mark.parametrize("currency", CURRENCIES)
def test_no_policy_is_above_the_limit_of_held_targets(currency):
    study = published(RESULTS / "limit")
    held = of_held_targets(study.tables["limit"], study.config)
    dials = [read_table(RESULTS / name / "dial.csv") for name in ("learned_front", "imitation", "gain_schedule")]
    swims = pd.concat(dials).query("variant == 'finer step' and status == 'ok'")
    for fluid, front in held[(held["currency"] == currency) & held["fluid"].notna()].groupby("fluid"):
        own = swims[(swims["fluid"] == fluid) & (swims[CURRENCIES[currency]] > 0)]
        share = own["speed"] / front_speeds(front, own[CURRENCIES[currency]].to_numpy(float), currency)
        assert share.notna().sum() > 100 and share.max() <= ABOVE


@pytest.mark.parametrize("currency", CURRENCIES)
def test_nothing_is_above_the_limit_at_other_viscosities(currency):
    steady = read_table(RESULTS / "adaptation" / "steady.csv").query("fluid.isna() and status == 'ok'")
    swims = steady[steady["method"].str.match("student|fourier|sea_snake|limit")].query("viscosity >= 1e-7")
    compared = 0
    for row in swims.to_dict("records"):
        fluid = sb.Fluid(kinematic_viscosity=row["viscosity"], density=density_at(row["viscosity"]))
        with suppress(InvalidValue):  # the limit is not known at so little or so much power
            best = sb.limit(fluid, row[CURRENCIES[currency]], currency=currency)
            assert row["speed"] <= ABOVE * best.speed + best.error
            compared += 1
    assert compared > 50


@pytest.mark.parametrize("bounds", [["policies"], ["policies", "wide", "slow"]])
def test_at_nearly_every_point_two_starts_agree(bounds):
    points = published(RESULTS / "limit").tables["limit"].query("bounds in @bounds")
    assert (points["agreeing"] >= 2).mean() >= 0.95


@pytest.mark.parametrize(
    ("narrower", "wider", "most"),
    [("slow", "policies", 1.002), ("policies", "wide", 1.002), ("held", "policies", 1.01)],
)
def test_wider_bounds_are_never_slower_by_more_than_their_errors(narrower, wider, most):
    points = published(RESULTS / "limit").tables["limit"].set_index(["viscosity", "currency", "allowed"])
    points["simulated"] = points.eval("optimal_speed * (1 + gap)")  # optima differ in smoothing
    points["error"] = points[["change", "gap", "planar_gap"]].abs().max(axis=1)
    one, other = (points[points["bounds"] == bounds] for bounds in (narrower, wider))
    ratio = (one["simulated"] / other["simulated"] - other["error"]).dropna()
    assert len(ratio) >= 30 and ratio.max() <= most, ratio.nlargest(5)


def test_no_single_start_decides_a_point(compared):
    usual, _ = compared
    assert (usual["starts"] >= 2).all()


def test_more_power_is_never_slower(compared):
    usual, _ = compared
    for _, front in usual.groupby(["fluid", "currency"]):
        speeds = front.sort_values("allowed")["optimal_speed"]
        assert (speeds.diff().dropna() > -CONVERGED * speeds.max()).all()  # their meshes and smoothing differ


def test_three_harmonics_are_too_few_at_low_positive_power():
    study = published(RESULTS / "limit")
    limit = study.tables["limit"].query("fluid == 'water' and bounds == 'policies' and currency == 'positive'")
    row = limit[limit["allowed"] == 1.0].iloc[0]
    gait = gait_at(study.tables["gaits"], row)
    told = " ".join((RESULTS.parent / "docs" / "limit.md").read_text(encoding="utf-8").split())
    three, nine = (sb.evaluate(cut(gait, n), "water", engine="planar", physics_rate=240) for n in (3, 9))
    assert f"is {100 * (1 - three.speed / row['speed']):.0f} % slower and needs {three.positive_power:.1f} W" in told
    assert f"with nine it needs {nine.positive_power:.1f} W" in told


def cut(gait, harmonics):
    """A gait of periodic targets without its higher harmonics."""
    parts = np.fft.rfft(np.array(gait.targets), axis=0)
    parts[harmonics + 1 :] = 0
    return gait.but(targets=tuple(map(tuple, np.fft.irfft(parts, len(gait.targets), axis=0).tolist())))


def test_the_readme_has_the_students_share_of_the_limit(points):
    reached = shares_at(*points).query("method == 'student' and currency == 'net' and allowed == 5")
    text = (RESULTS.parent / "README.md").read_text(encoding="utf-8")
    mean = r"([\d.]+) ± .*\n"
    rows = re.search(
        rf"\*limit of the body\*, at 5 W \| water \| {mean}\|  \| oil1 \| {mean}\|  \| oil2 \| {mean}", text
    )
    means = reached.groupby("fluid")["share"].mean()
    assert list(rows.groups()) == [f"{100 * means[name]:.1f}" for name in ("water", "oil1", "oil2")]
