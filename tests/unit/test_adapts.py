"""The rule of the claim that one network adapts: a policy can pass it, and a fixed gait in its place cannot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from snakebench.comparison.claims import CLAIMS
from snakebench.comparison.judges import JUDGES
from snakebench.comparison.results import Missing, Results
from snakebench.studies.adaptation.columns import TABLES
from snakebench.studies.published import Published
from snakebench.tables import checked

RULE = CLAIMS["adapts"]
SEEDS = 5
BACK = RULE["seconds"] - 1.0  # [s]
SINGLE = [("fourier", 4.0, 20.0), ("fourier", 10.0, 30.0), ("extended", 8.0, 22.0)]  # method, P [W], distance [m]


class Made(Results):
    """Results of the adaptation study that are made up."""

    def __init__(self, **tables):
        super().__init__(Path())
        known = {name: tables.get(name, pd.DataFrame(columns=list(columns))) for name, columns in TABLES.items()}
        self._made = {name: checked(table, TABLES[name], name) for name, table in known.items()}

    def study(self, name):
        return Published(Path(name), {}, self._made)


def swim(method, power, distance, limit=40.0, **labels):
    row = {"course": "step", "method": method, "tuned_to": "integrated", "seed": 0, "variant": "finer step"}
    swum = {"status": "ok", "power": power, "positive_power": power, "distance": distance}
    return row | {"engine": "pybullet", "physics_rate": 960} | swum | {"ideal_net": limit} | labels


def judged(student, seconds=BACK, limit=40.0):
    """What holds of a student with a power and a distance of each seed, which is back after so many seconds."""
    own = {"tuned_to": "adaptive", "limit": limit}
    swims = [swim("student", *values, seed=k, **own) for k, values in enumerate(student)]
    swims += [swim(*values, gait=k) for k, values in enumerate(SINGLE)]
    change = {"time": 20.0, "from": "water", "to": "oil2", "steady_speed": 0.1, "held": 1.0, "loss": 0.0}
    names = ("course", "method", "tuned_to", "seed", "gait")
    recoveries = [{name: row.get(name) for name in names} | change | {"seconds": seconds} for row in swims]
    results = Made(courses=pd.DataFrame(swims), recoveries=pd.DataFrame(recoveries))
    return JUDGES["adapts"](results, RULE), results


def near(power, distance):
    """Seeds that differ a little."""
    return [(power, distance * (1 + 0.001 * k)) for k in range(SEEDS)]


def test_a_policy_that_recovers_gains_and_comes_near_the_limit_passes():
    found, _ = judged(near(7.0, 33.0))
    assert all(found.holds)


@pytest.mark.parametrize("gait", SINGLE, ids=lambda gait: f"{gait[0]} at {gait[1]:g} W")
def test_a_fixed_gait_in_the_place_of_the_policy_fails_however_fast_it_recovers(gait):
    found, _ = judged([gait[1:]] * SEEDS, seconds=0.1, limit=gait[2])
    assert not all(found.holds)


def test_a_policy_that_is_as_good_as_a_mixture_of_single_gaits_fails():
    found, _ = judged(near(7.0, 25.0), limit=25.0)
    assert not all(found.holds)


def test_a_gain_that_the_seeds_do_not_agree_on_is_none():
    found, _ = judged([(7.0, distance) for distance in (20.0, 25.0, 26.0, 27.0, 34.0)], limit=20.0)
    assert not all(found.holds)


@pytest.mark.parametrize("seconds", [RULE["seconds"] + 0.1, np.nan])
def test_a_policy_that_is_late_or_never_back_fails(seconds):
    assert not all(judged(near(7.0, 33.0), seconds=seconds)[0].holds)


@pytest.mark.parametrize("limit", [33.0 / (RULE["share"] / 100) * 1.01, np.nan])
def test_a_policy_far_from_the_limit_or_without_one_fails(limit):
    assert not all(judged(near(7.0, 33.0), limit=limit)[0].holds)


def test_the_gain_is_over_the_line_between_the_single_gaits_around_the_power():
    _, results = judged(near(7.0, 33.0))
    gain = next(one for one in results.measurements if one.id == "student/gain/P")
    assert gain.values[0] == pytest.approx(100 * (33.0 / 25.0 - 1)) and gain.n == SEEDS


def test_without_the_student_the_command_is_named():
    with pytest.raises(Missing, match="snakebench run-study adaptation"):
        JUDGES["adapts"](Made(courses=pd.DataFrame([swim(*SINGLE[0])])), RULE)
