"""What the index page shows: the answer, the claims, and every comparison, each number with where it comes from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from snakebench.comparison import figures
from snakebench.comparison.assumption_effects import ledger_of_assumptions
from snakebench.comparison.claims import DIALLED, claims
from snakebench.comparison.gain_ledger import EQUAL, EVERYWHERE, Account, cost_table, ledger, ledger_rows, ledger_table
from snakebench.comparison.measured import gain, gain_with_dial, recovery
from snakebench.comparison.quantities import Missing, Results, damage_as_missing, policy
from snakebench.comparison.verdicts import markdown
from snakebench.metrics import GRAVITY
from snakebench.report.animation import lane
from snakebench.report.equal_power import speeds_within
from snakebench.report.front_figure import fronts
from snakebench.report.measurements import readable
from snakebench.report.method_names import name_of
from snakebench.report.tables import Table, data_link
from snakebench.robot import Robot
from snakebench.store import PAPER, STUDIES, command_of, read_manifest
from snakebench.studies.adaptation.figures import course as course_figure
from snakebench.studies.cross.page import matrices
from snakebench.studies.learned_front.front_comparison import Contest, compared
from snakebench.studies.published import published
from snakebench.studies.published_fronts import OVERALL, single_points, standings
from snakebench.trajectory import Trajectory

_RACE = 20.0  # seconds of the race

Section = Callable[[Results], dict[str, Any]]


def index_page(root: Path, pages: Mapping[str, str], problems: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Everything the index page shows.

    Args:
        root: the directory of all results.
        pages: the pages made from them, by the name of the results' directory.
        problems: what is wrong with results that are not there, likewise.
    """
    results = Results(root, problems)
    judged, missing = claims(results)
    content: dict[str, Any] = {"claims": judged}
    for name, section in _SECTIONS.items():
        try:
            with damage_as_missing(name):
                content[name] = section(results)
        except Missing as error:
            content[name] = None
            missing.append(str(error))
    gains = content["gains"]
    content["answers"] = _answers(results, gains, judged)
    numbers = pd.DataFrame([one.row() for one in results.taken]).drop_duplicates(ignore_index=True)
    studies = _provenance(results, pages)
    verdicts = [claim.verdict for claim in judged]
    return content | {
        "verdicts": {kind: verdicts.count(kind) for kind in ("reproduced", "in part", "not")},
        "missing": list(dict.fromkeys(missing)),
        "pages": pages,
        "studies": studies,
        "simulations": sum(row["evaluations"] for row in studies if not row["missing"]),
        "downloads": [data_link("numbers.csv", numbers), *([gains["data"]] if gains else [])],
        "n_numbers": len(numbers),
        "made_by": "snakebench report",
    }


def index_files(content: Mapping[str, Any]) -> dict[str, str]:
    """What is written beside the index page, for a README to show: the claims and two figures, where they are there."""
    files = {"claims.md": markdown(content["claims"])} if content["claims"] else {}
    for name, section, figure in (("fronts.svg", "fronts", "by_fluid"), ("ledger.svg", "gains", "waterfall")):
        if content[section]:
            files[name] = str(content[section][figure]).partition("</svg>")[0] + "</svg>\n"
    return files


def _answers(results: Results, gains: dict[str, Any] | None, judged: list[Any]) -> list[str]:
    """The answer in three sentences, those of them for which there are results."""
    sentences = []
    with suppress(Missing), damage_as_missing("answer"):
        own = {fluid: policy(results, "speed", fluid, unit="m/s") for fluid in results.fluids}
        better = [gain(results, fluid) for fluid in results.fluids]
        dialled = [gain_with_dial(results, fluid, DIALLED) for fluid in results.fluids]
        sentences.append(
            f"One learned policy, which feels only its joints and its head's turning, swims"
            f" {_listed(f'{one.mean:.2f}' for one in own.values())} m/s in {_listed(own)}, and is there"
            f" {_listed(f'{one.mean:.0f}' for one in better)} % faster than the paper's fixed sinusoids that need no"
            f" more power, tuned to each fluid; with a dial turned to {DIALLED:g} W it is"
            f" {_listed(f'{one.mean:.0f}' for one in dialled)} % faster (n = {better[0].n})."
        )
    if gains:
        sentences.append(_decomposed(gains["accounts"]))
    with suppress(Missing), damage_as_missing("answer"):
        back, longest = recovery(results, "mean"), recovery(results, "max")
        kinds, worst = [claim.verdict for claim in judged], max(longest.values)
        sentences.append(
            f"When the viscosity jumps four-thousandfold in mid-swim it is back within 5 % of its speed after"
            f" {back.mean:.1f} s in the mean and {worst:.1f} s at worst; of the paper's {len(kinds)} claims"
            f" {kinds.count('reproduced')} are reproduced, {kinds.count('in part')} in part and"
            f" {kinds.count('not')} not."
        )
    return sentences


