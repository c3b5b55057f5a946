"""Every name, cell and card of results is text on a page: no script of it runs, and nothing is fetched."""

from __future__ import annotations

import csv
import gzip
import json
import shutil
import struct
import sys
from importlib import import_module
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from writing import list_files, write_manifest

import snakebench as sb
from snakebench.cli.simulate import RunOptions, _page_head
from snakebench.comparison.page import index_files, index_sections
from snakebench.manifest import read_manifest
from snakebench.play.page import play_page
from snakebench.scoring.leaderboard import read_leaderboard
from snakebench.scoring.page import leaderboard_page, score_page
from snakebench.site import write_animation, write_reports

PUBLISHED = Path(__file__).parents[2] / "results"
pytestmark = pytest.mark.browser

TAG = "<img src=x onerror=pwned=1>"
NAME = f"\"'>{TAG}<svg onload=pwned=1>&lt;$x^$|`\x07\u202e"  # may be part of the name of a file
SHORT = f"\"'>{TAG}</td><script>pwned=1</script>"  # the name of an entry
TEXT = f"{NAME}</script></style></title></svg><script>pwned=1</script><iframe src=https://a.example></iframe>{{{{1}}}}"
# What pages select by. All other names are those of fluids, policies, gaits, robots, courses and so on.
KEPT = {
    *("ok", "searched", "finer step", "coarser step", "neutral diameter", "planar", "pybullet", "open", "closed"),
    *("True", "False", "integrated", "simple-sum", "adaptive", "mean", "return", "price", "grid", "nsga2", "both"),
    *("best", "median", "worst", "torque", "angle", "bare loop", "time", "x", "step", "ramp", "sensors"),
    *("paper", "extended", "student", "teacher", "symmetric", "calibration", "fourier"),
    *("sinusoidal-torque", "sea-snake", "default", "slim", "net", "positive", "positive price", "solved", "published"),
    *("policies", "wide", "slow", "held", "continuous", "optimal", "limit", "none"),
}
NAMED = {"courses", "robots", "spaces", "policies", "gaits"}  # tables of a manifest whose keys are names
PER_FLUID = ("speed_water", "speed_oil", "return_water", "return_oil")  # columns that end in a name


def is_kept(text: str) -> bool:
    return not text or text in KEPT or text.replace(" ", "").removeprefix("student").removeprefix("teacher").isdigit()


def name(text: str) -> str:
    """A name made hostile: the same everywhere, so that what belongs together still does."""
    return text if is_kept(text) or _is_number(text) else text + NAME


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def in_file_name(stem: str) -> str:
    """The name of a run, such as replayed-water-oil1."""
    return "-".join(part if part in {"replayed", "own"} else name(part) for part in stem.split("-"))


def hostile_config(content: Any, *, names: bool = False) -> Any:
    """Settings in which every name is hostile; those of bounds are kept, since one is called policies."""
    if isinstance(content, dict):
        return {
            name(key) if names else key: value if key == "bounds" else hostile_config(value, names=key in NAMED)
            for key, value in content.items()
        }
    if isinstance(content, list):
        return [hostile_config(one) for one in content]
    return name(content) if isinstance(content, str) else content


def hostile_text(content: Any) -> Any:
    """Texts that nothing is selected by: all of them hostile."""
    if isinstance(content, dict):
        return {key: hostile_text(value) for key, value in content.items()}
    return content + TEXT if isinstance(content, str) else content


def write_hostile_manifest(directory: Path) -> None:
    """The manifest with every name and text hostile."""
    content = read_manifest(directory)
    config = content["config"]
    fluid = {"kinematic_viscosity": 1e-6, "density": 1000.0}
    hostile = hostile_config(config) | {"method": config["method"], "profile": f"full{TEXT}"}
    hostile |= {"question": f"?{TEXT}"} if "question" in config else {}
    hostile |= {"fluids": [name(one) for one in config["fluids"]]} if "fluids" in config else {}
    told = {key: hostile_text(content[key]) for key in ("commit", "versions", "machine")}
    told |= {"command": f"snakebench{TEXT}", "plugins": {f"plug-in{TEXT}": "digest"}}
    told |= {"fluids": dict.fromkeys(hostile["fluids"], fluid)} if "fluids" in config else {}
    told |= {"parameters": dict.fromkeys(("amplitude", "frequency", "phase"), f"amplitude [{TEXT}]")}
    write_manifest(directory, content | {"config": hostile} | told)


