"""Settings of the study."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from snakebench.controllers import AnyGait
from snakebench.engines import EngineName
from snakebench.studies.config import Distinct, Rates, StudyConfig
from snakebench.value import Count, Name, Positive

Adversary = Literal["random", "bang-bang", "alternating"]
RatesByEngine = Annotated[dict[EngineName, Rates], Field(min_length=1)]


class ValidationConfig(StudyConfig):
    """Settings of the validation study."""

    method: Literal["validation"] = "validation"
    gaits: dict[Name, AnyGait] = Field(min_length=1, description="the gaits that every engine swims, by name")
    rates: RatesByEngine = Field(description="physics rates to compare, by engine [Hz]")
    reference_rate: Count = Field(description="of the planar engine, for what counts as the limit [Hz]")
    order_duration: Positive = Field(description="when the state is compared to find the order [s]")
    order_rates: RatesByEngine = Field(description="physics rates for the order, by engine [Hz]")
    order_reference_rate: Count = Field(description="of the planar engine, for the state it tends to [Hz]")
    adversaries: Distinct[Adversary] = Field(
        description="target angles at the control rate: uniform, -1 or 1 at random, -1 and 1 in turns"
    )
    adversary_duration: Positive = Field(description="length of those runs [s]")
    adversary_rates: RatesByEngine = Field(description="physics rates for them, by engine [Hz]")

    @model_validator(mode="after")
    def _orders_can_be_observed(self) -> Self:
        for engine, rates in self.order_rates.items():
            if len(rates) < 2 or max(rates) >= self.order_reference_rate:
                raise ValueError(
                    f"order_rates.{engine} = {list(rates)}: two rates or more, below order_reference_rate"
                    f" {self.order_reference_rate}, are needed"
                )
        return self

    def engines(self) -> tuple[str, ...]:
        """The engines that this study uses."""
        return tuple(dict.fromkeys([*self.rates, *self.order_rates, *self.adversary_rates, "planar"]))