def _decomposed(accounts: list[Account]) -> str:
    """What the gain over all fluids is made of, at the student's own power."""
    account = next(one for one in accounts if one.place == EVERYWHERE and one.view == "at the student's power")
    first, *others = (step.speed.mean for step in account.steps)
    parts = [f"{100 * (other / first - 1):+.0f} %" for other in others]
    wider, waveform, teacher, student, fixed = parts
    return (
        "Over all fluids, at its power and against ideal switching among the paper's sinusoids, the mean speed is"
        f" {wider} with a wider range of actuators, {waveform} with a free waveform tuned to each fluid, {teacher} with"
        f" feedback that is told the fluid and {student} with feedback that must infer it; the best single waveform for"
        f" all fluids, without feedback, has {fixed}."
    )


def _gains(results: Results) -> dict[str, Any]:
    accounts = ledger(results)
    seeds = {step.method: step.speed.n for account in accounts for step in account.steps}
    views = list(dict.fromkeys(account.view for account in accounts))
    return {
        "accounts": accounts,
        "equal_power": EQUAL,
        "seeds": seeds,
        "waterfall": figures.waterfall(accounts),
        "tables": [table(accounts, view) for view in views for table in (ledger_table, cost_table)],
        "data": data_link("ledger.csv", ledger_rows(accounts)),
    }


def _fronts(results: Results) -> dict[str, Any]:
    """The two Pareto figures with everything in them, and how the fronts compare."""
    directory, config = results.directory("learned_front"), results.manifest("learned_front")["config"]
    study = published(directory)
    points, worth, fixed = standings(study)
    marks, fluids = single_points(study), config["fluids"]
    overall = [name for name in OVERALL if name in set(points["front"])]
    contest = Contest("student", "teacher", fixed, ["teacher", "student"])
    weight = Robot(**config["robot"]).total_mass * GRAVITY
    shown = compared(points, worth, contest, [*fluids, *overall], weight)
    return {
        "by_fluid": fronts(points, marks, fluids, "Speed against power in each fluid, everything"),
        "overall": fronts(points, marks, overall, "Speed against power over all fluids, everything"),
        "gains": shown["gains"],
        "worth": shown["worth"],
        "losses": shown["losses"],
        "dominated": _dominated(points, fixed, [*fluids, *overall]),
        "reference": config["reference"],
    }


def _dominated(points: pd.DataFrame, methods: list[str], names: list[str]) -> Table:
    """Which part of each front of fixed gaits the student's fronts dominate."""
    rows = []
    for name in names:
        here = points[points["front"] == name]
        seeds = [part for _, part in here[here["method"] == "student"].groupby("seed")]
        for method in (one for one in methods if one in set(here["method"])):
            fixed = here[here["method"] == method].sort_values("power")
            speed, power = fixed["speed"].to_numpy(), fixed["power"].to_numpy()
            beaten = np.mean([speeds_within(seed, power) > speed for seed in seeds], axis=0)
            every = power[beaten == 1]
            ends = dict.fromkeys(f"{power:.3g}" for power in (every.min(), every.max())) if len(every) else {}
            span = f"{' to '.join(ends)} W" if ends else "none"
            rows.append([f"{name}, {method}", str(len(fixed)), f"{100 * beaten.mean():.0f}", span])
    return Table(
        "Which points of each front of fixed gaits the student with a dial dominates: faster for no more power. Share"
        f" in the mean of its {len(seeds)} seeds, and between which powers lie the points that every seed dominates.",
        ["front, method", "points", "dominated [%]", "by every seed"],
        rows,
    )


