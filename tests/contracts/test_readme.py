"""The README is true: its Python runs, its commands exist, and CI runs its test command."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


@pytest.mark.parametrize(("example", "last"), [*zip(blocks("python"), ("ok", "True"), strict=True)])
def test_the_python_examples_run(capsys, example, last):
    exec(compile(example, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip().endswith(last)


@pytest.mark.parametrize("line", [line for line in blocks("sh")[-1].splitlines() if "simulate" in line])
def test_the_simulate_examples_run(snakebench_command, line):
    code, out, _ = snakebench_command(*shlex.split(line)[1:], "--duration", "2")
    assert code == 0 and "speed" in out


def test_ci_runs_the_test_command_of_the_readme():
    command = blocks("sh")[1].strip()
    assert command in (ROOT / ".ci" / "run").read_text()


def test_the_layers_in_contributing_are_those_that_are_enforced():
    import tomllib

    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    enforced = " > ".join(contracts[0]["layers"]).replace(" | version", "")
    drawn = re.search(r"```\n(cli >.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), flags=re.DOTALL)
    assert " ".join(drawn[1].split()) == enforced
