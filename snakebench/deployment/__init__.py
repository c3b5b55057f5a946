"""Policies for the computer of a robot: one control step as an ONNX model or as a C header."""

from pathlib import Path

from snakebench.deployment.c_header import c_header
from snakebench.deployment.interface import at_preference, description
from snakebench.errors import InvalidValue, missing
from snakebench.files import write_file
from snakebench.policy import Policy


def export_policy(policy: Policy, path: Path, preference: float | None = None) -> None:
    """Write one control step of a policy: an ONNX model (.onnx) or a C header (.h), by the ending of the path.

    Both map the observation that the policy feels, scaled, to target angles [rad], and contain a description of every
    input and output in JSON. A `preference`, the price of power [1/W], is fixed in what is written; without it, the
    price is an input of a preference-conditioned policy.

    Raises:
        InvalidValue: for another ending; for a preference outside the range of the policy's training, or of a policy
            that is not preference-conditioned; when a model is wanted and ONNX is not installed.
        StoreError: when the file cannot be written.
    """
    if path.suffix not in (".onnx", ".h"):
        raise InvalidValue(f"{path} ends in {path.suffix or 'nothing'}: .onnx or .h is needed")
    if preference is not None:
        policy = at_preference(policy, preference)
    text = description(policy, preference)
    if path.suffix == ".h":
        write_file(path, c_header(policy, text))
        return
    try:
        from snakebench.deployment.onnx_model import onnx_model
    except ModuleNotFoundError as error:
        raise missing(str(path), error.name, "onnx") from None
    write_file(path, onnx_model(policy, text))
