"""What the learned-front page shows: fronts of policies with a dial beside those of fixed gaits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.metrics import GRAVITY
from snakebench.reporting.animation import swimmer
from snakebench.reporting.assumptions import assumptions_of_preference
from snakebench.reporting.figures import learned_front as figures
from snakebench.reporting.figures import teacher_student as learning_figures
from snakebench.reporting.tables import Table, confidence_interval, downloads, number
from snakebench.robot import Robot
from snakebench.store import read_manifest, read_table
from snakebench.trajectory import Trajectory

_BASELINES = {
    "sea_snake": "sea snake",
    "paper": "sinusoid",
    "extended": "wider sinusoid",
    "fourier": "free waveform",
}
_STUDIES = ("sea_snake_front", "pareto", "fourier")
_POWERS = (1, 3, 5, 10, 15, 20)  # [W] at which speeds are compared
_SPEEDS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # [m/s] at which the cost of transport is


def learned_front_page(directory: Path, manifest: dict[str, Any]) -> dict[str, Any]:
    """Everything the learned-front page shows; the fronts of fixed gaits are those beside the study's directory."""
    config = manifest["config"]
    curves, steps, dial, attainment = (
        read_table(directory / f"{name}.csv") for name in ("curves", "steps", "dial", "attainment")
    )
    policies = list(dict.fromkeys(steps["policy"]))
    students = [name for name in policies if "teacher" in config["policies"][name]]
    fine = dial[dial["variant"] == "finer step"]
    learned, fixed = _fronts(directory), _fixed(directory.parent, config["reference"])
    worth = pd.concat([_of_policies(_indicators(directory)), *(_worth(directory.parent, config["reference"]))])
    methods = [*(name for name in _BASELINES.values() if name in set(worth["method"])), *policies]
    names = [name for name in (*config["fluids"], "integrated", "simple-sum") if name in set(worth["front"])]
    best = students[0] if students else policies[0]
    return {
        "manifest": manifest,
        "config": config,
        "answers": list(_answers(worth, best, config["policies"][best].get("teacher"), names)),
        "swimmers": list(_swimmers(directory, config)),
        "dial": _dial(dial, config),
        "by_fluid": figures.fronts(fixed, learned, config["fluids"]),
        "overall": figures.fronts(fixed, learned, [name for name in names if name not in config["fluids"]]),
        "equal_power": _equal_power(worth, methods, names),
        "gains": _gains(worth, best, names),
        "worth": _hypervolumes(worth, methods, names),
        "losses": list(_losses(worth, best, names)),
        "equal_speed": _equal_speed(
            pd.concat([fixed, learned]) if len(fixed) else learned,
            methods,
            names,
            Robot(**config["robot"]).total_mass * GRAVITY,
        ),
        "attainment": figures.attainment(attainment[attainment["policy"] == best], names),
        "turned": figures.turned(fine[fine["policy"] == best], config["fluids"]),
        "monotony": _monotony(fine, policies, config["fluids"]),
        "learning": learning_figures.learning(curves, [name for name in policies if name not in students]),
        "distillation": learning_figures.distillation(curves, students) if students else None,
        "unsteady": int((~fine["steady"]).sum()),
        "n_swims": len(fine),
        "failed": fine[fine["status"] != "ok"]["status"].value_counts().to_dict(),
        "downloads": downloads(directory, "dial", "fronts", "indicators", "attainment"),
        "assumptions": assumptions_of_preference(config),
    }


def _of_policies(table: pd.DataFrame) -> pd.DataFrame:
    """A table by `space`, "POLICY SEED", as one by method and seed."""
    split = table["space"].str.rsplit(" ", n=1, expand=True)
    return table.assign(method=split[0], seed=split[1].astype(int))


def _indicators(directory: Path) -> pd.DataFrame:
    return read_table(directory / "indicators.csv")


def _fronts(directory: Path) -> pd.DataFrame:
    return _of_policies(_points(directory))


def _points(directory: Path) -> pd.DataFrame:
    """Every point of every front of a study: columns space, front, speed, power."""
    parts = [read_table(directory / "fronts.csv")]
    if (directory / "switching.csv").exists():
        parts.append(read_table(directory / "switching.csv").assign(front="simple-sum"))
    return pd.concat(parts, join="inner", ignore_index=True)


