"""The score of an entry as a value and as a file: its swims, and their means."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field
from scipy import stats

from snakebench.errors import StoreError
from snakebench.files import readable_file
from snakebench.scoring.swims import Swim
from snakebench.scoring.tasks import TASKS
from snakebench.value import FloatArray, Value

Information = Literal["open loop", "sensors", "privileged"]
FORMAT = 1  # of the file
_DIGITS = 9  # of what is computed of several swims


class TaskScore(Value):
    """The score in a task: means over its swims, None where the entry cannot swim it."""

    score: float | None = Field(description="at P+")
    net_score: float | None = Field(description="at P")
    half_width: float | None = Field(description="half the 95 % interval over the draws; None where nothing is drawn")
    swims: int


class Score(Value):
    """The score of an entry; `total` is the mean of the four tasks, None unless it has swum all of them."""

    format: int = FORMAT
    tasks: str = Field(description="version of the tasks")
    content: str = Field(description="SHA-256 of the tasks and of the table of the limit")
    name: str
    entry: str = Field(description="SHA-256 of the file, or of a controller without a file")
    information: Information
    seed: str = Field(description="of the draws: the entry's digest, or dev")
    engine: str
    physics: str = Field(description="fingerprint of the engine")
    total: float | None = Field(description="at P+")
    net_total: float | None = Field(description="at P")
    half_width: float | None = Field(description="half the 95 % interval of the total over the draws")
    scores: dict[str, TaskScore] = Field(description="by task")
    swims: tuple[Swim, ...]
    versions: dict[str, str | None] = Field(default_factory=dict, description="of packages")
    commit: str | None = Field(None, description="of the package's source, if it is a checkout")

    def text(self) -> str:
        """The score as JSON, a swim a line; equal scores are equal bytes."""
        head = json.dumps(self.model_dump(mode="json", exclude={"swims"}), indent=1, ensure_ascii=False)
        rows = (swim.model_dump(mode="json", exclude_defaults=True) for swim in self.swims)
        swims = ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows)
        return f'{head[:-2]},\n "swims": [\n{swims}\n ]\n}}\n'


def read_score(path: Path) -> Score:
    """The score in a file.

    Raises:
        StoreError: when it cannot be read, is damaged or of another format.
    """
    try:
        content = json.loads(readable_file(path).read_text(encoding="utf-8"))
        found = Score(**content | {"swims": tuple(Swim(**swim) for swim in content["swims"])})
    except OSError as error:
        raise StoreError(f"cannot read the score {path}: {error.strerror}") from None
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise StoreError(f"{path} is damaged or no score: {error!r}") from None
    if found.format != FORMAT:
        raise StoreError(
            f"{path} is of format {found.format}, this version of snakebench needs {FORMAT}: score it again"
        )
    return found


def summary(names: Iterable[str], swims: Sequence[Swim]) -> dict[str, TaskScore]:
    """The score in each task: means over its swims."""
    scores = {}
    for name in names:
        own = [swim for swim in swims if swim.task == name]
        positive, net = ([getattr(swim, column) for swim in own] for column in ("score", "net_score"))
        half = _half_width(np.array(positive)) if name != "known" and len(own) > 1 else None
        scores[name] = TaskScore(score=_mean(positive), net_score=_mean(net), half_width=half, swims=len(own))
    return scores


def totals(parts: Sequence[TaskScore]) -> dict[str, float | None]:
    """The means over the four tasks, and half the interval; None where a task is missing."""
    if len(parts) < len(TASKS):
        return {"total": None, "net_total": None, "half_width": None}
    halves = [part.half_width or 0.0 for part in parts]
    half = round(float(np.hypot.reduce(halves)) / len(parts), _DIGITS)
    means = {"total": [part.score for part in parts], "net_total": [part.net_score for part in parts]}
    return {name: _mean(values) for name, values in means.items()} | {"half_width": half}


def _mean(values: Sequence[float | None]) -> float | None:
    return round(float(np.mean(np.array(values, float))), _DIGITS) if values else None


def _half_width(scores: FloatArray) -> float:
    """Half the 95 % interval of a mean over parts with one draw each: by the differences of neighbours.

    Two neighbours differ by their draws, and by their parts: the interval is rather too wide.
    """
    pairs = scores[: len(scores) // 2 * 2].reshape(-1, 2)
    spread = float(np.sqrt((np.diff(pairs, axis=1) ** 2).sum())) / (2 * len(pairs))
    return round(float(stats.t.ppf(0.975, len(pairs))) * spread, _DIGITS)
