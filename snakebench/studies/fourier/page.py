"""The page of the Fourier study: tables and figures of the optima of the free waveform and of their fronts."""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from snakebench.controllers import Fourier
from snakebench.names import FINE, INTEGRATED
from snakebench.report import table
from snakebench.report.accuracy import step_changes, step_table
from snakebench.report.equal_power import fastest_within
from snakebench.report.table import COSTS, MEASURED, POWERS, Table, by_variant, summary, under_labels
from snakebench.studies.fourier import figures
from snakebench.studies.front_tables import equal_power_table, front_table
from snakebench.studies.published import Published, best_of_seeds
from snakebench.tables import fourier_gait

_GOAL = ["tuned_to", "harmonics", "objective", "price"]
_SEARCH = [*_GOAL, "seed", "value"]


def page(study: Published) -> dict[str, Any]:
    """What the page shows; the sea-snake study's optima stand beside the results."""
    optima, growth = study.tables["optima"], study.tables["growth"]
    found = _means(optima, study.weight)
    fine, swims = (every[every["variant"] == FINE] for every in (found, optima))
    highest_of_each = _best(fine[fine["objective"] == "return"], ["tuned_to", "harmonics"])
    highest = _best(highest_of_each, ["tuned_to"])
    shown = {row["tuned_to"]: gait_of(study.tables["gaits"], row) for row in highest.to_dict("records")}
    sea_snake, worth = _sea_snake(study), study.tables["indicators"]
    of_best = found[found["variant"] != "searched"].merge(highest_of_each[_SEARCH])
    by, returns = ["tuned_to", "harmonics"], fine[fine["objective"] == "return"]
    gains = returns.groupby(by)["return"].mean().groupby("tuned_to").pct_change().rename("gain").reset_index()
    of_seeds = [("n seeds", table.size), *table.over_seeds("return", "J of each seed")]
    return {
        "findings": {"highest": highest, "harmonics": gains, "rivals": _rivals(fine, sea_snake)},
        "swimmers": study.swimmers(
            {
                fluid if tuned_to == fluid else f"{tuned_to}-{fluid}": f"{whose} gait in {fluid}"
                for tuned_to, fluid in zip(optima["tuned_to"], optima["fluid"], strict=True)
                for whose in ["own" if tuned_to == fluid else "one for all"]
            }
        ),
        "fronts": figures.fronts(fine[fine["valid"]], sea_snake),
        "stars": len(sea_snake),
        "front_table": front_table(worth),
        "equal_power": equal_power_table(worth),
        "seeds": summary(returns.dropna(subset="return"), by, of_seeds, head="tuned to, harmonics"),
        "best": _gaits(of_best),
        "convergence": figures.growth(growth[growth["objective"] == "return"]),
        "waveforms": figures.waveforms(shown),
        "agreement": _agreement(study),
        "n_optima": len(fine),
        **table.validity(swims),
    }


def gait_of(gaits: pd.DataFrame, search: Mapping[Any, Any]) -> Fourier:
    """The gait that a search found, from the study's table of gaits and a row that names the search."""
    return fourier_gait(gaits.merge(pd.DataFrame([search])[[*_GOAL, "seed"]]))


def _means(optima: pd.DataFrame, weight: float) -> pd.DataFrame:
    """The means over its fluids of each search's swims in a variant, undefined unless all are valid; weight in [N]."""
    by_search = optima.assign(valid=optima["status"] == "ok").groupby([*_SEARCH, "variant"], sort=False, dropna=False)
    every = by_search[["valid", "steady"]].all()
    means = by_search.mean(numeric_only=True).where(every["valid"]).assign(**every)
    costs = {cost: means[power] / (weight * means["speed"]) for cost, power in zip(COSTS, POWERS, strict=True)}
    return means.assign(**costs).reset_index()


def _best(searches: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """The best search of each group, judged as searched; the first of equals."""
    ranked = searches.sort_values("value", ascending=False, kind="stable")
    return ranked.groupby(by, dropna=False).head(1).sort_index()


def _sea_snake(study: Published) -> pd.DataFrame:
    """The best sea-snake gait of each fluid, and of the same fluids at once, with the finer step, if there are any."""
    other, fluids = study.beside("sea_snake"), study.config["fluids"]
    if other is None:
        return pd.DataFrame(columns=["tuned_to", "speed", *POWERS])
    optima = best_of_seeds(other.tables["optima"])
    fine = optima[(optima["variant"] == FINE) & optima["fluid"].isin(fluids)]
    same_fluids = set(other.config["fluids"]) == set(fluids)
    shared = fine[(fine["objective"] == "mean") & same_fluids].assign(objective=INTEGRATED)
    found = pd.concat([fine[fine["objective"] == fine["fluid"]], shared])
    return found.groupby("objective", sort=False)[["speed", *POWERS]].mean().rename_axis("tuned_to").reset_index()


def _rivals(fine: pd.DataFrame, sea_snake: pd.DataFrame) -> pd.DataFrame:
    """The free waveforms' front at the power of each sea-snake gait, whose columns end on _sea_snake."""
    rivals = [fine.iloc[:0]]
    for gait in sea_snake.to_dict("records"):
        best = fastest_within(fine[fine["tuned_to"] == gait["tuned_to"]], gait["power"])
        rivals.append(best.assign(speed_sea_snake=gait["speed"], power_sea_snake=gait["power"]))
    return pd.concat(rivals[1:] or rivals, ignore_index=True)


def _gaits(found: pd.DataFrame) -> Table:
    """Gaits with the finer step, and the difference to the coarser one, by what they are tuned to and harmonics."""
    by = {"tuned_to": list(found["tuned_to"].unique()), "harmonics": sorted(found["harmonics"].unique())}
    columns = under_labels(by_variant, ("return", *MEASURED)) + under_labels(table.digits3, ["swim_frequency"])
    return summary(found, by, [*columns, ("steady", table.yes_or_no("steady"))], head="tuned to, harmonics")


def _agreement(study: Published) -> Table:
    """How far PyBullet is from its own limit and from the planar engine, where all three swims are valid."""
    optima = study.tables["optima"].fillna({"price": 0.0})  # of those that no price is for
    valid = (optima["status"] == "ok").groupby([optima[name] for name in (*_SEARCH, "fluid")]).transform("all")
    planar = study.config["engine"] == "planar"
    variants = optima[valid].replace({"variant": {"searched": "planar"}} if planar else {})
    changes = step_changes(variants, [*_SEARCH, "fluid"], {"speed": "v", "power": "P"})
    return step_table(changes, {"fluid": optima["fluid"].unique()})
