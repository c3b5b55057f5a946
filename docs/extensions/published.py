"""Pages that are made from published results, on the site beside its own: they are shown where a directive asks."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from snakebench.play.page import play_page
from snakebench.report.animation import lane
from snakebench.scoring.entry import read_entry
from snakebench.scoring.leaderboard import read_leaderboard, value_in
from snakebench.scoring.page import leaderboard_page
from snakebench.scoring.tasks import load_tasks
from snakebench.simulation import simulate
from snakebench.site import rendered

FOLDER = "published"
ROOT = Path(__file__).parents[2]
_POWER, _SECONDS = 5.0, 10.0  # of the gallery's swims: P+ [W], as near as it can be, and length


def gallery() -> str:
    """The page on which those entries of the leaderboard swim that can be set to a power, in each fluid."""
    listed = sorted(read_leaderboard(ROOT / "leaderboard"), key=lambda one: -(value_in(one.score, "known") or 0.0))
    listed = [one for one in listed if not one.card.file.endswith(".onnx")]  # which would need another package
    entries = {one.card.name: (read_entry(one.folder / one.card.file), one.score.swims) for one in listed}
    lanes = []
    for fluid in load_tasks("v1").fluids:
        for name, (entry, swims) in entries.items():
            settings = {one.label: one.controller for one in entry.told(fluid)}
            chosen = [swim for swim in swims if (swim.where, swim.target) == (fluid, _POWER)]
            for swim in chosen if len(settings) > 1 else []:
                trajectory = simulate(settings[swim.setting], fluid, engine="planar", duration=_SECONDS)
                lanes.append(lane(f"{name}, {swim.positive_power:.1f} W", fluid, trajectory, _SECONDS))
    return rendered("gallery.html", {"lanes": lanes})


PAGES: dict[str, Callable[[], str]] = {
    "gallery.html": gallery,
    "leaderboard.html": lambda: leaderboard_page(read_leaderboard(ROOT / "leaderboard")),
    "play.html": lambda: play_page(ROOT / "results"),
}


class PublishedPage(Directive):
    """A page in a frame, and a link to it alone; `reports/index.html` and the other reports as a link only."""

    required_arguments = 2
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        """The frame and the link."""
        name, title = self.arguments
        here = self.state.document.settings.env.docname
        address = "../" * here.count("/") + f"{FOLDER}/{name}"
        frame = f'<iframe class="published" src="{address}" title="{title}" loading="lazy"></iframe>'
        link = f'<p><a href="{address}">{title}</a></p>'
        return [nodes.raw("", link + (frame if name in PAGES else ""), format="html")]


def write_pages(app: Sphinx, exception: Exception | None) -> None:
    """Write the pages, and copy the reports, when the site is built."""
    if exception or app.builder.format != "html":
        return
    folder = Path(app.outdir) / FOLDER
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "reports", folder / "reports")
    for name, make in PAGES.items():
        (folder / name).write_text(make(), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the directive, and the pages at the end."""
    app.add_directive("published", PublishedPage)
    app.connect("build-finished", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
