"""Imitation: the limit's gaits as demonstrations, a teacher that follows the robot, and a student that learns."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import snakebench as sb
from snakebench.controllers import HeldTargets
from snakebench.errors import InvalidValue
from snakebench.fluid import named_fluid
from snakebench.gain_schedule import ScheduledGait
from snakebench.learning.demonstrations import Demonstrations, Demonstrator
from snakebench.learning.settings import Imitation, Randomisation, Scheduling
from snakebench.learning.training import distil
from snakebench.learning.vector import SwimVecEnv
from snakebench.reward import PUBLISHED_PRICE, preferred
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.demonstrated import demonstrations, mixed, preference, spanning
from snakebench.studies.running import run_study, study_config
from snakebench.tables import read_table

RESULTS = Path(__file__).parents[2] / "results"
SMALL = {"lengths": (0.28, 0.44, 0.44, 0.32), "masses": (1.0, 1.5, 1.5, 1.2)}  # three joints: solved in a second
WATER = named_fluid("water").kinematic_viscosity
IMITATION = Imitation(
    demonstrations="limit",
    robot=sb.Robot(**SMALL),
    randomisation=Randomisation(prices=(0.05, 3.0), viscosities=(WATER, WATER)),
    members=8,
    lstm=(32,),
    rollout=60,
    iterations=30,
    handover=15,
    checkpoints=2,
)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A small limit, with held targets at two powers."""
    settings = study_settings(study_path("limit"), "smoke") | {"name": "limit", "robot": SMALL, "duration": 10.0}
    settings |= {"powers": [0.5, 2.0], "anchors": [2.0], "shown": 2.0}
    settings |= {"bounds": {"policies": {"target": 1.0}, "held": {"target": 1.0, "held": True}}}
    run_study(study_config(settings), tmp := tmp_path_factory.mktemp("results"), workers=1)
    return tmp


def imitation_config(**changes):
    settings = study_settings(study_path("imitation"), "smoke") | {"name": "imitation", "robot": SMALL}
    policies = {"imitator": {"demonstrations": "limit", "randomisation": {"prices": [0.05, 3.0]}}}
    settings |= {"fluids": ["water"], "currencies": ["net"], "policies": policies, "published": ["imitator"]}
    return study_config(settings | changes)


@pytest.fixture(scope="module")
def gaits(results):
    return demonstrations(imitation_config(), IMITATION, results)


def test_a_preference_is_the_price_at_which_the_gait_is_best_of_its_front():
    powers = np.linspace(2.9, 3.1, 2001)
    speeds = 0.3 * np.cbrt(powers)
    price = preference(0.3 * np.cbrt(3.0), 0.1 * 3.0 ** (-2 / 3))
    rewards = preferred(10 * speeds - PUBLISHED_PRICE * powers, speeds, powers, np.full(2001, price))
    assert powers[rewards.argmax()] == pytest.approx(3.0, abs=2e-3)


def test_demonstrations_are_the_held_gaits_by_viscosity_and_price(gaits, results):
    limit = read_table(results / "limit" / "limit.csv")
    held = limit[limit["bounds"] == "held"].sort_values("allowed")
    own = [preference(row.optimal_speed, row.multiplier) for row in held.itertuples()]
    assert 3.0 > own[0] > own[1] > 0.05
    ends = [3.0, *own, 0.05]  # of the prices asked for
    assert [one.price for one in gaits[:4]] == pytest.approx(ends)
    dear, *_, cheap = gaits[:4]
    assert np.abs(cheap.targets).mean() > np.abs(dear.targets).mean()
    between = [np.linspace(*np.log(pair), 5)[1:-1] for pair in pairwise(ends)]
    assert np.log([one.price for one in gaits[4:]]) == pytest.approx(np.concatenate(between))
    for one in gaits:
        half = len(one.targets) // 2
        np.testing.assert_allclose(np.array(one.targets[half:]), -np.array(one.targets[:half]), atol=1e-6)


def test_a_schedule_plays_the_gaits_of_the_limit_only(results, gaits):
    asked = IMITATION.model_dump(include={"demonstrations", "robot", "randomisation"}, exclude_unset=True)
    schedule = Scheduling(estimator=1, **asked)
    assert demonstrations(imitation_config(), schedule, results) == gaits[:4]


@pytest.mark.parametrize(
    ("own", "expected"),
    [
        ([2.0, 1.0], [(4.0, 0), (2.0, 0), (1.0, 1), (0.1, 1)]),
        ([8.0, 1.0], [(8.0, 0), (1.0, 1), (0.1, 1)]),
        ([1.0, 0.05, 0.01], [(4.0, 0), (1.0, 0), (0.1, 1)]),  # for the lowest price, not for less
        ([0.01], [(4.0, 0), (0.1, 0)]),
    ],
)
def test_gaits_span_the_prices_that_are_asked_for(own, expected):
    gaits = [ScheduledGait(viscosity=1e-6, price=price, targets=[[k], [-k]]) for k, price in enumerate(own)]
    assert [(one.price, one.targets[0][0]) for one in spanning(gaits, 0.1, 4.0)] == expected


def test_a_mixture_of_a_gait_with_itself_a_little_later_is_the_gait(gaits):
    late = gaits[0].but(targets=np.roll(gaits[0].targets, 5, axis=0).tolist(), price=4 * gaits[0].price)
    mixture = mixed(gaits[0], late, 0.5)
    np.testing.assert_allclose(mixture.targets, gaits[0].targets, atol=2e-6)
    assert mixture.price == pytest.approx(2 * gaits[0].price)


