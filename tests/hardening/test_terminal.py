"""Whatever files hold, a terminal is told short lines of visible text: it obeys nothing that came from a file."""

from __future__ import annotations

import io
import json
import os
import shutil
import struct
import subprocess
import sys
import tomllib
import unicodedata
from pathlib import Path

import onnx
import pandas as pd
import pytest
from rich.console import Console
from writing import random_policy, write_manifest

from snakebench import progress
from snakebench.cli.printing import print_rows, print_table, say
from snakebench.deployment import export_policy
from snakebench.errors import InvalidValue, SnakebenchError, UnknownName, printable
from snakebench.policy import Card
from snakebench.tables import read_table

PUBLISHED = Path(__file__).parents[2] / "results"
HOSTILE = {
    "a command": "\x1b]0;pwned\x07\x1b[2J",
    "a turn": "\u202eexe.txt\u2066\u200b",
    "a return": "good\rbad\x85\u2028worse\n\nworst",
    "a long line": "x" * 100_000,
    "a long line of commands": "\x1b" * 100_000,
}
LONGEST = 2200  # characters of a line: a message, and what is said before it
SWIM = ("--duration", "0.1", "--engine", "pybullet")
IN_FILES = {
    "signs": "".join(text for text in HOSTILE.values() if len(text) < 100),
    "a long line": HOSTILE["a long line of commands"],
}
each_text = pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
each_file = pytest.mark.parametrize("text", IN_FILES.values(), ids=IN_FILES)


def check(*printed: str) -> None:
    """Fail unless lines are short and visible."""
    lines = [line for text in printed for line in text.split("\n")]
    assert any(lines)
    assert max(map(len, lines)) <= LONGEST
    assert [one for one in "".join(lines) if not one.isprintable() and unicodedata.category(one) != "Zs"] == []


def toml(text: str) -> str:
    """A TOML string, or a quoted key."""
    return json.dumps(text)


@each_text
def test_text_is_printable_in_one_short_line(text):
    check(printable(text))
    assert len(printable(text, 50)) <= 50 and "\n" not in printable(text)
    assert printable(printable(text)) == printable(text)


@pytest.mark.parametrize("text", ["", "a b", "ν = 1e-6 m²/s · 5\u00a0%", "☃ 蜂蜜 é", "[bold]", "\\x1b"])
def test_text_that_can_be_seen_is_printed_as_it_is(text):
    assert printable(text) == text


def test_what_cannot_be_seen_is_written_as_an_escape():
    assert printable("\x1b[2J\u202e\ud800") == r"\x1b[2J\u202e\ud800"


def test_of_long_text_both_ends_are_printed():
    assert printable("a" * 1000 + "b" * 1000, 13) == "aaaaa … bbbbb"


@each_text
@pytest.mark.parametrize("raised", [SnakebenchError, InvalidValue, lambda text: UnknownName.among("it", text, [text])])
def test_an_error_is_printable_however_it_is_made(text, raised):
    check(str(raised(text)))


@each_text
def test_a_table_is_printable(capsys, text):
    print_rows([text, "b"], [[text, "1"], ["a", text]])
    print_table({text: 1.0, "b": text}, {text: text, "b": None})
    say(text, text)
    check(capsys.readouterr().out)


@pytest.mark.parametrize("terminal", [True, False])
@each_text
def test_progress_is_printable_and_no_markup(monkeypatch, text, terminal):
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=terminal, width=10_000, color_system=None, legacy_windows=False)
    monkeypatch.setattr(progress, "_CONSOLE", console)
    with progress.Whole(["a"]) as whole, progress.Work("a", 1) as work:
        whole.say(f"[red]{text}")
        work.say(f"[bold]{text}[/bold]")
        work.advance()
    shown = screen.getvalue()
    assert "[red]" in shown and "[/bold]" in shown
    assert text not in shown


def test_the_name_of_a_work_is_no_markup(monkeypatch):
    screen = io.StringIO()
    monkeypatch.setattr(progress, "_CONSOLE", Console(file=screen, force_terminal=True, width=200, color_system=None))
    with progress.Work("[red]a\x1b]0;pwned", 1):
        pass
    assert r"[red]a\x1b]0;pwned" in screen.getvalue()


