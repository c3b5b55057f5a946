"""What the live page knows: gaits, the limit and policies as they are published."""

from __future__ import annotations

import base64
import re
import shutil
import zlib
from pathlib import Path

import numpy as np
import pytest
from writing import write_manifest

import snakebench as sb
from snakebench.errors import InvalidValue
from snakebench.manifest import read_manifest
from snakebench.play.gaits import families, limit_speeds
from snakebench.play.page import packed, play_page

RESULTS = Path(__file__).parents[2] / "results"


def test_the_limit_is_that_of_the_function():
    viscosities, powers = np.array([1e-7, 1.14e-6, 1e-4, 2.32e-4, 1e-3]), np.array([4.0, 9.0])
    speeds = limit_speeds(RESULTS, viscosities, powers)
    known = [viscosity for viscosity, row in zip(viscosities, speeds, strict=True) if np.isfinite(row).all()]
    assert {1.14e-6, 1e-4, 1e-3} <= set(known)
    for viscosity in known:
        fluid = sb.Fluid(kinematic_viscosity=float(viscosity))
        expected = [sb.limit(fluid, float(power)).speed for power in powers]
        assert speeds[viscosities == viscosity][0] == pytest.approx(expected, rel=1e-6)


def test_without_results_no_limit_is_known(tmp_path):
    assert np.isnan(limit_speeds(tmp_path, np.array([1e-4]), np.array([5.0]))).all()


def test_a_higher_price_of_power_chooses_thriftier_gaits():
    for family in families(RESULTS, np.array([0.01, 0.1, 1.0])):
        for medium in family["media"]:
            powers = [medium["gaits"][k]["power"] for k in medium["best"]]
            assert powers == sorted(powers, reverse=True) and powers[0] > powers[-1]


def test_the_numbers_of_a_policy_survive_to_nineteen_bits():
    policy = sb.Policy.load(RESULTS / "teacher_student" / "policies" / "student-10.safetensors")
    content = packed(policy)
    planes = np.frombuffer(zlib.decompress(base64.b64decode(content["numbers"])), np.uint8)
    numbers = planes.reshape(4, -1).T.copy().view("<f4").ravel()
    assert numbers == pytest.approx(np.concatenate([array.ravel() for array in policy.arrays.values()]), rel=2**-19)
    assert sum(int(np.prod(shape)) for _, shape in content["card"]["arrays"]) == len(numbers)


def test_results_without_gaits_and_policies_are_refused(tmp_path):
    with pytest.raises(InvalidValue, match="holds no gaits and no policies"):
        play_page(tmp_path)


def controllers(results: Path) -> list[str]:
    """The labels of what swims in the page."""
    options = re.findall(r'<option value="([^"]*)"', play_page(results))
    return [label for label in dict.fromkeys(options) if label in ("student", "sea snake")]


def test_studies_of_another_robot_do_not_swim_in_the_page(tmp_path):
    for study in ("teacher_student", "sea_snake_front"):
        shutil.copytree(RESULTS / study, tmp_path / study)
    assert controllers(tmp_path) == ["student", "sea snake"]
    manifest = read_manifest(tmp_path / "teacher_student")
    manifest["config"]["robot"] = sb.Robot(diameter=0.07).model_dump(mode="json")
    write_manifest(tmp_path / "teacher_student", manifest)
    assert controllers(tmp_path) == ["sea snake"]


def test_the_command_writes_the_page_or_refuses(snakebench_command, tmp_path):
    code, _, err = snakebench_command("play", "--results", "nowhere", "--no-open")
    assert code == 2 and err.count("\n") == 1 and "nowhere holds no results" in err
    assert not (tmp_path / "reports").exists()
    code, out, err = snakebench_command("play", "--results", str(RESULTS), "--out", "play.html", "--no-open")
    assert (code, out, err) == (0, "page: play.html\n", "")
    text = (tmp_path / "play.html").read_text(encoding="utf-8")
    assert "://" not in text


def test_without_a_browser_the_command_says_so(snakebench_command, monkeypatch):
    monkeypatch.setattr("snakebench.play.page.play_page", lambda *_: "")
    monkeypatch.setattr("webbrowser.open", lambda _: False)
    answer = snakebench_command("play", "--results", str(RESULTS), "--out", "play.html")
    assert answer == (0, "page: play.html\nno browser was found: open the page yourself\n", "")