def write_hostile_table(path: Path) -> None:
    """A table with hostile names in its cells and columns, and hostile columns of its own."""
    opened = gzip.open if path.suffix == ".gz" else open
    with opened(path, "rt", newline="", encoding="utf-8") as file:
        head, *rows = csv.reader(file)
    head = [column + NAME if column.startswith(PER_FLUID) else column for column in head]
    with opened(path, "wt", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*head, f"speed_at_7_W{TEXT}", f"own{TEXT}"])
        writer.writerows([*map(name, row), "7", TEXT] for row in rows)


def write_hostile_card(path: Path) -> None:
    """A policy whose card is hostile wherever it is free."""
    content = path.read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    header = json.loads(content[8 : 8 + length])
    card = json.loads(header["__metadata__"]["snakebench"])
    card["origin"] = {f"{key}{TEXT}": hostile_text(value) for key, value in card["origin"].items()} | {"by": TEXT}
    header["__metadata__"]["snakebench"] = json.dumps(card)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + content[8 + length :])


def write_hostile_results(results: Path, *studies: str) -> Path:
    """Published results with everything hostile that is text."""
    for study in studies:
        directory = results / study
        shutil.copytree(PUBLISHED / study, directory)
        write_hostile_manifest(directory)
        for path in directory.glob("*.csv*"):
            write_hostile_table(path)
        for path in directory.glob("trajectories/*.npz"):
            path.rename(path.with_name(f"{in_file_name(path.stem)}.npz"))
        for path in directory.glob("policies/*.safetensors"):
            write_hostile_card(path)
        list_files(directory)
    (results / f"broken{NAME}").mkdir()
    (results / f"broken{NAME}" / "manifest.json").write_text(json.dumps({"format": TEXT}))
    return results


@pytest.fixture
def attacked(browser):
    """Open a page of hostile text: the test fails unless it is shown, as text, and nothing else happens.

    Given places are those where scripts show it.
    """
    happened: list[str] = []

    def open_page(path: Path, *places: str) -> None:
        page = browser.new_page()
        page.on("dialog", lambda dialog: (happened.append(f"dialog {dialog.message}"), dialog.dismiss()))
        page.on("pageerror", lambda error: happened.append(str(error)))
        page.on("console", lambda message: happened.append(message.text) if message.type == "error" else None)
        page.on("request", lambda asked: asked.url in (path.as_uri(), page.url) or happened.append(asked.url))
        page.goto(path.as_uri())
        for place in places:
            page.locator(place, has_text=TAG).wait_for()
        assert page.evaluate("typeof window.pwned") == "undefined"
        foreign = "img, iframe, object, embed, link, base, form, [onload], [onerror], [src], main style:not(svg style)"
        assert page.locator(foreign).count() == 0
        shown = page.evaluate("document.querySelector('main').textContent")
        assert TAG in shown and not {"\x07", "\u202e"} & set(shown), path
        page.close()

    yield open_page
    assert happened == []


def made(results: Path, reports: Path) -> list[Path]:
    """The pages of results, all of which must be made but that of the broken ones."""
    said: list[str] = []
    write_reports(results, reports, say=said.append)
    assert len([line for line in said if line.startswith("left out")]) == 1
    assert all(line.isprintable() for line in said)
    return sorted(reports.glob("*.html"))


@pytest.mark.slow
def test_a_course_a_gait_and_a_workload_that_are_hostile_are_text(attacked, tmp_path):
    results = write_hostile_results(tmp_path / "results", "adaptation", "bench", "sea_snake_front")
    content = read_manifest(results / "sea_snake_front")
    content["config"]["gait"] = f"cpg{TEXT}"
    write_manifest(results / "sea_snake_front", content)
    pages = made(results, tmp_path / "reports")
    assert {"index", "adaptation", "bench", "sea_snake_front"} <= {page.stem for page in pages}
    for page in pages:
        attacked(page)


