"""Settings of the study."""

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from snakebench.controllers import AnyGait
from snakebench.errors import missing
from snakebench.fluid import Fluid, named_fluid
from snakebench.learning.settings import VISCOSITIES
from snakebench.studies.config import StudyConfig, ascending
from snakebench.studies.contenders import NameOrNone
from snakebench.studies.search_settings import Currencies
from snakebench.value import Count, Name, Positive, Value, within

WIDEST = 2.0  # bound of targets that collocation can follow [rad]
HELD = 1.0  # bound of targets that are held, those of policies [rad]

Allowed = Annotated[tuple[Positive, ...], AfterValidator(ascending), Field(min_length=1)]


class Bounds(Value):
    """What bounds a gait beside its power."""

    target: Annotated[float, Field(strict=True), within(0.05, WIDEST)] = Field(
        1.0, description="absolute target angles [rad]"
    )
    joint_rate: Positive | None = Field(None, description="joints' speed [rad/s]; none by default")
    held: bool = Field(False, description="targets are held from knot to knot, as a policy's are; of every fluid")
    powers: Allowed | None = Field(None, description="of the study's, at which they are tried [W]; all by default")

    @model_validator(mode="after")
    def _held_within(self) -> Self:
        if self.held and self.target > HELD:
            raise ValueError(f"target = {self.target:g}: held targets are at most {HELD:g} rad, as policies' are")
        return self


class LimitConfig(StudyConfig):
    """Settings of the study of the limit."""

    method: Literal["limit"] = "limit"
    viscosities: Annotated[int, Field(ge=0, le=100)] = Field(
        description="log-spaced between 1e-7 and 1e-2 m^2/s, beside the fluids; 0 for none"
    )
    powers: Allowed = Field(description="at which the fastest gait is sought [W]")
    anchors: tuple[Positive, ...] = Field(
        (1.0, 10.0), min_length=1, description="of the powers, at which the starts are tried [W]"
    )
    shown: Positive = Field(5.0, description="of the powers, whose gaits the page shows [W]")
    currencies: Currencies = ("net", "positive")
    bounds: dict[Name, Bounds] = Field(
        min_length=1, description="by name; the first holds everywhere, others in the fluids only, or with held targets"
    )
    starts: dict[Name, AnyGait] = Field(min_length=1, description="gaits whose cycles start solutions")
    waves: Annotated[int, Field(ge=0, le=100)] = Field(2, description="random travelling waves that start some too")
    policies: NameOrNone = Field("", description="study whose first policy starts some too; none by default")
    seed: Annotated[int, Field(ge=0)] = Field(0, description="of the random waves")
    planar_rate: Count = Field(480, description="of replays in the planar engine [Hz]")
    verify_rate: Count = Field(960, description="of replays in PyBullet, the published figures [Hz]")
    control_rate: Count = Field(30, description="at which targets are held in some replays, as policies' are [Hz]")

    @model_validator(mode="after")
    def _anchored(self) -> Self:
        if (first := next(iter(self.bounds))) and self.bounds[first].held:
            raise ValueError(f"bounds.{first}.held: the first bounds are of linear targets, from which held ones start")
        of_bounds = {power for one in self.bounds.values() for power in one.powers or ()}
        if unknown := {*self.anchors, self.shown, *of_bounds} - set(self.powers):
            known = ", ".join(f"{power:g}" for power in self.powers)
            raise ValueError(f"anchors, shown and those of bounds: {min(unknown):g} W is none of the powers {known}")
        if self.robot.proportional_gain == 0:
            raise ValueError("robot.proportional_gain = 0: the limit is of servos that follow target angles")
        if self.robot.angle_limit is not None:
            raise ValueError(
                f"robot.angle_limit = {self.robot.angle_limit:g}: the limit is of joints without an end stop"
            )
        return self

    def check_installed(self) -> None:
        """Make sure that the solver is installed."""
        try:
            import casadi  # noqa: F401
        except ModuleNotFoundError:
            raise missing("the limit", "CasADi", "limit") from None

    def media(self) -> list[tuple[str | None, Fluid]]:
        """All fluids, named and of the grid, from thin to thick."""
        named: list[tuple[str | None, Fluid]] = [(name, named_fluid(name)) for name in self.fluids]
        least, most = VISCOSITIES
        ratio = most / least
        grid = [least * ratio ** (k / max(self.viscosities - 1, 1)) for k in range(self.viscosities)]
        media = named + [(None, Fluid(kinematic_viscosity=viscosity)) for viscosity in grid]
        return sorted(media, key=lambda medium: medium[1].kinematic_viscosity)
