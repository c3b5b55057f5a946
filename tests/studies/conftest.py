"""What tests of the studies that compare share: the study of a module's `config()`, run once beside what was found."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="module")
def run(request, tmp_path_factory, write_contenders, run_counted):
    config = request.module.config()
    return run_counted(config, write_contenders(tmp_path_factory.mktemp(config.name)))


@pytest.fixture(scope="module")
def results(run):
    """Where its results are."""
    return run[0]


@pytest.fixture(scope="module")
def counted(run):
    """What was done and expected, whenever something was done."""
    return run[1]
