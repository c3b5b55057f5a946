"""Trajectories survive the disk, and thinning keeps the times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import snakebench as sb
from snakebench.errors import InvalidValue, StoreError
from snakebench.physics.record import Record


@pytest.fixture(scope="module")
def trajectory():
    return sb.simulate(sb.SeaSnake(amplitude=0.5, frequency=1.0, phase=0.7), duration=1.0)


def test_a_saved_trajectory_loads_as_it_was(trajectory, tmp_path):
    trajectory.save(tmp_path / "run.npz")
    loaded = sb.Trajectory.load(tmp_path / "run.npz")
    assert loaded.robot == trajectory.robot and loaded.rate == trajectory.rate and loaded.drives == "angle"
    assert all(np.array_equal(getattr(loaded, name), getattr(trajectory, name)) for name in Record._fields)


def test_a_published_trajectory_keeps_what_pages_draw(trajectory, tmp_path):
    (tmp_path / "run.npz").write_bytes(trajectory.shown())
    loaded = sb.Trajectory.load(tmp_path / "run.npz")
    assert loaded.robot == trajectory.robot and loaded.rate == trajectory.rate and loaded.drives == "angle"
    drawn = {"head", "joint_angle", "torque", "center"}
    for name in Record._fields:
        kept, whole = getattr(loaded, name), getattr(trajectory, name)
        assert kept.shape == whole.shape and kept.dtype == whole.dtype
        assert (np.abs(kept - whole) <= 2.0**-15).all() if name in drawn else np.isnan(kept).all()
    assert np.abs(loaded.tail_tip - trajectory.tail_tip).max() < 1e-3
    assert loaded.shown() == trajectory.shown()


def test_a_published_trajectory_may_end_in_a_divergence(trajectory, tmp_path):
    head = trajectory.head.copy()
    head[-3:] = [[1e300] * 3, [np.inf] * 3, [np.nan] * 3]
    (tmp_path / "run.npz").write_bytes(replace(trajectory, head=head, diverged=True).shown())
    loaded = sb.Trajectory.load(tmp_path / "run.npz")
    assert loaded.diverged and not np.isfinite(loaded.head[-3:]).any() and np.isfinite(loaded.head[:-3]).all()


def test_equal_trajectories_are_equal_files(trajectory, tmp_path):
    for name in ("one.npz", "two.npz"):
        trajectory.save(tmp_path / name)
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()


def test_thinning_keeps_time_and_state(trajectory):
    thinned = trajectory.thinned(16)
    assert thinned.rate == 30
    assert np.array_equal(thinned.time, trajectory.time[::16])
    assert np.array_equal(thinned.joint_angle, trajectory.joint_angle[::16])


def test_every_array_has_time_first(trajectory):
    assert {len(getattr(trajectory, name)) for name in Record._fields} == {481}
    assert trajectory.links.shape == (481, 8, 5)


@pytest.mark.parametrize("content", [b"", b"not an archive", b"PK\x03\x04"])
def test_what_is_no_trajectory_is_refused(content, tmp_path):
    (tmp_path / "bad.npz").write_bytes(content)
    with pytest.raises(InvalidValue, match="is not a saved trajectory"):
        sb.Trajectory.load(tmp_path / "bad.npz")


def test_a_trajectory_that_cannot_be_written_is_refused(trajectory, tmp_path):
    with pytest.raises(StoreError, match="cannot write"):
        trajectory.save(tmp_path / "missing" / "run.npz")
