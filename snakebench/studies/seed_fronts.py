"""The fronts of each seed of a search for free waveforms, for comparisons with policies of several seeds.

The study publishes the best of all its seeds. A mean over trainings is compared with the mean over searches instead.
"""

import pandas as pd

from snakebench.report.table import name_of
from snakebench.studies import fronts
from snakebench.studies.columns import WAVEFORM
from snakebench.studies.published import Published
from snakebench.studies.search_settings import FrontSettings


def of_each_seed(study: Published) -> Published:
    """The study with the fronts, ideal switching and indicators of each seed, with columns method and seed.

    They are made of the optimum of every search; a study of other gaits is returned as it is.
    """
    optima = study.tables.get("optima")
    if study.config["method"] != "fourier" or optima is None or optima.empty:
        return study
    known = {name: study.config[name] for name in FrontSettings.model_fields if name in study.config}
    settings = FrontSettings.model_construct(**known | {"robot": study.robot})  # checked when the study ran
    by_seed = {seed: fronts.beside_searched(part, "searched") for seed, part in optima.groupby("seed")}
    parts = {
        seed: fronts.front_tables(settings, fronts.fronts_of(settings, {"fourier": swims}, list(WAVEFORM)))
        for seed, swims in by_seed.items()
    }
    tables = {}
    for name in ("fronts", "switching", "indicators"):
        made = {seed: part[name] for seed, part in parts.items() if name in part}
        of_seeds = [table.assign(method=name_of("fourier"), seed=seed) for seed, table in made.items()]
        tables[name] = pd.concat(of_seeds, ignore_index=True) if of_seeds else study.tables[name][:0]
    return study._replace(tables=study.tables | tables)