def _matrices(results: Results) -> dict[str, Any]:
    """The cross-environment matrices as heat maps."""
    matrix = readable(results.table("cross", "matrix"), "gait_of")
    return {"matrices": matrices(matrix, results.manifest("cross")["config"]["fluids"])}


def _changing(results: Results) -> dict[str, Any]:
    """The first course through a changing fluid: every seed of the policy, and gaits that are one for all fluids."""
    config, traces = results.manifest("adaptation")["config"], results.table("adaptation", "traces")
    name, course = next(iter(config["courses"].items()))
    part, pilot = traces[traces["course"] == name], config["pilots"][0]
    gaits = {str(method): name_of(str(method)) for method in part["method"].unique() if method not in config["pilots"]}
    if not len(part):
        raise Missing(f"adaptation: nothing swam through {name}; {command_of('adaptation')} makes it")
    return {"figure": course_figure(name, course["along"], part, [pilot], gaits)}


def _race(results: Results) -> dict[str, Any]:
    """The student and the best sinusoid of each fluid side by side, from rest."""
    directory = results.directory("cross") / "trajectories"
    lanes = []
    for fluid in results.manifest("cross")["config"]["fluids"]:
        for method, label in (("student", "student"), (PAPER, "best sinusoid")):
            path = directory / f"{method}-{fluid}.npz"
            if not path.exists():
                raise Missing(f"cross: no swim {path.name}; {command_of('cross')} makes it")
            lanes.append(lane(label, fluid, Trajectory.load(path), _RACE))
    return {"lanes": lanes, "seconds": _RACE}


def _assumptions(results: Results) -> dict[str, Any]:
    return {"rows": ledger_of_assumptions(results)}


def _provenance(results: Results, pages: Mapping[str, str]) -> list[dict[str, Any]]:
    """Where each study's results come from, and where its page is."""
    rows: list[dict[str, Any]] = []
    for name in STUDIES:
        try:
            rows.append(_row(results.directory(name), pages))
        except Missing as error:
            rows.append({"study": name, "page": None, "missing": str(error), "command": command_of(name)})
    listed = {row["study"] for row in rows} | {"bench"}  # which is of this machine, and no study
    return rows + [_row(results.root / name, pages) for name in sorted(pages) if name not in listed]


def _row(directory: Path, pages: Mapping[str, str]) -> dict[str, Any]:
    """Where the results in a directory come from.

    Raises:
        Missing: when its manifest is damaged.
    """
    name = directory.name
    with damage_as_missing(name):
        manifest = read_manifest(directory)
        about = {"study": name, "page": pages.get(name), "command": command_of(name, manifest), "missing": None}
        return about | _made(manifest)


def _made(manifest: Mapping[str, Any]) -> dict[str, Any]:
    """How results were made, as it is shown."""
    machine, versions = manifest["machine"], manifest["versions"]
    system = f"{machine['cores']} cores, {machine['system'].split('-')[0]}"
    packages = f"Python {versions['python']}, PyBullet {versions['pybullet']}, snakebench {versions['snakebench']}"
    return {
        "profile": manifest["config"]["profile"],
        "evaluations": int(manifest["evaluations"]),
        "computed": int(manifest["computed"]),
        "minutes": f"{manifest['seconds'] / 60:.0f}",
        "commit": manifest["commit"],
        "machine": f"{system}, {packages}",
    }


def _listed(words: Any) -> str:
    *most, last = map(str, words)
    return f"{', '.join(most)} and {last}" if most else last


_SECTIONS: dict[str, Section] = {
    "fronts": _fronts,
    "gains": _gains,
    "cross": _matrices,
    "changing": _changing,
    "lanes": _race,
    "assumptions": _assumptions,
}
