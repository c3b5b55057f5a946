"""Prints after the benchmarks steps per second, their ratio to what they are compared with, and all else."""

from __future__ import annotations

from itertools import groupby


def pytest_terminal_summary(terminalreporter, config):
    session = getattr(config, "_benchmarksession", None)
    stepped = [b for b in getattr(session, "benchmarks", []) if "steps" in b.extra_info]
    rates = {b.name: b.extra_info["steps"] / b.stats.min for b in stepped}
    for group, members in groupby(stepped, key=lambda b: b.group):
        terminalreporter.section(f"{group}: per second (best round)")
        for b in members:
            base = b.extra_info.get("base", "test_bare_loop")
            ratio = f"   {rates[b.name] / rates[base]:.2f} of {base}" if base in rates else ""
            terminalreporter.line(f"{b.name:60} {rates[b.name]:10.0f} /s{ratio}")
    told = [(b.name, what) for b in getattr(session, "benchmarks", []) for what in b.extra_info.items()]
    for name, (what, value) in told:
        if what not in {"steps", "base"}:
            terminalreporter.line(f"{name:60} {value:10.0f} {what}")
