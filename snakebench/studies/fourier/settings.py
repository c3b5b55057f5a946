"""Settings of the study."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from snakebench.controllers import Fourier, Gait
from snakebench.engines import EngineName
from snakebench.studies.config import ascending
from snakebench.studies.contenders import NameOrNone
from snakebench.studies.search_settings import FrontConfig, usual_rate
from snakebench.value import Count, NonNegative, Positive


class FourierConfig(FrontConfig):
    """Settings of the Fourier study; budgets count the gaits of one search, each tried in all fluids it is tuned to."""

    method: Literal["fourier"] = "fourier"
    engine: EngineName = "planar"
    physics_rate: Count = Field(default_factory=usual_rate("engine", planar=90), description="of the search [Hz]")
    harmonics: Annotated[tuple[Count, ...], AfterValidator(ascending)] = Field(
        min_length=1, description="numbers of harmonics, each search starting at the optimum of the one before"
    )
    prices: Annotated[tuple[NonNegative, ...], AfterValidator(ascending)] = Field(
        min_length=1, description="of power, in speed: 10 v - price P is maximised for each, and with P+ for P [1/W]"
    )
    limit: NameOrNone = Field("", description="study of the limit of the body, whose gaits start searches at a price")
    trials: Count = Field(description="most gaits of a search for the return, per harmonic")
    price_trials: Count = Field(description="most gaits of a search at a price, per harmonic")
    population: Annotated[int, Field(strict=True, ge=4)] | None = Field(
        None, description="gaits per generation; by default 4 + 3 ln(number of variables)"
    )
    frequency: Annotated[tuple[Positive, Positive], AfterValidator(ascending)] = Field(
        (0.1, 2.0), description="bounds of the base frequency [Hz]"
    )

    def fastest_gaits(self) -> list[Gait]:
        """Gaits of the highest frequencies that are searched."""
        ones = ((1.0,) * self.robot.n_joints,) * max(self.harmonics)
        return [Fourier(frequency=self.frequency[1], cosine=ones, sine=ones)]
