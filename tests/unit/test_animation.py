"""What pages hold of a swim is the swim, to a thousandth."""

from __future__ import annotations

import numpy as np
import pytest

import snakebench as sb
from snakebench.report.animation import packed_rows, swimmer

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"


def unpacked(width: int, steps: int, text: str) -> np.ndarray:
    """As player.js does it."""
    codes, code, weight = [], 0, 1
    for bits in map(LETTERS.index, text):
        code, weight = code + bits % 32 * weight, weight * 32
        if bits < 32:
            codes.append(-(code + 1) // 2 if code % 2 else code // 2)
            code, weight = 0, 1
    return np.cumsum(np.cumsum(np.reshape(codes, (-1, width)), axis=0), axis=0) / steps


@pytest.mark.parametrize("rows", [[[0.0, -0.0]], [[1e6, -1e6], [-1e6, 1e6]], np.linspace(-20, 20, 600).reshape(200, 3)])
def test_rows_are_kept_to_half_a_step(rows):
    rows = np.array(rows)
    assert unpacked(*packed_rows(rows, 1000)) == pytest.approx(rows, abs=0.0005001)


def test_no_rows_are_no_text():
    assert packed_rows(np.empty((0, 7)), 50) == (7, 50, "")


def test_what_diverges_is_drawn_as_far_as_a_page_can():
    assert unpacked(*packed_rows(np.array([[1e300]]), 1000)) == pytest.approx(1e6)


def test_a_swim_takes_little_of_a_page():
    run = sb.simulate(sb.SeaSnake(amplitude=0.9, frequency=0.7, phase=0.7), engine="planar", duration=5.0)
    shown = swimmer("run", run)
    texts = [shown[name][2] for name in ("head", "joints", "torque", "center")]
    assert sum(map(len, texts)) < 1000 * 5.0
    joints = unpacked(*shown["joints"])
    assert joints.shape == (151, 7)
    assert joints == pytest.approx(run.thinned(round(run.rate / 30)).joint_angle, abs=0.0020001)
