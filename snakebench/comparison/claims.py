"""The paper's claims beside ours: what it says, what we measure, and a verdict by a stated rule.

A verdict never rests on digits alone: the paper's simulator and the robot's diameter in it are not known. Each rule
says what must hold, and asks it of the 95 % interval over the seeds where there are several. Rules are of P and CoT,
the paper's currency, in which braking is refunded; P+ and CoT+ are told beside.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from snakebench.comparison.measured import (
    SHORT,
    costs_in_fluids,
    farthest_pairs,
    gain,
    gain_with_dial,
    mean_return,
    power_over_switching,
    recovery,
    replayed,
    share_of_switching,
    short_learners,
    switched,
    times_the_sea_snakes,
)
from snakebench.comparison.quantities import Measurement, Missing, Results, combined, damage_as_missing, known, policy
from snakebench.comparison.verdicts import (
    Claim,
    above,
    below,
    counts,
    each_mean,
    ordered,
    path,
    plus,
    verdict,
)
from snakebench.report import paper
from snakebench.report.method_names import METHOD_NAMES
from snakebench.store import EXTENDED, PAPER
from snakebench.studies.published_fronts import OVERALL

DIALLED = 5.0  # power at which the policy with a dial is compared, within all fronts of the paper's range [W]
_COSTS = ("cost_of_transport", "positive_cost_of_transport")
_SPEEDS = (0.1, 0.15, 0.2, 0.24)  # at which costs of transport are compared over all fluids [m/s]
_ALIKE = 0.8  # share of the teacher's return that would be "an effective gait as well"
_SOON = 3.0  # in which a policy must be back at its speed [s]
_SHARE = 90.0  # of ideal switching that it must reach [%]
_NEARLY = 0.97  # share of the teacher's return that a student must keep to imitate it accurately


def claims(results: Results) -> tuple[list[Claim], list[str]]:
    """All claims for which there are results, and what is missing for the others, a line each."""
    found, missing = list[Claim](), list[str]()
    for judge in _JUDGES:
        try:
            with damage_as_missing("claims"):
                found += list(judge(results))
        except Missing as error:
            missing.append(str(error))
    return found, list(dict.fromkeys(missing))


def _faster_than_fronts(results: Results) -> Iterator[Claim]:
    gains = {fluid: gain(results, fluid) for fluid in results.fluids}
    wider = {fluid: gain(results, fluid, EXTENDED) for fluid in results.fluids}
    dial = {fluid: gain_with_dial(results, fluid, DIALLED) for fluid in results.fluids}
    yield Claim(
        "The policy beats the front of fixed sinusoids of each fluid",
        "yes, in all three",
        f"at its own power {each_mean(gains, '{:+.0f} %')};"
        f" with a dial at {DIALLED:g} W {each_mean(dial, '{:+.0f} %')}",
        counts(gains.values()),
        verdict([above(one, 0) for one in (*gains.values(), *dial.values())]),
        "It must be faster than every sinusoid that needs no more power, by the whole interval, in every fluid and both"
        f" ways. Against sinusoids of a wider range, at its own power: {each_mean(wider, '{:+.0f} %')}.",
        "pareto",
    )
    for place, said in zip(OVERALL, ("one fixed sinusoid for all fluids", "ideal switching"), strict=True):
        own, other = gain(results, place), gain(results, place, EXTENDED)
        yield Claim(
            f"It beats the {place} front: {said}",
            "yes",
            f"at its own power {plus(own)}",
            str(own.n),
            verdict([above(own, 0)]),
            f"Faster in the mean over the fluids than what needs no more power; against the wider range {plus(other)}.",
            "pareto",
        )


def _cheaper_than_switching(results: Results) -> Iterator[Claim]:
    fastest_of_all = results.rows("pareto", "switching", space=PAPER)["speed"].max()
    speeds = [speed for speed in _SPEEDS if speed <= fastest_of_all]
    ratios = {f"{speed:g} m/s": power_over_switching(results, speed, "power") for speed in speeds}
    paid = [known(partial(power_over_switching, results, speed, "positive_power")) for speed in speeds]
    positive = {where: one for where, one in zip(ratios, paid, strict=True) if one}
    costs, positive_costs = (costs_in_fluids(results, column) for column in _COSTS)
    yield Claim(
        "It has a lower cost of transport than ideal switching",
        "yes",
        f"with a dial, power for the same mean speed {each_mean(ratios, '{:+.0f} %')}"
        + (f"; P+ of the same {each_mean(positive, '{:+.0f} %')}" if positive else ""),
        counts(ratios.values()),
        verdict([below(one, 0) for one in ratios.values()]),
        "Cheaper at each of these speeds by the whole interval. The policy of the paper's reward swims faster than any"
        f" such sinusoid, at a cost of transport of {', '.join(f'{cost.mean:.2f}' for cost in costs)}"
        f" (CoT+ {', '.join(f'{cost.mean:.2f}' for cost in positive_costs)}).",
        "learned_front",
    )


def _sea_snake(results: Results) -> Iterator[Claim]:
    speeds, costs, positive_costs = (
        {fluid: times_the_sea_snakes(results, column, fluid) for fluid in results.fluids}
        for column in ("speed", *_COSTS)
    )
    yield Claim(
        "The sea snake, tuned to the same reward, gives up speed for efficiency; the policy is faster",
        "yes, in all three",
        f"speed {each_mean(speeds, '× {:.1f}')}; cost of transport {each_mean(costs, '× {:.1f}')};"
        f" CoT+ {each_mean(positive_costs, '× {:.1f}')}",
        counts(speeds.values()),
        verdict([above(one, 1) for one in [*speeds.values(), *costs.values()]]),
        "The policy is faster and costs more per metre in every fluid.",
        "sea_snake",
    )


def _own_fluid(results: Results) -> Iterator[Claim]:
    speeds = [policy(results, "speed", fluid, unit="m/s") for fluid in results.fluids]
    costs, positive_costs = (costs_in_fluids(results, column) for column in _COSTS)
    claimed = [f"{one.speed:.2f}, {one.cost_of_transport:.2f}" for one in paper.POLICY.values()]
    yield Claim(
        "Speed falls and cost of transport rises from water to oil2: v [m/s], CoT",
        "; ".join(claimed),
        "; ".join(
            f"{v.text()}, {cost.text(2)} (CoT+ {positive.text(2)})"
            for v, cost, positive in zip(speeds, costs, positive_costs, strict=True)
        ),
        counts(speeds),
        verdict([ordered(speeds[::-1]), ordered(costs)]),
        "Both orders must hold for every seed. In water ours is"
        f" {speeds[0].mean / paper.POLICY['water'].speed:.1f} times as fast as the paper's, at"
        f" {costs[0].mean / paper.POLICY['water'].cost_of_transport:.1f} times its cost of transport.",
        "teacher_student",
    )


def _gait(results: Results) -> Iterator[Claim]:
    first, last = results.fluids[0], results.fluids[-1]
    faster, slower = paper.TREND["swim_frequency"]
    frequency, tail = (
        [policy(results, column, fluid, unit=unit) for fluid in results.fluids]
        for column, unit in (("swim_frequency", "Hz"), ("tail_amplitude", "m"))
    )
    yield Claim(
        f"The policy's frequency falls from {first} to {last} [Hz]",
        paper.trend("swim_frequency"),
        path(frequency),
        counts(frequency),
        verdict([ordered([frequency[-1], frequency[0]])]),
        f"It must fall for every seed; ours falls to {100 * frequency[-1].mean / frequency[0].mean:.0f} %, the paper's"
        f" to {100 * slower / faster:.0f} %.",
        "adaptation",
    )
    yield Claim(
        f"Its tail amplitude grows from {first} to {last} [m]",
        paper.trend("tail_amplitude"),
        path(tail),
        counts(tail),
        verdict([ordered([tail[0], tail[-1]])]),
        f"It must grow for every seed; ours changes by {100 * (tail[-1].mean / tail[0].mean - 1):+.0f} %, at about"
        f" {frequency[0].mean / faster:.0f} times the paper's frequency in {first}.",
        "adaptation",
    )
    torque = [policy(results, "torque_amplitude", fluid, unit="N m") for fluid in results.fluids]
    means, (least, most) = [one.mean for one in torque], paper.TREND["torque_amplitude"]
    yield Claim(
        "The amplitude of its torque is about the same in all fluids [N m]",
        paper.trend("torque_amplitude"),
        path(torque),
        counts(torque),
        verdict([max(means) <= 1.25 * min(means), all(least <= mean <= most for mean in means)]),
        f"Two parts: means within a quarter of each other, and each from {least:g} to {most:g}. Ours, of the joint that"
        " exerts most, are about twice the paper's.",
        "adaptation",
    )


def _fixed_gait(results: Results) -> Iterator[Claim]:
    where: dict[str, Any] = {"gait": "calibration", "engine": "pybullet", "physics_rate": 960}
    take = partial(results.quantity, unit="m", study="validation", table="runs", column="tail_amplitude", by="gait")
    tails = [take(f"fixed sinusoid in {fluid}: tail", fluid=fluid, **where) for fluid in results.fluids]
    yield Claim(
        "The tail amplitude of one fixed sinusoid (3.5 N m, 0.70 Hz, 0.84 rad) falls with viscosity [m]",
        "0.447 to 0.249",
        path(tails),
        counts(tails),
        verdict([ordered(tails[::-1])]),
        "It must fall from fluid to fluid.",
        "validation",
    )


def _privilege(results: Results) -> Iterator[Claim]:
    returns = {
        name: mean_return(results, name) for name in ("teacher", "symmetric", "student", *short_learners(results))
    }
    teacher, symmetric = returns["teacher"], returns["symmetric"]
    short = [one for name, one in returns.items() if name.startswith(SHORT)]
    failed = f" from short rollouts {', '.join(f'{one.mean:.0f}' for one in short)}," if short else ""
    yield Claim(
        "Without privileged information learning fails: mean return with and without",
        "about 170 and about 50",
        f"{teacher.text(1)} and {symmetric.text(1)}",
        counts([teacher, symmetric]),
        verdict([above(teacher, symmetric.mean), symmetric.mean < _ALIKE * teacher.mean]),
        f"More with it, and less than {100 * _ALIKE:.0f} % of that without: two parts. Without it a learner earns"
        f"{failed} from long ones at its best change per update nearly as much, but not reliably.",
        "teacher_student",
    )
    shares = combined(
        "student's share of its teacher's return",
        {"student": returns["student"], "teacher": teacher},
        lambda student, taught: 100 * student / taught,
        "%",
    )
    results.taken.append(shares)
    yield Claim(
        "The student imitates its teacher accurately from its sensors alone",
        "error falls to a constant",
        f"{shares.text(1)} % of its teacher's return",
        str(shares.n),
        verdict([above(shares, 100 * _NEARLY)]),
        f"More than {100 * _NEARLY:.0f} % of its own teacher's return over the range of viscosities.",
        "teacher_student",
    )


def _cross(results: Results) -> Iterator[Claim]:
    for column, said in (("speed", "the fastest"), ("cost_of_transport", "of the lowest cost of transport")):
        own, wrong = replayed(results, column)
        papers = ", ".join(
            f"{a}'s in {b} {getattr(paper.CROSS[b][a], column):.2f}" for a, b in farthest_pairs(results.fluids)
        )
        ours = f"seeds for which it is: {_said_of_replays(own, wrong)}"
        if column != "speed":
            ours += f"; of the lowest CoT+: {_said_of_replays(*replayed(results, f'positive_{column}'))}"
        yield Claim(
            f"Replayed open loop, a fluid's own gait is {said} in it",
            f"in all three; {papers}",
            ours,
            counts(own.values()),
            verdict([one.mean == 1 for one in own.values()]),
            "It must be so for every seed in each fluid.",
            "cross",
        )


def _said_of_replays(own: Mapping[str, Measurement], wrong: Mapping[str, Measurement]) -> str:
    won = ", ".join(f"{fluid} {sum(one.values):.0f} of {one.n}" for fluid, one in own.items())
    return f"{won}; {', '.join(f'{where} {one.text(2)}' for where, one in wrong.items())}"


def _adapts(results: Results) -> Iterator[Claim]:
    seconds = recovery(results, "max")
    kinds = {kind: share_of_switching(results, kind) for kind in METHOD_NAMES if kind in switched(results)}
    yield Claim(
        "One network adapts to a viscosity that is unknown and changes",
        "yes; no change in mid-swim is shown",
        f"back within 5 % in {max(seconds.values):.1f} s at worst; distance against ideal switching:"
        f" {', '.join(f'{share.mean:.0f} % of {METHOD_NAMES[kind]}' for kind, share in kinds.items())}",
        str(seconds.n),
        verdict([max(seconds.values) <= _SOON, *(above(share, _SHARE) for share in kinds.values())]),
        f"Back in at most {_SOON:g} s after a step in either direction, and at least {_SHARE:g} % of ideal switching"
        " between gaits tuned to each fluid, of every kind, in the mean over the courses.",
        "adaptation",
    )


_JUDGES: tuple[Callable[[Results], Iterator[Claim]], ...] = (
    _faster_than_fronts,
    _cheaper_than_switching,
    _sea_snake,
    _own_fluid,
    _gait,
    _fixed_gait,
    _privilege,
    _cross,
    _adapts,
)