def _counted_alike(results: Path, reference: Sequence[float]) -> Iterator[Path]:
    """The directories of the studies of fixed gaits that are there and count hypervolume from the same reference."""
    for name in _STUDIES:
        directory = results / name
        if (directory / "manifest.json").exists() and read_manifest(directory)["config"]["reference"] == list(
            reference
        ):
            yield directory


def _fixed(results: Path, reference: Sequence[float]) -> pd.DataFrame:
    """The fronts of fixed gaits, as `_fronts`."""
    columns = ["method", "seed", "front", "speed", "power"]
    parts = [
        (points := _points(directory)).assign(method=points["space"].map(_BASELINES), seed=0)[columns]
        for directory in _counted_alike(results, reference)
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def _worth(results: Path, reference: Sequence[float]) -> Iterator[pd.DataFrame]:
    for directory in _counted_alike(results, reference):
        table = _indicators(directory)
        yield table.assign(method=table["space"].map(_BASELINES), seed=0)


def _of(worth: pd.DataFrame, method: str, front: str) -> pd.DataFrame:
    return worth[(worth["method"] == method) & (worth["front"] == front)]


def _answers(worth: pd.DataFrame, best: str, teacher: str | None, names: Sequence[str]) -> Iterator[str]:
    """The findings, a sentence each."""
    for name in names:
        own = _of(worth, best, name)["hypervolume"]
        if not len(own):
            continue
        beside = [
            f"{100 * (own.mean() / _of(worth, baseline, name)['hypervolume'].mean() - 1):+.0f} % of the {baseline}'s"
            for baseline in _BASELINES.values()
            if len(_of(worth, baseline, name))
        ]
        where = f"In {name}" if name not in ("integrated", "simple-sum") else f"Over all fluids, {name}"
        tail = f", {', '.join(beside)}" if beside else ""
        yield f"{where}, the {best}'s front is worth {own.mean():.2f} m/s W{tail} (mean of n = {len(own)} seeds)."
    if teacher is not None and {best, teacher} <= set(worth["method"]):
        shares = _shares(worth, best, teacher)
        means = shares.groupby(level="front", sort=False).mean()
        said = "; ".join(f"{name} {100 * share:.1f} %" for name, share in means.items())
        yield f"The {best} keeps of its teacher's hypervolume: {said}."


def _shares(worth: pd.DataFrame, student: str, teacher: str) -> pd.Series:
    """The student's share of its teacher's hypervolume, by front and seed."""
    by = worth.set_index(["method", "front", "seed"])["hypervolume"]
    return (by.loc[student] / by.loc[teacher]).dropna()


def _mean(values: pd.Series, digits: int = 3) -> str:
    """A mean, with its 95 % interval if there are several seeds."""
    interval = confidence_interval(values.to_numpy())
    if not len(values):
        return "–"
    return f"{values.mean():.{digits}f}" + (
        f" ({interval[0]:.{digits}f} to {interval[1]:.{digits}f})" if interval is not None else ""
    )


def _equal_power(worth: pd.DataFrame, methods: Sequence[str], names: Sequence[str]) -> Table:
    rows = []
    for name in names:
        for method in methods:
            part = _of(worth, method, name)
            if len(part):
                cells = [_mean(part[f"speed_at_{power}_W"]) for power in _POWERS]
                rows.append([f"{name}, {method}", str(len(part)), *cells])
    return Table(
        "Highest speed [m/s] on each front for at most a power: mean over seeds, 95 % Student-t interval of the mean.",
        ["front, method", "n", *(f"{power} W" for power in _POWERS)],
        rows,
    )


def _gains(worth: pd.DataFrame, best: str, names: Sequence[str]) -> Table | None:
    """How much faster the policy is than each baseline at equal power [%]."""
    rows = []
    for name in names:
        for baseline in _BASELINES.values():
            fixed, own = _of(worth, baseline, name), _of(worth, best, name)
            if len(fixed) and len(own):
                cells = []
                for power in _POWERS:
                    gains = 100 * (own[f"speed_at_{power}_W"] / fixed[f"speed_at_{power}_W"].mean() - 1)
                    cells.append(_mean(gains, 0))
                rows.append([f"{name}, beyond the {baseline}", *cells])
    head = ["front", *(f"{power} W" for power in _POWERS)]
    caption = f"How much faster the {best} is at equal power than a front of fixed gaits [%]: mean and 95 % interval."
    return Table(caption, head, rows) if rows else None


def _losses(worth: pd.DataFrame, best: str, names: Sequence[str]) -> Iterator[str]:
    """Where a front of fixed gaits is faster than the policy, a sentence each."""
    for name in names:
        for baseline in _BASELINES.values():
            fixed, own = _of(worth, baseline, name), _of(worth, best, name)
            lost = [
                f"{power} W ({own[f'speed_at_{power}_W'].mean():.3f} against {fixed[f'speed_at_{power}_W'].mean():.3f})"
                for power in _POWERS
                if len(fixed) and own[f"speed_at_{power}_W"].mean() < fixed[f"speed_at_{power}_W"].mean()
            ]
            if lost:
                yield f"{name}: the {baseline} is faster at {', '.join(lost)}"


def _hypervolumes(worth: pd.DataFrame, methods: Sequence[str], names: Sequence[str]) -> Table:
    rows = []
    for name in names:
        for method in methods:
            part = _of(worth, method, name)
            if len(part):
                seeds = ", ".join(f"{value:.2f}" for value in part["hypervolume"]) if len(part) > 1 else ""
                rows.append([f"{name}, {method}", str(len(part)), _mean(part["hypervolume"], 2), seeds])
    return Table(
        "Hypervolume [m/s W] of each front from the reference: mean, 95 % Student-t interval of the mean, every seed.",
        ["front, method", "n", "hypervolume", "seeds"],
        rows,
    )


def _equal_speed(fronts: pd.DataFrame, methods: Sequence[str], names: Sequence[str], weight: float) -> Table:
    """The lowest cost of transport of a point that is at least so fast."""
    rows = []
    for name in names:
        for method in methods:
            of_method = fronts[(fronts["method"] == method) & (fronts["front"] == name)]
            if len(of_method):
                cells = []
                for speed in _SPEEDS:
                    fast = of_method[of_method["speed"] >= speed]
                    costs = (fast["power"] / (weight * fast["speed"])).groupby(fast["seed"]).min()
                    all_of_them = len(costs) == of_method["seed"].nunique()
                    cells.append(f"{costs.mean():.3f}" if all_of_them else "–")
                rows.append([f"{name}, {method}", *cells])
    return Table(
        "Lowest cost of transport on each front of a point at least as fast, mean over seeds; a dash where not every"
        " seed is so fast.",
        ["front, method", *(f"{speed:g} m/s" for speed in _SPEEDS)],
        rows,
    )


def _monotony(fine: pd.DataFrame, policies: Sequence[str], fluids: Sequence[str]) -> Table:
    """Whether speed and power fall as the price rises."""
    rows = []
    for policy in policies:
        for fluid in fluids:
            part = fine[(fine["policy"] == policy) & (fine["fluid"] == fluid)]
            cells = []
            for column in ("speed", "power"):
                by_seed = [seed[column].to_numpy() for _, seed in part.sort_values("price").groupby("seed")]
                rises = np.concatenate([np.diff(values) for values in by_seed])
                share = 100 * max(float(rises.max()), 0.0) / float(part[column].max())
                cells.append(f"{(rises <= 0).sum()} of {len(rises)}, largest rise {share:.1f} %")
            still = (part["speed"] < 0.01).sum()
            means = part.groupby("price")["power"].mean()
            ends = f"{number(means.iloc[0])} to {number(means.iloc[-1])}"
            rows.append([f"{policy}, {fluid}", *cells, f"{still} of {len(part)}", ends])
    return Table(
        "Along the dial, from the lowest price of power to the highest: how many steps do not raise speed or power, the"
        " largest rise as a share of the highest value, positions at which it stands still (below 0.01 m/s), and mean"
        " power at both ends [W]; all seeds.",
        ["policy, fluid", "speed falls", "power falls", "stands still", "power"],
        rows,
    )


def _swimmers(directory: Path, config: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for name in config["shown"]:
        for fluid in config["fluids"]:
            for k in range(config["swims"]):
                run = Trajectory.load(directory / "trajectories" / f"{name}-{fluid}-{k}.npz")
                yield swimmer(f"{name} in {fluid}", run)


def _dial(dial: pd.DataFrame, config: dict[str, Any]) -> dict[str, Any]:
    """What the player's dial shows."""
    prices = np.geomspace(dial["price"].min(), dial["price"].max(), config["swims"])
    return {"label": "price of power λ", "positions": [f"{price:.3g} 1/W" for price in prices]}
