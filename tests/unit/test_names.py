"""Names from files: one pattern for all that become a file's name, a column or text."""

from __future__ import annotations

import copy
import unicodedata

import pytest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.studies.config import study_path, study_settings
from snakebench.studies.running import study_config
from snakebench.value import checked_name

HOSTILE = ("../../../other/policies/teacher", "a/b", "a\\b", '"><img src=x>', "", ".", "..", ".hidden", "a b", "a\nb",
    "\x1b[31m", "\u202e", "-a", "x" * 101, "é" * 51)  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_what_cannot_name_a_file_is_no_name(name):
    with pytest.raises(ValueError, match="a name of letters, digits"):
        checked_name(name)


@pytest.mark.parametrize("name", ["water@40", "1e-3,900", "1e+3", "sea_snake", "student-0", "ξ.2", "_"])
def test_names_that_were_always_used_stay_names(name):
    assert checked_name(name) == name


def test_names_that_look_alike_are_alike():
    composed, decomposed = (unicodedata.normalize(form, "ölig") for form in ("NFC", "NFD"))
    assert composed != decomposed
    assert checked_name(decomposed) == composed
    sb.FLUIDS[decomposed] = sb.Fluid(kinematic_viscosity=1e-3)
    try:
        assert sb.FLUIDS[composed] is sb.FLUIDS[decomposed]
        with pytest.raises(InvalidValue, match="there already"):
            sb.FLUIDS[composed] = sb.Fluid(kinematic_viscosity=2e-3)
    finally:
        del sb.FLUIDS[composed]


PLACES = [  # where study files give names: keys of tables, and names of what lies in directories
    ("teacher_student", "policies"),
    ("teacher_student", "policies.student.teacher"),
    ("teacher_student", "shown.0"),
    ("teacher_student", "published.0"),
    ("learned_front", "policies"),
    ("adaptation", "courses"),
    ("adaptation", "shown.0"),
    ("adaptation", "pilots.0"),
    ("adaptation", "contenders.policies"),
    ("cross", "pilots.0"),
    ("cross", "contenders.sinusoids"),
    ("cross", "contenders.gaits.0"),
    ("sensitivity", "robots"),
    ("sensitivity", "spaces"),
    ("pareto", "spaces"),
    ("validation", "gaits"),
    *((study, place) for study in ("pareto", "cross", "fourier") for place in ("name", "profile", "fluids.0")),
]


@pytest.mark.parametrize(("study", "place"), PLACES)
@pytest.mark.parametrize("name", ["../../../other/policies/teacher", '"><img src=x>', "\x1b[31m"])
def test_hostile_names_in_a_study_file_are_refused(study, place, name):
    settings = copy.deepcopy(study_settings(study_path(study)))
    owner, *path = settings, *place.split(".")
    for part, following in zip(path, [*path[1:], None], strict=True):
        if following is None:
            if isinstance(owner, list):
                owner[:1] = [name]
            elif isinstance(owner.get(part), dict):  # a key of the table
                owner[part][name] = next(iter(owner[part].values()))
            else:
                owner[part] = name
        else:
            owner = owner.setdefault(part, [] if following == "0" else {})
    with pytest.raises(InvalidValue, match=r"a name of letters, digits|unknown (policy|fluid)"):
        study_config(settings)


@pytest.mark.parametrize("name", ["index", "bench", "leaderboard", "play"])
def test_a_study_may_not_be_called_like_another_page(name):
    with pytest.raises(InvalidValue, match="another page"):
        study_config(study_settings(study_path("quickstart")) | {"name": name})