STUDIES = {
    "a key": lambda text: ("", f"{toml(text)} = 1"),
    "a profile": lambda text: (f"[profiles.{toml(text)}]\nseeds = 1\n", f"profile = {toml(text)}"),
    "an unknown profile": lambda text: (f"[profiles.{toml(text)}]\n", 'profile = "none"'),
    "a fluid": lambda text: ("", f"fluids = [{toml(text)}]"),
    "a method": lambda text: ("", f"method = {toml(text)}"),
    "a course": lambda text: (f"[courses.{toml(text)}]\nalong = 1\n", 'method = "adaptation"'),
    "a robot": lambda text: ("", f"robot = {toml(text)}"),
    "no TOML": lambda text: ("", text),
}


@each_file
@pytest.mark.parametrize("where", STUDIES)
def test_a_study_file_is_refused_printably(snakebench_command, tmp_path, text, where):
    tables, line = STUDIES[where](text)
    settings = {"question": '"?"', "method": '"sea_snake"', "fluids": '["water"]', "trials": "4", "seeds": "[0]"}
    settings.pop(line.partition(" = ")[0], None)
    lines = [f"{key} = {value}" for key, value in settings.items()]
    (tmp_path / "mine.toml").write_text("\n".join([*lines, line, tables]))
    code, out, err = snakebench_command("run-study", "mine.toml", "--workers", "1")
    assert code == 2
    check(out, err)


@each_file
@pytest.mark.parametrize("where", ["kind", "field", "value", "all"])
def test_a_gait_file_is_refused_printably(snakebench_command, tmp_path, text, where):
    gait = {"kind": "sea-snake", "amplitude": 0.5, "frequency": 1.0, "phase": 0.7}
    changed = {"kind": {"kind": text}, "field": {text: 1}, "value": {"amplitude": text}, "all": {}}[where]
    (tmp_path / "gait.json").write_text(text if where == "all" else json.dumps(gait | changed))
    code, out, err = snakebench_command("simulate", "file", "gait.json", *SWIM)
    assert code == 2
    check(out, err)


def hostile(card: dict, text: str, where: str) -> dict:
    """The card of a policy, changed in one place."""
    changes = {"layout": {"layout": [text]}, "feels": {"feels": [text]}, "field": {text: 1}}
    return card | changes.get(where, {"origin": {text: text}})


@each_file
@pytest.mark.parametrize("where", ["layout", "feels", "field", "origin", "header"])
def test_a_policy_is_refused_or_swims_printably(snakebench_command, tmp_path, text, where):
    content = (PUBLISHED / "teacher_student" / "policies" / "student-10.safetensors").read_bytes()
    (length,) = struct.unpack("<Q", content[:8])
    header = json.loads(content[8 : 8 + length])
    card = hostile(json.loads(header["__metadata__"]["snakebench"]), text, where)
    header["__metadata__"]["snakebench"] = text if where == "header" else json.dumps(card)
    told = json.dumps(header).encode()
    (tmp_path / "policy.safetensors").write_bytes(struct.pack("<Q", len(told)) + told + content[8 + length :])
    words = ("--path", "policy.safetensors", "--animate", "swim.html", *SWIM)
    code, out, err = snakebench_command("simulate", "policy", *words)
    assert code == (0 if where == "origin" else 2)
    check(out, err)


@each_file
@pytest.mark.parametrize(
    "where", ["layout", "feels", "field", "metadata", "an input", pytest.param("origin", marks=pytest.mark.slow)]
)
def test_a_model_is_refused_or_scored_printably(snakebench_command, tmp_path, text, where):
    path = tmp_path / "policy.onnx"
    export_policy(random_policy(Card(mlp=(4,), lstm=(3,))), path)
    model = onnx.load(path)
    (told,) = (one for one in model.metadata_props if one.key == "snakebench")
    content = json.loads(told.value)
    told.value = text if where == "metadata" else json.dumps({"card": hostile(content["card"], text, where)})
    if where == "an input":
        model.graph.input[-1].name = text
    path.write_bytes(model.SerializeToString())
    code, out, err = snakebench_command("score", "policy.onnx", "--quick", "--task", "known", "--workers", "1")
    assert code == (0 if where == "origin" else 2)
    check(out, err)


