"""Settings of the study."""

from typing import Literal

from pydantic import Field

from snakebench.studies.contenders import ComparisonConfig, Pilots
from snakebench.value import Count


class CrossConfig(ComparisonConfig):
    """Settings of the cross-environment study."""

    method: Literal["cross"] = "cross"
    pilots: Pilots = ("student",)
    coarser: Count = Field(480, description="a second rate, which gives the error of the step [Hz]")

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return ("pybullet",)
