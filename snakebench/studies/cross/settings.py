"""Settings of the study."""

from typing import Literal

from snakebench.studies.contenders import ComparisonConfig, Pilots


class CrossConfig(ComparisonConfig):
    """Settings of the cross-environment study."""

    method: Literal["cross"] = "cross"
    pilots: Pilots = ("student",)

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return ("pybullet",)
