"""Generated pages in a real browser: no errors, nothing fetched, and the robot swims."""

from __future__ import annotations

from pathlib import Path

import pytest

import snakebench as sb
from snakebench.names import STUDIES
from snakebench.site import write_animation

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def animation(tmp_path_factory):
    path = tmp_path_factory.mktemp("animation") / "swim.html"
    write_animation(
        sb.simulate(sb.SeaSnake(amplitude=0.9, frequency=0.7, phase=0.7), duration=4.0), path, "sea-snake", "4 s"
    )
    return path


PUBLISHED = sorted({"bench", *STUDIES})
FIGURES = {
    "index": 5,
    "ablations": 5,
    "adaptation": 5,
    "bench": 1,
    "cross": 1,
    "fourier": 3,
    "gain_schedule": 3,
    "imitation": 4,
    "learned_front": 6,
    "limit": 3,
    "memory": 4,
    "operating_point": 3,
    "pareto": 6,
    "relearned": 5,
    "robust": 5,
    "robustness": 19,
    "sea_snake": 5,
    "sea_snake_front": 5,
    "sensitivity": 1,
    "teacher_student": 5,
    "tuning": 2,
    "validation": 3,
}


def test_the_figures_of_every_study_are_counted():
    assert FIGURES.keys() == {"index", "bench", *STUDIES}


@pytest.mark.parametrize("name", ["index", *PUBLISHED])
def test_every_published_page_is_whole(opened, published_reports, name):
    page = opened(published_reports / f"{name}.html", 1200)
    for width in (1200, 390):
        page.set_viewport_size({"width": width, "height": 800})
        assert page.evaluate("document.documentElement.scrollWidth") <= width
    drawn = "[...document.querySelectorAll('svg.figure')].map(one => one.getBoundingClientRect().height)"
    assert all(height > 80 for height in page.evaluate(drawn))
    assert page.locator("figure svg.figure").count() == page.locator("figure a.data").count()
    assert page.locator("svg.figure").count() == FIGURES[name]
    links = page.evaluate("[...document.querySelectorAll('a')].map(one => one.getAttribute('href'))")
    for link in links:
        place, _, anchor = link.partition("#")
        if link.startswith("data:"):
            assert len(link) > 100
        elif place:
            assert (published_reports / place).is_file(), link
        else:
            assert page.locator(f"[id='{anchor}']").count() == 1, link


def test_the_index_shows_everything_and_can_be_used_from_the_keyboard(opened, published_reports):
    page = opened(published_reports / "index.html")
    assert page.locator("table.claims tbody tr").count() >= 15
    assert page.locator("svg.figure").count() == 5
    assert page.locator(".missing").count() == 0
    pictures = "[...document.querySelectorAll('.race canvas')].map(one => one.toDataURL())"
    before = page.evaluate(pictures)
    assert len(before) == 6
    page.locator(".race input.time").focus()
    page.keyboard.press("Home")
    after = page.evaluate(pictures)
    assert all(one != other for one, other in zip(before, after, strict=True))
    reached = set()
    for _ in range(150):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.tagName"))
    assert {"A", "BUTTON", "INPUT", "SUMMARY"} <= reached


def test_the_data_of_a_figure_is_saved_as_plain_csv(opened, published_reports):
    page = opened(published_reports / "index.html")
    with page.expect_download() as saved:
        page.locator("a.data").first.click()
    assert saved.value.suggested_filename.endswith(".csv")
    assert Path(saved.value.path()).read_text().startswith("panel,series,x,y\n")


def test_pages_are_dark_where_it_is_dark(browser, published_reports):
    shades = []
    for scheme in ("light", "dark"):
        page = browser.new_page(color_scheme=scheme)
        page.goto((published_reports / "index.html").as_uri())
        shade = page.evaluate("getComputedStyle(document.querySelector('main')).backgroundColor")
        shades.append(sum(map(int, shade[4:-1].split(","))))
        page.close()
    assert shades[0] > 700 and shades[1] < 150


def test_the_robot_swims_when_played(opened, animation):
    page = opened(animation)
    button, slider = page.locator("button"), page.locator("input[type=range]")
    picture = "document.querySelector('.water').toDataURL()"
    slider.evaluate("element => { element.value = 0; element.dispatchEvent(new Event('input')); }")
    start = page.evaluate(picture)
    button.click()
    assert button.inner_text() == "Pause"
    page.wait_for_function("document.querySelector('input[type=range]').value > 0.2")
    button.click()
    assert button.inner_text() == "Play"
    assert page.evaluate(picture) != start


def test_the_slider_moves_the_robot_and_the_clock(opened, animation):
    page = opened(animation)
    page.locator("input.time").evaluate(
        "element => { element.value = 2.5; element.dispatchEvent(new Event('input')); }"
    )
    assert page.locator(".clock").inner_text() == "2.5 s"


def test_the_drawn_robot_is_as_long_as_the_real_one(opened, animation):
    page = opened(animation)
    page.locator("input[type=range]").evaluate(
        "element => { element.value = 0; element.dispatchEvent(new Event('input')); }"
    )
    dark = """() => { const c = document.querySelector('.water'), {width, height} = c;
      const d = c.getContext('2d').getImageData(0, 0, width, height).data; let low = width, high = 0;
      for (let i = 0; i < d.length; i += 4) if (d[i] < 70 && d[i + 3] > 200) {
        const x = (i / 4) % width; low = Math.min(low, x); high = Math.max(high, x); }
      return (high - low) / width * 2.6; }"""
    assert page.evaluate(dark) == pytest.approx(1.490 + 0.10, abs=0.03)  # the round caps add the diameter


FLUIDS = ("water", "oil1", "oil2")
SWIMS = {
    "sea_snake": [f"{gait} gait in {fluid}" for gait in ("own", "shared") for fluid in FLUIDS],
    "fourier": [f"{gait} gait in {fluid}" for gait in ("own", "one for all") for fluid in FLUIDS],
    "teacher_student": [f"student in {fluid}" for fluid in FLUIDS],
    "learned_front": [f"student in {fluid}" for fluid in FLUIDS],
    "cross": [
        *(f"{who} in {fluid}" for who in ("student", "sinusoid") for fluid in FLUIDS),
        *(f"{gait}'s gait replayed in {fluid}" for gait in FLUIDS for fluid in FLUIDS),
    ],
    "adaptation": [
        f"{course}: {who}" for course in ("step", "ramp", "gradient") for who in ("student", "free waveform")
    ],
}


@pytest.mark.parametrize("name", SWIMS)
def test_every_swim_of_a_page_can_be_chosen(opened, published_reports, name):
    page = opened(published_reports / f"{name}.html")
    assert page.locator("select option").all_inner_texts() == SWIMS[name]
    pictures = set()
    for option in SWIMS[name]:
        page.locator("select").select_option(label=option)
        pictures.add(page.evaluate("document.querySelector('.torques').toDataURL()"))
    assert len(pictures) == len(SWIMS[name])


def test_the_dial_of_the_page_of_learned_fronts_turns(opened, published_reports):
    page = opened(published_reports / "learned_front.html")
    seen = set()
    for fluid in range(3):
        page.locator("select").select_option(index=fluid)
        for position in range(5):
            page.locator(".dial").evaluate(
                f"element => {{ element.value = {position}; element.dispatchEvent(new Event('input')); }}"
            )
            seen.add(page.evaluate("document.querySelector('.torques').toDataURL()"))
    assert len(seen) == 15
    assert page.locator(".position").inner_text() == "3 1/W"
