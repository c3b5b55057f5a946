"""The documentation in a real browser: nothing from elsewhere, nothing wider than the screen, formulas drawn."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

pytestmark = [pytest.mark.browser, pytest.mark.slow]  # tox -e docs builds the site and runs them


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    if built := os.environ.get("SNAKEBENCH_SITE"):
        return Path(built)
    pytest.importorskip("furo")
    directory = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", str(ROOT / "docs"), str(directory)]
    done = subprocess.run(command, capture_output=True, text=True)  # Sphinx leaves traces in what it documents
    assert done.returncode == 0, done.stderr
    return directory


def test_every_page_opens_offline_and_fits_the_screen(site, browser):
    page, elsewhere, errors = browser.new_page(viewport={"width": 1200, "height": 800}), [], []
    page.on("request", lambda request: elsewhere.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    pages = [path for path in site.rglob("*.html") if "reports" not in path.parts]
    assert len(pages) > 40
    for path in pages:
        page.goto(path.as_uri())
        for width in (1200, 390):
            page.set_viewport_size({"width": width, "height": 800})
            assert page.evaluate("document.documentElement.scrollWidth") <= width, path
    assert [url for url in elsewhere if not url.startswith(("file:", "data:", "blob:"))] == [] and errors == []
    page.close()


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("gallery", "gain schedule"),
        ("leaderboard", "What parts of"),
        ("how-to/play", "Kinematic viscosity"),
    ],
)
def test_published_pages_are_shown_in_frames_and_have_links(site, browser, name, shown):
    page = browser.new_page()
    page.goto((site / f"{name}.html").as_uri())
    frame = page.frame_locator("iframe.published")
    frame.get_by_text(shown).first.wait_for()
    links = page.locator("article p > a[href*='published/']").evaluate_all("all => all.map(one => one.href)")
    assert links and all(Path(link.removeprefix("file://")).exists() for link in links)
    page.close()


def test_formulas_are_drawn_and_none_is_left_as_text(site, browser):
    page = browser.new_page()
    page.goto((site / "physics.html").as_uri())
    assert page.locator("math").count() > 60
    assert page.evaluate("[...document.querySelectorAll('math')].every(one => one.getBoundingClientRect().height > 5)")
    assert "$" not in page.inner_text("article") and "\\" not in page.inner_text("article")
    page.close()


def test_the_settings_of_every_method_are_there(site, browser):
    from snakebench.studies import METHODS
    from snakebench.studies.running import settings_of

    page = browser.new_page()
    page.goto((site / "api" / "studies.html").as_uri())
    shown = page.inner_text("article")
    for config in map(settings_of, METHODS):
        assert config.__name__ in shown
        assert [name for name in config.model_fields if name not in shown] == []
    page.close()
