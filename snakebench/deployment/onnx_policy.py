"""A policy in an ONNX model, run by ONNX Runtime: `predict` as models of Stable-Baselines3 have it."""

import json
from collections.abc import Iterator
from itertools import chain
from math import prod
from typing import Any

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray
from onnx.external_data_helper import uses_external_data

from snakebench.errors import InvalidValue
from snakebench.observation import LAYOUT, PREFERENCE, columns
from snakebench.policy import Card

OBSERVATION, ACTION = "observation", "action"
_MOST_MEMORY = 1_000_000  # numbers that a model may keep from step to step
_LOOPS = {"Loop", "Scan", "SequenceMap"}  # operators that may take any number of turns


class OnnxPolicy:
    """One control step: from `observation` to `action` and, with a memory, from each input NAME to `next_NAME`.

    The model's metadata has an object `card` as JSON under `snakebench`, as `export_policy` writes it: what it
    observes (`feels`), and `joints`, `control_rate` or `prices` where they are not as usual. Memory begins with zeros.

    Raises:
        InvalidValue: when it is no model, has loops or no such card, or other inputs and outputs than the card says.
    """

    def __init__(self, content: bytes, label: str) -> None:
        self._content, self._label = content, label
        self._session = _session(content, label)
        self.card = _card(self._session, label)
        given = {one.name: one.shape for one in self._session.get_inputs()}
        made = {one.name: one.shape for one in self._session.get_outputs()}
        width, joints = len(columns(self.card.feels, self.card.joints)), self.card.joints
        self._memory = {name: shape for name, shape in given.items() if name != OBSERVATION}
        wanted = {ACTION: [joints], **{f"next_{name}": shape for name, shape in self._memory.items()}}
        whole = all(isinstance(size, int) for shape in given.values() for size in shape)
        if whole and (most := max(map(prod, self._memory.values()), default=0)) > _MOST_MEMORY:
            raise InvalidValue(f"{label} remembers {most} numbers: at most {_MOST_MEMORY} are allowed")
        if not whole or given.get(OBSERVATION) != [width] or made != wanted:
            raise InvalidValue(
                f"{label} has inputs {given} and outputs {made}: observation [{width}], action [{joints}] and for each"
                " other input NAME an output next_NAME of its shape are needed"
            )

    def predict(
        self, observation: NDArray[np.float32], state: Any = None, **_: Any
    ) -> tuple[NDArray[Any], dict[str, NDArray[Any]]]:
        """Target angles [rad], shape (n_joints,), and the memory afterwards."""
        memory = state or {name: np.zeros(shape, np.float32) for name, shape in self._memory.items()}
        names = [ACTION, *(f"next_{name}" for name in self._memory)]
        try:
            action, *after = self._session.run(names, {OBSERVATION: observation, **memory})
        except Exception as error:  # its exceptions have no other base
            raise InvalidValue(f"{self._label} fails in a control step: {error}") from None
        return action, dict(zip(self._memory, after, strict=True))

    def __reduce__(self) -> tuple[Any, ...]:
        return OnnxPolicy, (self._content, self._label)


def _session(content: bytes, label: str) -> Any:
    """The model, ready to run; one whose control step may never end is refused."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # a sum in another order has other digits
    options.log_severity_level = 4
    options.add_session_config_entry("session.load_model_format", "ONNX")  # as which it is looked at
    try:
        model = onnx.load_model_from_string(content)
        if model.functions:  # which may call each other any number of times
            raise InvalidValue(f"{label} has functions: inline them, by onnx.inliner.inline_local_functions")
        graphs = list(_graphs(model.graph))
        if loops := _LOOPS & {node.op_type for graph in graphs for node in graph.node}:
            raise InvalidValue(f"{label} has {', '.join(sorted(loops))}: a control step without loops is needed")
        if any(map(uses_external_data, chain.from_iterable(map(_tensors, graphs)))):
            raise InvalidValue(f"{label} has numbers in other files: all in one file are needed")
        return onnxruntime.InferenceSession(content, options, ["CPUExecutionProvider"], enable_fallback=0)
    except InvalidValue:
        raise
    except Exception as error:  # its exceptions have no other base
        raise InvalidValue(f"{label} is no ONNX model: {error}") from None


def _graphs(graph: onnx.GraphProto) -> Iterator[onnx.GraphProto]:
    """A graph and those within its nodes."""
    todo = [graph]
    while todo:
        yield (one := todo.pop())
        todo += [inner for node in one.node for part in node.attribute for inner in (part.g, *part.graphs)]


def _tensors(graph: onnx.GraphProto) -> Iterator[onnx.TensorProto]:
    """The constants of a graph, but for those of graphs within it."""
    yield from graph.initializer
    yield from (part for sparse in graph.sparse_initializer for part in (sparse.values, sparse.indices))
    for attribute in (attribute for node in graph.node for attribute in node.attribute):
        yield from (attribute.t, *attribute.tensors)
        for sparse in (attribute.sparse_tensor, *attribute.sparse_tensors):
            yield from (sparse.values, sparse.indices)


def _card(session: Any, label: str) -> Card:
    try:
        found = json.loads(session.get_modelmeta().custom_metadata_map["snakebench"])["card"]
        card = Card(**found)
    except InvalidValue as error:
        raise InvalidValue(f"the card of {label}: {error}") from None
    except (TypeError, ValueError, KeyError, RecursionError):
        raise InvalidValue(f"{label} has no card: its metadata needs an object with a card, as snakebench") from None
    if card.layout not in (LAYOUT, LAYOUT[: -len(PREFERENCE)]):
        raise InvalidValue(f"{label} is made for another layout of the observation: export the policy again")
    return card
