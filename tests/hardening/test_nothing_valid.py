"""Where no gait swims validly, a study ends in one line that says what to change."""

from __future__ import annotations

import pandas as pd
import pytest

from snakebench.errors import InvalidValue
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.fronts import means_by_gait, none_valid
from snakebench.studies.running import run_study, study_config

TOO_DENSE = "1e-3,1e12"  # a fluid in which every torque gait diverges [m^2/s, kg/m^3]
SHORT = {"duration": 1.0, "engine": "planar", "physics_rate": 90, "verify_rate": 960}
COUNTS = {"grid": [2, 2, 2], "population": 4, "generations": 2, "seeds": [0]}


def swims(**columns: object) -> pd.DataFrame:
    return pd.DataFrame({"amplitude": [1.0, 2.0], "fluid": "water", "power": None} | columns)


@pytest.mark.parametrize("search", ["grid", "nsga2", "both"])
def test_fronts_of_gaits_that_all_diverge_are_refused_with_what_to_change(tmp_path, search):
    settings = study_settings(study_path("pareto"), "smoke") | SHORT | COUNTS | {"fluids": [TOO_DENSE]}
    with pytest.raises(InvalidValue) as refused:
        run_study(study_config(settings | {"search": search}), tmp_path, 1)
    line = str(refused.value)
    assert line.startswith("pareto-smoke: no gait swam validly and forwards: ") and "diverged of" in line
    assert "other bounds of the gait's parameters, other fluids or a longer duration are needed" in line


def test_a_fluid_without_a_valid_gait_has_no_front_and_the_others_have(tmp_path):
    settings = study_settings(study_path("pareto"), "smoke") | SHORT | COUNTS | {"fluids": ["water", TOO_DENSE]}
    found = pd.read_csv(run_study(study_config(settings), tmp_path, 1) / "fronts.csv")
    assert set(found["front"]) == {"water"}


def test_the_sensitivity_of_fronts_without_a_gait_is_refused_with_what_to_change(tmp_path, write_contenders):
    write_contenders(tmp_path)
    settings = study_settings(study_path("sensitivity"), "smoke") | {"fluids": ["water"], "duration": 1.0}
    studies = {"policies": "", "waveforms": "", "sea_snakes": "", "sinusoids": "pareto"}
    changes = {"contenders": studies, "grid": [2, 2, 2], "spaces": {"wild": {"amplitude": [1e8, 1e9]}}}
    with pytest.raises(InvalidValue, match="sensitivity-smoke: no gait swam validly and forwards"):
        run_study(study_config(settings | changes), tmp_path, 1)


def test_fourier_searches_without_a_valid_gait_say_what_to_change(tmp_path):
    settings = study_settings(study_path("fourier"), "smoke") | {"fluids": [TOO_DENSE], "duration": 0.5}
    with pytest.raises(InvalidValue, match=r"no gait swam validly .*other fluids"):
        run_study(study_config(settings), tmp_path, 1)


def test_what_is_measured_nowhere_is_not_a_number():
    means = means_by_gait(swims(status="diverged", speed=None), ["amplitude"], ["water"])
    assert means.dtypes.eq(float).all() and means.isna().all(axis=None)


def test_the_line_counts_how_the_swims_ended():
    line = str(none_valid("mine", swims(status=["diverged", "invalid"])))
    assert line.startswith("mine: no gait swam validly and forwards: 1 diverged, 1 invalid of 2 swims; ")
