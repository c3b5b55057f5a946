"""Settings of the study."""

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from snakebench.errors import InvalidValue
from snakebench.studies.search_settings import FrontSettings
from snakebench.studies.training_jobs import LearningConfig, TrainingJob

Positions = Annotated[int, Field(ge=2, le=10_000)]


class LearnedFrontConfig(LearningConfig, FrontSettings):
    """Settings of the learned-front study."""

    method: Literal["learned_front"] = "learned_front"
    positions: Positions = Field(16, description="number of prices of power, log-spaced over their range")
    swims: Positions = Field(5, description="positions whose swims are published, of policies shown")

    def prices(self, job: TrainingJob, positions: int) -> list[float]:
        """Prices of power of a policy, which must be preference-conditioned, log-spaced over its range [1/W]."""
        if (prices := job.settings.randomisation.prices) is None:
            raise InvalidValue(f"{job}: randomisation.prices is needed, the range of its price of power")
        return [float(price) for price in np.geomspace(*prices, positions)]
