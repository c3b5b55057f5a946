"""The tasks of a version, which are frozen, and the swims that are drawn for an entry."""

import hashlib
import tomllib
from collections.abc import Iterator
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from snakebench.errors import StoreError, UnknownName
from snakebench.fluid import Fluid, FluidField, named_fluid
from snakebench.perturbation import Perturbations, Ranges, one_of
from snakebench.physics.joints import Drives
from snakebench.scenario import Scenario
from snakebench.store import file_digest
from snakebench.value import Count, Name, Positive, Real, Value

VERSION = "v1"  # of the tasks, the newest
TASKS = ("known", "unknown", "changing", "robust")
DEV = "dev"  # seed of the draws that are the same for all entries
LIMIT = "limit.csv"
_QUICK: dict[Drives, int] = {"angle": 240, "torque": 1440}  # in the planar engine, stable for all perturbations [Hz]
_HERE = Path(__file__).parent


class Known(Value):
    """Swims in fluids that the entry may be told."""

    powers: tuple[Positive, ...] = Field(description="at which entries that can be set to a power swim [W]")


class Unknown(Value):
    """Swims in fluids that the entry is not told."""

    swims: Count = Field(description="one in each part of the range of viscosities")


class Kind(Value):
    """Courses of one kind."""

    courses: Count
    along: Literal["time", "x"]
    between: Literal["ramp", "step"]
    knots: tuple[tuple[Real, Real], ...] = Field(description="from where to where each knot may be [s or m]")


class Changing(Value):
    """Swims through fluids that change."""

    duration: Positive = Field(description="of a course [s]")
    kinds: dict[Name, Kind]


class Robust(Value):
    """Swims on robots that differ from their description."""

    values: Count = Field(description="of each perturbation")
    ranges: Ranges = Field(description="of each perturbation")


class Tasks(Value):
    """The tasks of a version."""

    version: str
    content: str = Field(description="SHA-256 of the settings and of the table of the limit")
    limit: str = Field(description="SHA-256 of the table of the limit")
    fluids: tuple[Name, ...]
    viscosities: tuple[Positive, Positive] = Field(description="range [m^2/s]")
    physics_rate: Count = Field(description="in PyBullet [Hz]")
    duration: Positive = Field(description="of a swim in one fluid [s]")
    start: Positive = Field(description="from which its speed and power are means [s]")
    deviation: Annotated[float, Field(gt=0, lt=90)] = Field(description="largest, of the mean course from x [degrees]")
    known: Known
    unknown: Unknown
    changing: Changing
    robust: Robust

    def scenario(self, fluid: Fluid | FluidField, drives: Drives, quick: bool) -> Scenario:
        """Where a controller swims that drives target angles or torques; `quick` is in the planar engine."""
        duration = self.changing.duration if isinstance(fluid, FluidField) else self.duration
        engine, rate = ("planar", _QUICK[drives]) if quick else ("pybullet", self.physics_rate)
        return Scenario(fluid=fluid, duration=duration, engine=engine, physics_rate=rate)

    @property
    def limit_path(self) -> Path:
        """The table of the limit."""
        return _HERE / self.version / LIMIT


class Draw(NamedTuple):
    """A swim that is asked for, in words and in numbers."""

    task: str
    where: str  # a fluid or a course
    fluid: Fluid | FluidField
    perturbation: str = ""
    value: float | None = None  # of the perturbation
    seed: int = 0  # of what is random in it

    def perturbations(self) -> Perturbations:
        """How the robot differs from its description."""
        return one_of(self.perturbation, self.value or 0.0, self.seed) if self.perturbation else Perturbations()


@cache
def load_tasks(version: str) -> Tasks:
    """The tasks of a version.

    Raises:
        UnknownName: when there is no such version.
        StoreError: when the table of the limit is not the one that the version was frozen with.
    """
    versions = sorted(path.parent.name for path in _HERE.glob("v*/tasks.toml"))
    if version not in versions:
        raise UnknownName.among("version of the tasks", version, versions)
    text, table = (_HERE / version / "tasks.toml").read_bytes(), (_HERE / version / LIMIT).read_bytes()
    tasks = Tasks(version=version, content=file_digest(text + table), **tomllib.loads(text.decode()))
    if tasks.limit != file_digest(table):
        raise StoreError(f"{tasks.limit_path} is not the table that the tasks {version} were frozen with")
    return tasks


def draws(tasks: Tasks, seed: str, names: tuple[str, ...] = TASKS) -> list[Draw]:
    """The swims of some tasks; `seed` is the entry's digest, or `DEV`. Neighbours in their order are alike."""
    makers = {"known": _known, "unknown": _unknown, "changing": _changing, "robust": _robust}
    return [draw for name in names for draw in makers[name](tasks, f"{tasks.version} {seed} {name}")]


def uniform(*labels: object) -> float:
    """A number in [0, 1) that depends on the labels alone: of their SHA-256, joined by spaces, the first 53 bits."""
    content = hashlib.sha256(" ".join(map(str, labels)).encode()).digest()
    return (int.from_bytes(content[:7], "big") >> 3) / 2**53


def _known(tasks: Tasks, _: str) -> Iterator[Draw]:
    for name in tasks.fluids:
        yield Draw("known", name, named_fluid(name))


def _unknown(tasks: Tasks, seed: str) -> Iterator[Draw]:
    for k in range(tasks.unknown.swims):
        fluid = _fluid(tasks, (k + uniform(seed, k)) / tasks.unknown.swims)
        yield Draw("unknown", f"{fluid.kinematic_viscosity:.3g} m²/s", fluid)


def _changing(tasks: Tasks, seed: str) -> Iterator[Draw]:
    """Courses whose fluids are each from another part of the range, in all orders by turns."""
    for name, kind in tasks.changing.kinds.items():
        parts, first = len(kind.knots), uniform(seed, name)
        orders = list(permutations(range(parts)))
        for k in range(kind.courses):
            order = orders[(k + int(first * len(orders))) % len(orders)]
            knots = [low + (high - low) * uniform(seed, name, k, i) for i, (low, high) in enumerate(kind.knots)]
            fluids = [_fluid(tasks, (part + uniform(seed, name, k, "fluid", part)) / parts) for part in order]
            field = FluidField(along=kind.along, between=kind.between, knots=tuple(knots), fluids=tuple(fluids))
            yield Draw("changing", f"{name} {k + 1}", field)


def _robust(tasks: Tasks, seed: str) -> Iterator[Draw]:
    """Each part of each range in another fluid; in the order of the fluids."""
    robust, n = tasks.robust, len(tasks.fluids)
    for f, fluid in enumerate(tasks.fluids):
        for i, (name, (low, high)) in enumerate(robust.ranges.items()):
            for part in range(f, robust.values, n):
                place = (part + i + int(n * uniform(seed, name))) % robust.values
                share = (place + uniform(seed, name, place)) / robust.values
                value = low + (high - low + (name == "dead_joint")) * share
                value = float(int(value)) if name == "dead_joint" else value
                yield Draw("robust", fluid, named_fluid(fluid), name, value, int(2**32 * uniform(seed, name, part)))


def _fluid(tasks: Tasks, share: float) -> Fluid:
    """The fluid at a share of the range of viscosities, in log10."""
    low, high = tasks.viscosities
    return Fluid(kinematic_viscosity=low * (high / low) ** share)
