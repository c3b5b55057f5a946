"""Make an entry of the leaderboard from the results of a study: python examples/study_entries.py sinusoid.

Gaits become a table: of each fluid those that are fastest at the powers of the task `known`, and of those that swam in
all fluids the one that comes nearest to the limit in the mean. A policy is that of the first seed.
"""

import argparse
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from snakebench.collocation.front import gait_at, under_first_bounds
from snakebench.controllers import GAITS
from snakebench.fluid import named_fluid
from snakebench.manifest import left_out_files
from snakebench.scoring.entry import TABLE, Setting
from snakebench.scoring.leaderboard import write_entry
from snakebench.scoring.tasks import load_tasks
from snakebench.scoring.yardstick import Yardstick
from snakebench.studies.published import published
from snakebench.tables import fourier_gait

TASKS = load_tasks("v1")


class Source(NamedTuple):
    """Where an entry comes from: a study, and which of its gaits or policies."""

    name: str  # of the entry
    study: str
    what: str  # a search space, or a policy
    teacher: str = ""  # of the policy
    information: str = "open loop"


SOURCES = {
    "sinusoid": Source("sinusoid", "pareto", "paper"),
    "wider_sinusoid": Source("wider sinusoid", "pareto", "extended"),
    "sea_snake": Source("sea snake", "sea_snake_front", "sea_snake"),
    "free_waveform": Source("free waveform", "fourier", ""),
    "limit": Source("limit's gaits (reference)", "limit", ""),
    "student": Source("student", "teacher_student", "student", "teacher", "sensors"),
    "preference_student": Source("preference-conditioned student", "learned_front", "student", "teacher", "sensors"),
    "imitator": Source("imitator of the limit", "imitation", "imitator_positive", "", "sensors"),
    "robust_student": Source("robust student", "robust", "robust_student", "teacher", "sensors"),
    "teacher": Source("teacher", "teacher_student", "teacher", "", "privileged"),
    "symmetric": Source("symmetric policy", "ablations", "symmetric_long", "", "sensors"),
}


def searched(study, space):
    """Swims of the gaits in a search space, with the gait of each row."""
    swims, bounds = study.tables["verified"], study.config["spaces"][space]
    inside = np.all([swims[name].between(low, high) for name, (low, high) in bounds.items()], axis=0)
    swims, kind = swims[inside & (swims["status"] == "ok")], GAITS.named(study.config["gait"])
    return swims.assign(gait=[kind(**row) for row in swims[list(bounds)].to_dict("records")])


def waveforms(study):
    """Swims of the free waveforms, with the gait of each row."""
    search = ["tuned_to", "harmonics", "objective", "price", "seed"]
    # The return has no price.
    swims, coefficients = (study.tables[name].fillna({"price": 0.0}) for name in ("optima", "gaits"))
    swims = swims[(swims["variant"] == "finer step") & (swims["status"] == "ok")]
    gaits = {names: fourier_gait(rows) for names, rows in coefficients.groupby(search)}
    return swims.assign(gait=[gaits[tuple(row)] for row in swims[search].to_numpy().tolist()])


def table(swims):
    """The rows of a table of gaits: first the one for all fluids, then those of each fluid."""
    swims = swims[(swims["positive_power"] > 0) & (swims["speed"] > 0)]
    rows = [(None, best_in_all(swims.assign(name=[gait.digest() for gait in swims["gait"]])))]
    for name in TASKS.fluids:
        for power in TASKS.known.powers:
            within = swims[(swims["fluid"] == name) & (swims["positive_power"] <= power)]
            rows += [(name, gait) for gait in within.nlargest(1, "speed")["gait"]]
    return list(dict.fromkeys(rows))


def best_in_all(swims):
    """Of the gaits that swam in all fluids the one with the highest mean share of the limit's speed at its power."""
    swims = swims.drop_duplicates(["name", "fluid"])
    swims = swims[swims.groupby("name")["fluid"].transform("size") == len(TASKS.fluids)]
    yardsticks = {wide: Yardstick(TASKS, "positive", wide) for wide in (False, True)}
    rows = zip(swims["gait"], swims["fluid"], swims["positive_power"], strict=True)
    limit = [yardsticks[Setting(controller=gait).wide].at(named_fluid(fluid), power)[0] for gait, fluid, power in rows]
    shares = (swims["speed"] / limit).groupby(swims["name"]).mean()
    return swims[swims["name"] == shares.idxmax()]["gait"].iloc[0]


def limits(study):
    """The limit's gaits that are told the fluid: those of at least 1 W of P+."""
    rows, gaits = (under_first_bounds(study.tables[name], study.config) for name in ("limit", "gaits"))
    rows = rows[(rows["currency"] == "positive") & (rows["allowed"] >= min(TASKS.known.powers))]
    return [(row["fluid"], gait_at(gaits, row)) for _, row in rows.iterrows()]


def seconds_of_limit(study):
    """How long the limit took that a study was made from, if it was."""
    names = [name for name in study.manifest.get("read", {}) if name.startswith("limit")]
    return sum(published(study.directory.parent / name).manifest["seconds"] for name in names)


def main(words=None):
    """Write the entry that the command asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("entry", choices=SOURCES)
    parser.add_argument("--results", type=Path, default=Path("results"), help="directory with the study's results")
    parser.add_argument("--out", type=Path, help="folder of the entry")
    asked = parser.parse_args(words)
    source = SOURCES[asked.entry]
    study, out = published(asked.results / source.study), asked.out or Path(asked.entry)
    about = {"name": source.name, "authors": ["snakebench"], "information": source.information}
    if source.information == "open loop":
        if source.study == "limit":
            found = limits(study)
        else:
            found = table(waveforms(study) if source.study == "fourier" else searched(study, source.what))
        rows = [{"fluid": fluid, "gait": gait.model_dump(mode="json")} for fluid, gait in found]
        content = json.dumps({"kind": TABLE, "gaits": rows}) + "\n"
        hours = round((study.manifest["seconds"] + seconds_of_limit(study)) / 3600, 1)
        path = write_entry(out, content.encode(), "gait.json", hours=hours, **about)
    else:
        steps, seconds = study.tables["steps"], study.manifest.get("training_seconds", {})
        learned = [name for name in (source.what, source.teacher) if name]
        seed = steps[steps["policy"] == source.what]["seed"].min()
        steps = steps[steps["policy"].isin(learned) & (steps["seed"] == seed)]
        hours = (sum(seconds.get(f"{name} {seed}", 0.0) for name in learned) + seconds_of_limit(study)) / 3600
        about |= {"training_steps": int(steps["steps"].sum()), "hours": round(hours, 3)}
        file = f"policies/{source.what}-{seed}.safetensors"
        if file in left_out_files(study.manifest):
            content = (study.directory / file).read_bytes()
            path = write_entry(out, content, "policy.safetensors", **about)
        else:
            path = write_entry(out, None, f"../../results/{study.directory.name}/{file}", **about)
    print(f"written: {path}")


if __name__ == "__main__":
    main()