@pytest.mark.parametrize(("fluid", "least"), [("water", 0.98), ("oil1", 0.75), ("oil2", 0.88)])
def test_mixtures_are_nearly_as_fast_as_the_limit_at_their_power(fluid, least):
    """Of published gaits; targets of the limit at that power are held too. In oil1 near 2 W, kinds of gaits differ."""
    viscosity, shares = named_fluid(fluid).kinematic_viscosity, []
    limit = read_table(RESULTS / "limit" / "limit.csv")
    known = limit[(limit["fluid"] == fluid) & (limit["bounds"] == "held") & (limit["currency"] == "net")]["power"]
    alone = Imitation(
        demonstrations="limit", randomisation=Randomisation(prices=(0.005, 5.0), viscosities=(viscosity, viscosity))
    )
    config = study_config(study_settings(study_path("imitation")))
    for one in demonstrations(config, alone, RESULTS):
        held = HeldTargets(rate=30, targets=np.resize(one.targets, (900, 7)).tolist())
        swim = sb.evaluate(held, fluid, engine="planar")
        if max(0.6, known.min()) < swim.power < min(19.0, known.max()):
            shares.append(swim.speed / sb.limit(fluid, swim.power, bounds="held").speed)
    assert len(shares) >= 20 and np.median(shares) >= 0.93 and min(shares) >= least


def test_robots_that_do_as_they_are_shown_swim_as_by_the_clock(gaits):
    environment = SwimVecEnv(len(gaits), IMITATION)
    teacher = Demonstrator(gaits, IMITATION, len(gaits))
    environment.seed(0)
    environment.reset()
    environment._age[:], environment._price[:] = 0, [one.price for one in gaits]
    observation = environment.observe()
    for _ in range(900):
        labels = teacher.labels(np.hstack(list(observation.values())), environment.starts)
        observation, _, done, infos = environment.step(labels)
    assert done.all()
    for info, one in zip(infos, gaits, strict=True):
        by_the_clock = HeldTargets(rate=30, targets=np.resize(one.targets, (900, 3)).tolist())
        swim = sb.simulate(by_the_clock, "water", engine="planar", robot=IMITATION.robot, duration=30.0)
        assert info["episode"]["speed"] == pytest.approx((swim.center[-1, 0] - swim.center[0, 0]) / 30, rel=0.01)


def test_the_phase_follows_a_robot_that_is_early(gaits):
    teacher = Demonstrator(gaits, IMITATION, 1)
    one, length = gaits[0], len(gaits[0].targets)
    environment = SwimVecEnv(1, IMITATION)
    environment.reset()
    environment._price[:] = one.price
    early, observation = 3, environment.observe()
    whole = np.hstack(list(observation.values()))
    joints = IMITATION.robot.n_joints
    for step in range(120):
        k = step + (early if step >= 60 else 0)
        whole[0, :joints] = teacher._angles[0, k % length]
        whole[0, teacher._last] = one.targets[(k - 1) % length]
        label = teacher.labels(whole, np.array([step == 0]))
    np.testing.assert_allclose(label[0], one.targets[k % length], atol=1e-6)


def test_a_robot_that_swims_as_a_neighbour_of_its_gait_is_shown_the_neighbour(gaits):
    one, other = gaits[1:3]
    teacher = Demonstrator(Demonstrations([one, other]), IMITATION, 1)
    environment = SwimVecEnv(1, IMITATION)
    environment.reset()
    environment._price[:] = one.price
    whole = np.hstack(list(environment.observe().values()))
    joints, length = IMITATION.robot.n_joints, len(other.targets)
    labels = []
    for k in range(300):
        whole[0, :joints] = teacher._angles[1, k % length]
        whole[0, teacher._last] = other.targets[(k - 1) % length]
        labels.append(teacher.labels(whole, np.array([k == 0]))[0])
    np.testing.assert_allclose(labels[0], one.targets[0], atol=1e-6)
    np.testing.assert_allclose(labels[-1], other.targets[299 % length], atol=1e-6)


@pytest.mark.slow
def test_a_student_swims_as_it_was_shown(gaits, results, tmp_path):
    policy = distil(IMITATION, gaits, 0, tmp_path / "student")
    fastest = read_table(results / "limit" / "limit.csv")["speed"].max()
    swim = sb.evaluate(policy, "water", robot=IMITATION.robot, engine="planar")
    assert 0.75 * fastest < swim.speed < 1.05 * fastest
    assert policy.card.prices == (0.05, 3.0)


def test_the_study_trains_and_evaluates_imitators(results):
    directory = run_study(imitation_config(), results, workers=1)
    assert set(read_table(directory / "dial.csv")["policy"]) == {"imitator"}
    assert (directory / "policies" / "imitator-0.safetensors").exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"demonstrations": "nowhere"}, "no results in .*nowhere"),
        ({"currency": "positive"}, r"limit has no gaits of held targets at P\+$"),
    ],
)
def test_missing_demonstrations_are_refused_in_a_line(results, changes, message):
    with pytest.raises(InvalidValue, match=message):
        demonstrations(imitation_config(), IMITATION.but(**changes), results)


def test_gaits_of_another_robot_are_refused(results):
    with pytest.raises(InvalidValue, match="of another robot"):
        demonstrations(imitation_config(robot={}), IMITATION, results)


def test_demonstrations_have_a_digest_of_their_targets(gaits):
    moved = gaits[0].but(targets=(np.array(gaits[0].targets) + 0.01).tolist())
    other = Demonstrations([moved, *gaits[1:]])
    assert other.digest() != gaits.digest() == Demonstrations(gaits).digest()
