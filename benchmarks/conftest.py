"""Prints, after the benchmarks, steps per second and the ratio to the bare loop of the same run."""

from __future__ import annotations


def pytest_terminal_summary(terminalreporter, config):
    session = getattr(config, "_benchmarksession", None)
    rates = {b.name: b.extra_info["steps"] / b.stats.min for b in getattr(session, "benchmarks", []) if b.extra_info}
    if "test_bare_loop" in rates:
        terminalreporter.section("physics steps per second on one core (best round)")
        for name, rate in rates.items():
            terminalreporter.line(f"{name:24} {rate:10.0f} /s   {rate / rates['test_bare_loop']:.2f} of the bare loop")
