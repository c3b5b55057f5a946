"""Time of one control step of a policy on a robot's computer, with one thread: exported as a C header and as ONNX.

pytest benchmarks/test_deployment.py
"""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import onnxruntime
import pytest

from snakebench.deployment import export_policy
from snakebench.policy import Card, Policy

STEPS = 3000
LIMIT = 1e-3  # of a step [s]
MAIN = f"""
#include <stdio.h>
#include "policy.h"

int main(void)
{{
    static struct snake_memory memory;
    float observation[SNAKE_INPUTS] = {{0}}, action[SNAKE_JOINTS];
    for (int k = 0; k < {STEPS}; k++) {{
        observation[k % SNAKE_INPUTS] = (float)(k % 7) - 3.0f;
        snake_step(observation, &memory, action);
    }}
    printf("%g", action[0]);
    return 0;
}}
"""


@pytest.fixture(scope="module")
def policy():
    rng, card = np.random.default_rng(0), Card()  # of the usual size
    arrays = {name: rng.normal(size=shape) / np.sqrt(shape[-1]) for name, shape in card.shapes().items()}
    return Policy(card, {name: array.astype(np.float32) for name, array in arrays.items()})


def measured(benchmark, run):
    benchmark.group, benchmark.extra_info["steps"] = "control steps of an exported policy", STEPS
    benchmark.pedantic(run, rounds=10, warmup_rounds=1)
    assert benchmark.stats.stats.median / STEPS < LIMIT


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) on the PATH")
@pytest.mark.parametrize("optimised", ["-O2", "-O3"])
def test_c_header(benchmark, policy, optimised, tmp_path):
    export_policy(policy, tmp_path / "policy.h")
    (tmp_path / "main.c").write_text(MAIN)
    subprocess.run(["cc", "-std=c99", optimised, tmp_path / "main.c", "-o", tmp_path / "main", "-lm"], check=True)
    measured(benchmark, lambda: subprocess.run([tmp_path / "main"], capture_output=True, check=True))


def test_onnx_model(benchmark, policy, tmp_path):
    export_policy(policy, tmp_path / "policy.onnx")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(tmp_path / "policy.onnx", options)
    observation = np.random.default_rng(1).normal(size=31).astype(np.float32)

    def run():
        hidden = cell = np.zeros(256, np.float32)
        for _ in range(STEPS):
            _, hidden, cell = session.run(None, {"observation": observation, "hidden": hidden, "cell": cell})

    measured(benchmark, run)
