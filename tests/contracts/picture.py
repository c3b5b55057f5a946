"""The picture of the modules in CONTRIBUTING, made from their imports; running this file writes it."""

from __future__ import annotations

import re
from pathlib import Path

import grimp

CONTRIBUTING = Path(__file__).parents[2] / "CONTRIBUTING.md"
_BLOCK = re.compile(r"```mermaid\n.*?```\n", re.DOTALL)
# Used by many modules, or a detail of one: not drawn.
_LEFT_OUT = {
    *("errors", "value", "names", "registry", "files", "sources", "memory", "compilation", "version"),
    *(
        "accuracy",
        "bench",
        "cluster",
        "envs",
        "predictor",
        "progress",
        "publication",
        "scenario",
    ),
    "workers",
}


def picture() -> str:
    """A graph in Mermaid: an arrow points from a module to one that imports it, unless a longer way says so already."""
    graph = grimp.build_graph("snakebench")
    drawn = sorted(name for name in graph.find_children("snakebench") if name.partition(".")[2] not in _LEFT_OUT)
    imports = {name: {other for other in drawn if other != name and _imports(graph, name, other)} for name in drawn}
    lines = [
        f"    {other.partition('.')[2]} --> {name.partition('.')[2]}"
        for name, others in imports.items()
        for other in sorted(others)
        if not any(other in _reached(imports, way) for way in others - {other})
    ]
    return "\n".join(["```mermaid", "graph LR", *lines, "```", ""])


def _imports(graph: grimp.ImportGraph, name: str, other: str) -> bool:
    return graph.direct_import_exists(importer=name, imported=other, as_packages=True)


def _reached(imports: dict[str, set[str]], name: str) -> set[str]:
    """All modules that a module needs."""
    return imports[name].union(*(_reached(imports, other) for other in imports[name]))


def with_picture(text: str) -> str:
    """CONTRIBUTING with the picture of today's modules."""
    return _BLOCK.sub(lambda _: picture(), text, count=1)


if __name__ == "__main__":
    CONTRIBUTING.write_text(with_picture(CONTRIBUTING.read_text(encoding="utf-8")), encoding="utf-8")
