"""Film the live page for the README: python docs/film_play.py. It needs Playwright, Pillow and a Chromium."""

import io
import shutil
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from snakebench.play.page import play_page

HERE = Path(__file__).parent
WIDTH, HEIGHT, ABOVE, BELOW = 720, 1150, 190, 30  # of the window and of what is kept around the lanes [pixels]
BEFORE, FRAMES, STEP = 4000, 54, 160  # [ms], pictures, [ms]; the fluid changes in the middle
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")

with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
    live, frames = Path(folder) / "play.html", []
    live.write_text(play_page(HERE.parent / "results"), encoding="utf-8")
    browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
    page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    page.clock.install()
    page.goto(live.as_uri())
    page.clock.run_for(BEFORE)
    course, lane = page.locator("#course").bounding_box(), page.locator(".lane").last.bounding_box()
    top, bottom = course["y"] - ABOVE, lane["y"] + lane["height"] - BELOW
    clip = {"x": course["x"], "y": top, "width": course["width"], "height": bottom - top}
    for k in range(FRAMES):
        if k == FRAMES // 2:
            page.get_by_role("button", name="oil2").click()
        page.clock.run_for(STEP)
        frames.append(Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB"))
    browser.close()
settings = {"duration": STEP, "loop": 0, "quality": 30, "method": 4}
frames[0].save(HERE / "play.webp", save_all=True, append_images=frames[1:], **settings)
