"""Seconds of ten frames of the live page with two robots: of each frame the physics, policies and pictures of 1/60 s.

Frames follow each other as fast as Chromium makes them; it draws on the processor, as without a graphics card.

    pytest benchmarks/test_play.py
"""

from __future__ import annotations

from pathlib import Path

import pytest
from browser.conftest import CHROMIUM, QUIET
from playwright.sync_api import sync_playwright

from snakebench.play.page import play_page

RESULTS = Path(__file__).parents[1] / "results"
FRAMES, ROUNDS = 10, 30
UNLIMITED = ["--disable-frame-rate-limit", "--disable-gpu-vsync"]
SWIM = """async (frames) => {
  for (let k = 0; k < frames; k++) {
    for (const lane of game.lanes) lane.advance(PLAY.rate / 60, settings);
    draw();
    await new Promise(requestAnimationFrame);
  }
}"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("play") / "play.html"
    path.write_text(play_page(RESULTS), encoding="utf-8")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=[*QUIET, *UNLIMITED])
        page = browser.new_page(viewport={"width": 1200, "height": 1200}, reduced_motion="reduce")
        page.goto(path.as_uri())
        page.wait_for_function("game.lanes.length")
        yield page
        browser.close()


@pytest.mark.skipif(CHROMIUM is None, reason="needs a Chromium on the PATH")
@pytest.mark.parametrize("rival", ["sinusoid", "robust student"])
def test_frames_of_two_lanes(benchmark, page, rival):
    """A student swims in the other lane."""
    page.select_option(".lane[data-lane=B] select >> nth=0", rival)
    benchmark.group = "ten frames of the live page"
    benchmark.pedantic(page.evaluate, (SWIM, FRAMES), rounds=ROUNDS, warmup_rounds=3)
    benchmark.extra_info["frames per second, median"] = FRAMES / benchmark.stats.stats.median