@pytest.mark.slow
def test_every_name_and_cell_of_every_study_is_text(attacked, tmp_path):
    studies = [path.parent.name for path in PUBLISHED.glob("*/manifest.json")]
    pages = made(write_hostile_results(tmp_path / "results", *studies), tmp_path / "reports")
    assert {"index", *studies} <= {page.stem for page in pages}
    for page in pages:
        attacked(page)
    for path in (tmp_path / "reports").glob("*.svg"):
        ElementTree.parse(path)


@pytest.mark.slow
def test_claims_of_hostile_results_are_text(tmp_path, monkeypatch):
    """In fluids of these names, which claims are about; all other names are hostile."""
    monkeypatch.setattr(sys.modules[__name__], "KEPT", KEPT | {"water", "oil1", "oil2"})
    studies = [path.parent.name for path in PUBLISHED.glob("*/manifest.json")]
    sections = index_sections(write_hostile_results(tmp_path / "results", *studies))
    claims = index_files(sections)["claims.md"]
    assert "<img" not in claims and len({line.count("|") for line in claims.splitlines()}) == 1


def test_the_card_of_a_policy_is_text_on_the_page_where_it_swims(attacked, tmp_path):
    path = tmp_path / "student.safetensors"
    shutil.copy(PUBLISHED / "teacher_student" / "policies" / "student-10.safetensors", path)
    write_hostile_card(path)
    policy = sb.Policy.load(path)
    swim = sb.simulate(policy, duration=2.0)
    write_animation(swim, tmp_path / "swim.html", *_page_head(policy, RunOptions(), sb.measure(swim)))
    attacked(tmp_path / "swim.html")


def test_names_of_policies_and_fluids_are_text_on_the_live_page(attacked, tmp_path, monkeypatch):
    """In one lane swims a policy, in the other a gait of the limit in a fluid: what selects its rows is kept."""
    monkeypatch.setattr(sys.modules[__name__], "KEPT", KEPT | {"net", "policies"})
    results = write_hostile_results(tmp_path / "results", "teacher_student", "limit")
    policies = results / "teacher_student" / "policies"
    (policies / "student-10.safetensors").rename(policies / f"student-0{NAME}.safetensors")
    list_files(results / "teacher_student")
    (tmp_path / "play.html").write_text(play_page(results), encoding="utf-8")
    attacked(tmp_path / "play.html", ".lane[data-lane=A] .about", ".lane[data-lane=B] .about")


def test_the_name_of_an_entry_is_text_in_the_gallery(attacked, tmp_path, monkeypatch):
    shutil.copytree(PUBLISHED.parent / "leaderboard" / "limit", entry := tmp_path / "leaderboard" / "mine")
    card = (entry / "card.toml").read_text()
    (entry / "card.toml").write_text(card.replace('"limit\'s gaits (reference)"', json.dumps(SHORT)))
    monkeypatch.syspath_prepend(PUBLISHED.parent / "docs" / "extensions")
    published = import_module("published")
    monkeypatch.setattr(published, "ROOT", tmp_path)
    (tmp_path / "gallery.html").write_text(published.gallery())
    attacked(tmp_path / "gallery.html")


def test_a_hostile_entry_is_text_on_the_leaderboard_and_on_its_own_page(attacked, tmp_path):
    (mine := tmp_path / "mine").mkdir()
    link = 'https://a.example/"><script>pwned=1</script>'
    authors = [SHORT, NAME, TEXT, "x" * 5000]
    fields = {"name": SHORT, "authors": authors, "information": "open loop", "file": "gait.json", "link": link}
    (mine / "card.toml").write_text("".join(f"{field} = {json.dumps(value)}\n" for field, value in fields.items()))
    score = json.loads((PUBLISHED.parent / "leaderboard" / "sea_snake" / "score.json").read_text()) | {"name": SHORT}
    score["swims"] = [swim | {"setting": TEXT} for swim in score["swims"]]
    (mine / "score.json").write_text(json.dumps(score))
    entries = read_leaderboard(tmp_path)
    for page in leaderboard_page(entries), score_page(entries[0].score, entries):
        (tmp_path / "page.html").write_text(page)
        attacked(tmp_path / "page.html")
