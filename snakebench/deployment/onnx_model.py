"""A policy as an ONNX model of one control step."""

from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray

from snakebench.observation import columns
from snakebench.policy import Card, Policy
from snakebench.version import __version__

_MLP = """
    mlp_{k}_sum = MatMul({x}, mlp_{k}_weight)
    mlp_{k}_in = Add(mlp_{k}_sum, mlp_{k}_bias)
    mlp_{k} = Elu(mlp_{k}_in)"""
_LSTM = """
    lstm_{k}_in = Concat<axis = 0>({x}, hidden_{k})
    lstm_{k}_sum = MatMul(lstm_{k}_in, lstm_{k}_weight)
    gates_{k} = Add(lstm_{k}_sum, lstm_{k}_bias)
    input_{k}, forget_{k}, candidate_{k}, output_{k} = Split<axis = 0, num_outputs = 4>(gates_{k})
    take_{k} = Sigmoid(input_{k})
    keep_{k} = Sigmoid(forget_{k})
    show_{k} = Sigmoid(output_{k})
    new_{k} = Tanh(candidate_{k})
    kept_{k} = Mul(keep_{k}, cell_{k})
    taken_{k} = Mul(take_{k}, new_{k})
    next_cell_{k} = Add(kept_{k}, taken_{k})
    shown_{k} = Tanh(next_cell_{k})
    lstm_{k} = Mul(show_{k}, shown_{k})"""
_ACTION = """
    action_sum = MatMul({x}, action_weight)
    action_in = Add(action_sum, action_bias)
    action = Clip(action_in, lowest, highest)"""


def onnx_model(policy: Policy, description: str) -> bytes:
    """The model, with a description in its metadata under `snakebench`.

    It maps `observation`, scaled, to `action`, target angles [rad]. With a memory, it has the LSTM layers' `hidden` and
    `cell` states side by side as further inputs, zeros at first, and `next_hidden` and `next_cell` as further outputs.
    """
    card = policy.card
    bounds = {"lowest": np.array(-1, np.float32), "highest": np.array(1, np.float32)}
    constants: dict[str, NDArray[Any]] = bounds | ({"units": np.array(card.lstm, np.int64)} if card.lstm else {})
    constants |= {name.replace(".", "_"): array.T for name, array in policy.arrays.items()}  # in 1/15 of the time
    model = onnx.parser.parse_model(_graph(card))
    model.graph.initializer.extend(onnx.numpy_helper.from_array(array, name) for name, array in constants.items())
    model.metadata_props.add(key="snakebench", value=description)
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)


def with_description(content: bytes, description: str) -> bytes:
    """A model of any library, with a description in its metadata under `snakebench`."""
    model = onnx.load_model_from_string(content)
    model.metadata_props.add(key="snakebench", value=description)
    return model.SerializeToString(deterministic=True)


def _graph(card: Card) -> str:
    """The model without its numbers, in ONNX's own notation."""
    layers = [(_MLP, f"mlp_{k}", k) for k in range(len(card.mlp))]
    layers += [(_LSTM, f"lstm_{k}", k) for k in range(len(card.lstm))]
    x, body, width, depth = "observation", "", len(columns(card.feels, card.joints)), range(len(card.lstm))
    inputs, outputs = f"float[{width}] observation", f"float[{card.joints}] action"
    for text, name, k in layers:
        body, x = body + text.format(k=k, x=x), name
    body += _ACTION.format(x=x)
    for state, part in (("hidden", "lstm"), ("cell", "next_cell")) if card.lstm else ():
        inputs += f", float[{sum(card.lstm)}] {state}"
        outputs += f", float[{sum(card.lstm)}] next_{state}"
        body = f"\n    {', '.join(f'{state}_{k}' for k in depth)} = Split<axis = 0>({state}, units){body}"
        body += f"\n    next_{state} = Concat<axis = 0>({', '.join(f'{part}_{k}' for k in depth)})"
    version = f'ir_version: 8, opset_import: ["": 18], producer_name: "snakebench", producer_version: "{__version__}"'
    return f"<{version}>\ncontrol_step ({inputs}) => ({outputs}) {{{body}\n}}"
