"""A Chromium for the tests of pages; where there is none they are skipped, unless one is required."""

from __future__ import annotations

import os
import shutil

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
REQUIRED = "SNAKEBENCH_BROWSER" in os.environ  # as in CI, where these tests may not be skipped
LOCAL = ("file:", "data:", "blob:")
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update"]


@pytest.fixture(scope="module", autouse=True)
def _chromium():
    if CHROMIUM is None and not REQUIRED:
        pytest.skip("needs a Chromium on the PATH")


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        yield browser
        browser.close()


@pytest.fixture
def opened(browser):
    """Open a file at a width in pixels; fails the test if the page reports an error or asks for anything else.

    Further settings are those of a browser's context, such as a phone's.
    """
    complaints: list[str] = []
    pages = []

    def open_page(path, width=1200, **settings):
        page = browser.new_page(viewport={"width": width, "height": 800}, **settings)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
        page.on("request", lambda asked: None if asked.url.startswith(LOCAL) else complaints.append(asked.url))
        page.goto(path.as_uri())
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        page.close()
    assert complaints == []
