"""Fluids, and fluids that vary along time or space."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from snakebench.errors import InvalidValue, UnknownName
from snakebench.registry import Registry, instance_of
from snakebench.value import Positive, Real, Value

MAX_KNOTS = 256  # bounds the records handed to compiled code

# Kinematic viscosity [m^2/s] by temperature [degC], density at 15 degC [kg/m^3] (paper, table of physical properties).
_VISCOSITIES = {
    "water": {15: 1.14e-6, 40: 6.58e-7, 100: 2.94e-7},
    "oil1": {15: 2.32e-4, 40: 5.57e-5, 100: 7.77e-6},
    "oil2": {15: 4.79e-3, 40: 6.89e-4, 100: 4.32e-5},
}
_DENSITIES = {"water": 999.0, "oil1": 874.0, "oil2": 900.0}
PAPERS = ("water", "oil1", "oil2")  # in the order of their viscosities


def density_at(kinematic_viscosity: float) -> float:
    """Density [kg/m^3] assumed for a fluid known only by its kinematic viscosity [m^2/s] (ours).

    Linear in log10 of the viscosity through the three fluids' values at 15 degC, constant outside them.
    """
    known = [np.log10(_VISCOSITIES[name][15]) for name in PAPERS]
    return float(np.interp(np.log10(kinematic_viscosity), known, [_DENSITIES[name] for name in PAPERS]))


class Fluid(Value):
    """A homogeneous fluid at rest. Without a density, `density_at` supplies it.

    Raises:
        InvalidValue: when viscosity or density is not positive and finite.
    """

    kinematic_viscosity: Positive = Field(description="kinematic viscosity [m^2/s]")
    density: Positive = Field(
        default_factory=lambda fields: density_at(fields.get("kinematic_viscosity", 1e-6)),
        description="density [kg/m^3]",
    )


class FluidField(Value):
    """A fluid that changes along time or along x: knots and the fluid at each of them.

    Between knots `ramp` goes linearly in log10 of the viscosity and in the density; `step` holds the last knot's
    fluid until the next knot. Before the first and after the last knot the end fluids hold. A field along x is
    evaluated at each link's own centre of mass.

    Raises:
        InvalidValue: when knots do not increase or there are not as many fluids as knots.
    """

    along: Literal["time", "x"] = Field(description="coordinate: time [s] or x [m]")
    knots: tuple[Real, ...] = Field(min_length=1, max_length=MAX_KNOTS, description="increasing coordinates [s or m]")
    fluids: tuple[Fluid, ...] = Field(min_length=1, description="the fluid at each knot")
    between: Literal["ramp", "step"] = "ramp"

    @model_validator(mode="after")
    def _fluid_at_every_knot(self) -> Self:
        if len(self.knots) != len(self.fluids):
            raise ValueError(f"{len(self.fluids)} fluids for {len(self.knots)} knots: one fluid per knot is needed")
        if any(b <= a for a, b in zip(self.knots, self.knots[1:], strict=False)):
            raise ValueError(f"knots {self.knots} must increase")
        return self


Medium = Annotated[Fluid | FluidField, Field(union_mode="left_to_right")]
AnyMedium = Annotated[Medium, BeforeValidator(lambda given: named_fluid(given) if isinstance(given, str) else given)]

FLUIDS: Registry[Fluid] = Registry(
    "fluid",
    {
        name if temperature == 15 else f"{name}@{temperature}": Fluid(
            kinematic_viscosity=viscosity, density=_DENSITIES[name]
        )
        for name, at in _VISCOSITIES.items()
        for temperature, viscosity in at.items()
    },
    instance_of(Fluid),
)


def named_fluid(name: str) -> Fluid:
    """The fluid called so in `FLUIDS`, or described as VISCOSITY or VISCOSITY,DENSITY [m^2/s, kg/m^3]: 1e-3,900.

    Names are those of the paper's table at 15 degC, at 40 or 100 degC as `water@40`, and those of plug-ins.

    Raises:
        UnknownName: when it is neither, with the nearest valid names.
        InvalidValue: for a number out of range.
    """
    if name in FLUIDS:
        return FLUIDS[name]
    try:
        numbers = [float(part) for part in name.split(",")]
        return Fluid(**dict(zip(("kinematic_viscosity", "density"), numbers, strict=len(numbers) > 1)))
    except InvalidValue:
        raise
    except ValueError:
        raise UnknownName.among("fluid", name, [*FLUIDS, "or VISCOSITY,DENSITY such as 1e-3,900"]) from None
