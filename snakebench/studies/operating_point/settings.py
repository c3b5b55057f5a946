"""Settings of the study."""

from typing import Literal

from pydantic import Field, field_validator

from snakebench.report import paper
from snakebench.studies.config import Distinct
from snakebench.studies.contenders import ComparisonConfig, Contenders, Pilots
from snakebench.value import Count, Positive

POLICIES_ONLY = Contenders(policies="learned_front", sinusoids="", sea_snakes="", waveforms="")


class OperatingPointConfig(ComparisonConfig):
    """Settings of the study of the paper's operating point; its robot is the one that the policies were trained on."""

    method: Literal["operating_point"] = "operating_point"
    pilots: Pilots = ("student",)
    contenders: Contenders = Field(
        POLICIES_ONLY, description="whose policies swim; they must be preference-conditioned"
    )
    diameters: Distinct[Positive] = Field((0.10, 0.0686), description="of robots that the same policies swim with [m]")
    tolerance: Positive = Field(0.01, description="of the power that a preference is solved for [1]")
    search_rate: Count = Field(90, description="of that solution, in planar [Hz]")
    sinusoid_diameters: Distinct[Positive] = Field(description="of robots that the paper's sinusoid swims with [m]")

    @field_validator("fluids")
    @classmethod
    def _of_the_paper(cls, fluids: tuple[str, ...]) -> tuple[str, ...]:
        """The paper gives the power of its policy in these fluids only."""
        for name in fluids:
            if name not in paper.POLICY:
                raise ValueError(f"{name}: the paper gives its policy's power in {', '.join(paper.POLICY)} only")
        return fluids
