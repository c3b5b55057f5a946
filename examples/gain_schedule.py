"""Make a gain schedule from the limit's gaits: python examples/gain_schedule.py.

It needs results of the study limit, with gaits of held targets.
"""

import argparse
import time
from pathlib import Path

import torch

from snakebench.gain_schedule import GainSchedule
from snakebench.learning.estimator import train_estimator
from snakebench.learning.settings import Scheduling
from snakebench.manifest import read_manifest
from snakebench.scoring.leaderboard import write_entry
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.demonstrated import demonstrations
from snakebench.studies.running import study_config

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--results", type=Path, default=Path("results"), help="directory with the study's results")
parser.add_argument("--study", default="limit", help="name of the study of the limit")
parser.add_argument("--currency", choices=("net", "positive"), default="positive", help="of power: P or P+")
parser.add_argument("--seed", type=int, default=0, help="of the estimator's training")
parser.add_argument("--steps", type=int, default=40_000, help="of the estimator's training")
parser.add_argument("--out", type=Path, default=Path("gain_schedule"), help="folder of the entry")
asked = parser.parse_args()
begun = time.monotonic()
torch.set_num_threads(1)  # the same last digits on every machine

settings = Scheduling(
    demonstrations=asked.study,
    currency=asked.currency,
    estimator=asked.steps,
    randomisation={"prices": (0.005, 5.0)},
)
config = study_config(study_settings(study_path("imitation"), "full") | {"name": "imitation"})
gaits = demonstrations(config, settings, asked.results)
estimator = train_estimator(gaits, settings, asked.seed, settings.estimator)
schedule = GainSchedule(gaits=gaits, estimator=estimator)
seconds = read_manifest(asked.results / asked.study)["seconds"] + time.monotonic() - begun
path = write_entry(
    asked.out,
    (schedule.model_dump_json() + "\n").encode(),
    "gain_schedule.json",
    name=f"gain schedule, seed {asked.seed}",
    authors=["snakebench"],
    information="sensors",
    hours=round(seconds / 3600, 3),
)
print(f"{len(gaits)} gaits. Score it: snakebench score {path} --seed dev --quick")
