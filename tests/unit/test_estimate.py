"""What is said of the time to go is true on average, smooth, and knows of what is not done anew."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

from snakebench.progress import Estimate, Whole, Work, in_words, seconds_kept, time_kept


class Clock:
    """A clock that a test sets [s]."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def run(expected: float, taken: float, steps: int = 200, cached: float = 0.0) -> list[float]:
    """What is said while a work is done, of which a share is in the cache and comes first [s]."""
    clock, said = Clock(), []
    estimate = Estimate(clock)
    estimate.expect("work", {"units": expected})
    for k in range(steps):
        said.append(estimate.seconds())
        found = k < cached * steps
        clock.now += 1e-4 if found else taken / steps
        estimate.reached("work", "units", (k + 1) / steps, found)
    assert estimate.seconds() == 0.0
    return said


def test_what_is_as_long_as_expected_is_said_so_all_the_time():
    said = run(1000.0, 1000.0)
    assert said == pytest.approx([1000.0 * (1 - k / 200) for k in range(200)])


@pytest.mark.parametrize("slower", [0.2, 3.0, 8.0])
def test_a_wrong_expectation_is_corrected_and_smoothly(slower):
    said = run(1000.0, slower * 1000.0)
    assert said[100] == pytest.approx(slower * 500.0, rel=0.5)
    assert all(later < 1.6 * earlier for earlier, later in zip(said, said[1:], strict=False))


@pytest.mark.parametrize("cached", [0.5, 0.95])
def test_what_is_found_in_the_cache_makes_nobody_expect_that_the_rest_comes_as_fast(cached):
    said = run(1000.0, 1000.0, cached=cached)
    assert all(later <= earlier * 1.01 for earlier, later in zip(said, said[1:], strict=False))
    rest = round(cached * 200) + 5
    assert said[rest] == pytest.approx(1000.0 * (1 - rest / 200))


def test_what_earlier_runs_have_left_behind_takes_no_time():
    clock = Clock()
    estimate = Estimate(clock)
    estimate.expect("work", {"units": 100.0, "learning": 1000.0}, {"units": 0.25, "learning": 1.0})
    assert estimate.seconds() == 75.0
    estimate.reached("work", "units", 0.25, found=True)
    assert estimate.seconds() == 75.0
    clock.now += 25.0
    estimate.reached("work", "units", 0.5)
    assert estimate.seconds() == pytest.approx(50.0)
    assert {name: part.share for name, part in estimate.works["work"].items()} == {"units": 0.5, "learning": 1.0}
    assert estimate.share() == pytest.approx(1 - 50 / 1100)


def test_a_part_that_turns_out_longer_keeps_what_is_done_of_it():
    whole = Whole(["work"])
    work = Work("work", 100, whole)
    work.begin(100.0)
    work.reached("units", 0.5, found=True)
    work.expect(100)
    assert (whole.estimate.seconds(), work.shares()) == (150.0, {"units": 0.25})
    work.expect(-180)
    assert whole.estimate.seconds() == 0.0


def test_time_between_works_counts_for_none():
    clock, whole = Clock(), Whole(["one", "two"])
    whole.estimate = estimate = Estimate(clock)
    estimate.expect("one", {"units": 10.0})
    clock.now = 500.0
    with Work("two", 2, whole) as work:
        work.begin(10.0)
        clock.now += 5.0
        work.advance()
        assert estimate.seconds("two") == pytest.approx(5.0)
    assert estimate.seconds() == estimate.seconds("one") == pytest.approx(10.0)


@pytest.mark.parametrize(("seconds", "words"), [(0.2, "1 s"), (100, "100 s"), (300, "5 min"), (7300, "2 h")])
def test_durations_are_said_in_the_largest_unit_of_which_there_are_two(seconds, words):
    assert in_words(seconds) == words


def test_the_time_of_all_runs_is_kept_also_of_a_killed_one(tmp_path):
    path = tmp_path / "seconds.txt"
    assert seconds_kept(path) is None
    code = "import sys, time, pathlib, snakebench.progress as p; p._SECONDS_BETWEEN_LINES = 0.1\n"
    code += "with p.time_kept(pathlib.Path(sys.argv[1])):\n    print(flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        for _ in range(1000):
            if not seconds_kept(path):
                time.sleep(0.05)
        assert seconds_kept(path), "nothing was written while it ran"
        process.kill()
    killed = seconds_kept(path)
    with time_kept(path) as taken:
        time.sleep(0.2)
        assert taken() >= killed + 0.2
    assert killed > 0 and seconds_kept(path) >= killed + 0.2 - 0.05  # a tenth of a second is written
    path.write_text("damaged")
    assert seconds_kept(path) is None
