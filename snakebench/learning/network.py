"""Networks in PyTorch that make one control step: played on many robots, and written as entries."""

import io
import json
import warnings
from collections.abc import Callable, Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from snakebench.deployment.onnx_model import with_description
from snakebench.deployment.onnx_policy import ACTION, OBSERVATION
from snakebench.observation import columns
from snakebench.policy import Card

_OPSET = 17  # of ONNX


def played(
    network: nn.Module, memory: Mapping[str, int], *shape: int
) -> Callable[[NDArray[np.float32]], NDArray[np.float32]]:
    """The network as what acts for robots from rest, step by step: from observations, shape (members, width).

    To the network, observations and memory have the axes `shape` in place of the members' one, such as (candidates,
    fluids) for networks whose weights have an axis for candidates.
    """
    state = [torch.zeros(*shape, size) for size in memory.values()]

    def act(observation: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.no_grad():
            action, *state[:] = network(torch.from_numpy(observation).view(*shape, -1), *state)
        return np.asarray(action.reshape(len(observation), -1).numpy())

    return act


def onnx_entry(network: nn.Module, memory: Mapping[str, int], card: Card) -> bytes:
    """The network as an ONNX model that `snakebench score` takes.

    Args:
        network: from an observation, shape (width,), and each part of the memory, zeros at first, to target angles
            [rad], shape (n_joints,), and each part afterwards. It may take further axes before these.
        memory: size of each part, by name, in the order of the network's arguments.
        card: what it observes, and the robot and rate that it is made for.
    """
    content, sizes = io.BytesIO(), [len(columns(card.feels, card.joints)), *memory.values()]
    names = [OBSERVATION, *memory], [ACTION, *(f"next_{name}" for name in memory)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's successor needs a further package
        torch.onnx.export(
            network.eval(),
            tuple(torch.zeros(size) for size in sizes),
            content,
            input_names=names[0],
            output_names=names[1],
            opset_version=_OPSET,
            dynamo=False,
        )
    return with_description(content.getvalue(), json.dumps({"card": card.model_dump(mode="json")}))