ENTRIES = {  # fields of a card and of a score
    "all text": lambda text: (
        {"name": text[:80], "authors": [text], "made_by": text},
        {"name": text, "tasks": text, "engine": text, "versions": {text: text}},
    ),
    "a key of a card": lambda text: ({text: 1}, {}),
    "a name": lambda text: ({"name": text * 2}, {}),
    "a link": lambda text: ({"link": text}, {}),
    "a key of a score": lambda text: ({}, {text: 1}),
    "a task": lambda text: ({}, {"scores": {text: text}}),
    "a swim": lambda text: ({}, {"swims": [{text: text}]}),
}


@each_file
@pytest.mark.parametrize("where", [*ENTRIES, "no TOML", "no JSON"])
def test_an_entry_is_listed_or_refused_printably(snakebench_command, tmp_path, text, where):
    original, mine = PUBLISHED.with_name("leaderboard") / "sea_snake", tmp_path / "leaderboard" / "mine"
    mine.mkdir(parents=True)
    own, found = ENTRIES.get(where, lambda _: ({}, {}))(text)
    card = tomllib.loads((original / "card.toml").read_text()) | own
    lines = "\n".join(f"{toml(key)} = {json.dumps(value)}" for key, value in card.items())
    score = json.dumps(json.loads((original / "score.json").read_text()) | found)
    (mine / "card.toml").write_text(text if where == "no TOML" else lines)
    (mine / "score.json").write_text(text if where == "no JSON" else score)
    shutil.copy(original / "gait.json", tmp_path)
    listed = where == "all text"
    for words in (("leaderboard",), *([] if listed else [("score", "gait.json")])):
        code, out, err = snakebench_command(*words)
        assert code == (0 if listed else 2)
        check(out, err)


@each_file
@pytest.mark.parametrize("where", ["a column", "another column", "a cell", "a name"])
def test_a_log_is_refused_printably(snakebench_command, tmp_path, text, where):
    log = pd.DataFrame({"time": [0.0, 0.1, 0.2], "angle_1": 0.0, "gyro_1": 0.0, "target_1": 0.0})
    log = log.rename(columns={"target_1": text}) if where == "a column" else log
    log = log.assign(**{text: 1.0}) if where == "another column" else log
    log = log.assign(angle_1=text) if where == "a cell" else log
    log.to_csv(tmp_path / "log.csv", index=False)
    code, out, err = snakebench_command("identify", text if where == "a name" else "log.csv")
    assert code == 2
    check(out, err)


@each_file
@pytest.mark.parametrize("where", ["format", "study", "method", "command", "cell", "column", "no JSON"])
def test_results_are_reported_printably(snakebench_command, tmp_path, text, where):
    bench = tmp_path / "results" / "bench"
    shutil.copytree(PUBLISHED / "bench", bench)
    manifest = json.loads((bench / "manifest.json").read_text())
    del manifest["files"]
    manifest |= {where: text} if where in {"format", "study", "command"} else {}
    manifest |= {"config": {"method": text}} if where == "method" else {}
    table = read_table(bench / "bench.csv")
    table = table.replace({"engine": {"pybullet": text}}) if where == "cell" else table
    table = table.rename(columns={"engine": text}) if where == "column" else table
    table.to_csv(bench / "bench.csv", index=False)
    write_manifest(bench, manifest)
    if where == "no JSON":
        (bench / "manifest.json").write_text(text)
    code, out, err = snakebench_command("report")
    assert code == 0 and ("left out" in out) == (where not in ("command", "study"))
    check(out, err)


PLUG_IN = """
import snakebench as sb
text = {text!r}
class Mine(sb.SeaSnake):
    pass
def bend(trajectory):
    return 1.0
Mine.__doc__ = bend.__doc__ = text
sb.METRICS["bend"] = bend
sb.SAMPLERS["mine"] = lambda *_: None
sb.SAMPLERS["mine"].__doc__ = text
"""
RAISING = "raise RuntimeError({text!r})"
WARNING = "import warnings; warnings.warn({text!r})"  # as libraries do that quote a file


@pytest.mark.parametrize("code", [PLUG_IN, RAISING, WARNING], ids=["a description", "an error", "a warning"])
def test_a_plug_in_is_listed_or_refused_printably(tmp_path, code):
    (tmp_path / "mine.py").write_text(code.format(text="".join(IN_FILES.values())))
    environment = os.environ | {"SNAKEBENCH_PLUGINS": "mine.py"}
    command = [sys.executable, "-m", "snakebench.cli", "list"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    check(done.stdout, done.stderr)
