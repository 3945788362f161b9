"""Fluids in a scene file: what they are made of, and where they start."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, model_validator

from warpsph.scene.fields import (
    COLOR,
    PLACE,
    Along,
    Angle,
    Coefficient,
    Coordinate,
    Density,
    Name,
    NotNegative,
    Part,
    Point,
    Positive,
    Range,
    Real,
    Reference,
    Size,
    Switch,
    fault,
)
from warpsph.scene.shapes import Shape

# What each law needs beside its consistency; the last law holds the others.
_LAW_NEEDS: Mapping[str, tuple[str, ...]] = {
    "newtonian": (),
    "power_law": ("exponent", "viscosity_max"),
    "bingham": ("yield_stress", "viscosity_max"),
    "herschel_bulkley": ("exponent", "yield_stress", "viscosity_max"),
}


class RheologyField(Part):
    """How the viscosity of a fluid depends on its rate of shear."""

    law: Literal["newtonian", "power_law", "bingham", "herschel_bulkley"] = Field(
        description="Shear stress of a rate of shear [-]: tau = yield_stress + consistency rate^exponent, or a part."
    )
    consistency: Positive = Field(
        description="Consistency K [Pa s^exponent]; of newtonian and bingham, a viscosity [Pa s]."
    )
    exponent: Annotated[Real, Field(ge=0.01, le=100)] | None = Field(
        None, description="Exponent N of power_law and herschel_bulkley [-]: less than 1 thins, more than 1 thickens."
    )
    yield_stress: NotNegative | None = Field(
        None, description="Stress below which bingham and herschel_bulkley do not flow [Pa]."
    )
    regularisation: Literal["bi_viscous", "papanastasiou", "cross"] | None = Field(
        None, description="What keeps the viscosity of a yield stress finite at rest [-]; bi_viscous when absent."
    )
    viscosity_max: Positive | None = Field(
        None, description="Greatest apparent viscosity [Pa s], which a plug has in place of an infinite one."
    )

    @model_validator(mode="after")
    def _has_what_its_law_needs(self) -> RheologyField:
        needed = _LAW_NEEDS[self.law]
        for name in ("exponent", "yield_stress", "viscosity_max"):
            if name in needed and getattr(self, name) is None:
                why = f"{self.law} needs it"
                if name == "viscosity_max":
                    rest = "at rest" if (self.exponent or 0.0) <= 1.0 else "in fast flow"
                    why = f"without it the viscosity of {self.law} has no limit {rest}"
                raise fault(f"this field is missing: {why}", name)
            if name not in needed and getattr(self, name) is not None:
                laws = [law for law, fields in _LAW_NEEDS.items() if name in fields]
                raise fault(f"goes with {' and '.join(laws)}, not with {self.law}", name)
        if self.regularisation and self.yield_stress is None:
            raise fault(f"goes with a yield stress, which {self.law} has not", "regularisation")
        if self.law == "bingham" and (self.viscosity_max or 0.0) < self.consistency:
            raise fault(f"must be at least the consistency, {self.consistency:g} Pa s", "viscosity_max")
        return self

    @property
    def viscosity_limit(self) -> float:
        """The greatest viscosity that it can take [Pa s]."""
        return self.consistency if self.viscosity_max is None else self.viscosity_max


class Material(Part):
    """What a fluid is made of."""

    density: Density = Field(description="Reference density [kg/m3].")
    sound_speed: Annotated[Real, Field(ge=1e-3, le=1e5)] = Field(
        math.nan,
        description="Speed of sound c0 of the state equation [m/s]; when absent ten times the greatest speed that the "
        "drawing tells of, which `check` prints.",
    )
    state_equation: Literal["tait", "linear"] = Field(
        "tait", description="Pressure from density [-]: tait (exponent 7) or linear."
    )
    alpha: Coefficient = Field(0.025, description="Coefficient of the artificial viscosity [-].")
    wall_alpha: Coefficient = Field(
        0.0, description="Coefficient of the artificial viscosity against walls [-]; 0 lets the fluid slip freely."
    )
    dynamic_viscosity: NotNegative | None = Field(
        None, description="Dynamic viscosity mu [Pa s]; only the artificial one when absent."
    )
    rheology: RheologyField | None = Field(
        None, description="A viscosity that depends on the rate of shear, instead of dynamic_viscosity."
    )
    color: Annotated[str, Field(pattern=COLOR)] | None = Field(
        None, description='Colour in pictures, as "#rrggbb" [-]; from a palette when absent.'
    )

    @model_validator(mode="after")
    def _has_one_viscosity(self) -> Material:
        if self.rheology and self.dynamic_viscosity is not None:
            raise fault("the rheology has the viscosity; leave one of the two out", "dynamic_viscosity")
        return self

    @property
    def viscosity(self) -> RheologyField | None:
        """Its own viscosity as a law; None where it has none."""
        if self.dynamic_viscosity:
            return RheologyField(law="newtonian", consistency=self.dynamic_viscosity)
        return self.rheology


class Fill(Part):
    """Fluid at rest below a level and above a wall."""

    level: Annotated[Coordinate, Along("z")] = Field(description="Height of the free surface, z [m].")
    above: Reference = Field(description="Name of the wall that carries the fluid [-].")
    between: Annotated[Range | None, Along("x")] = Field(
        None, description="Least and largest x of the fill [m]; the extent of the wall when absent."
    )


class Lattice(Part):
    """The square (in 3-D cubic) lattice that a shape is cut from: particles stand at the centres of its cells."""

    angle: Angle = Field(0.0, description="Turn of the lattice in the x-z plane, counter-clockwise [degrees].")
    origin: Annotated[Point | None, PLACE] = Field(
        None,
        description="A corner of a cell [x, z], in 3-D [x, y, z] [m]; the first corner of the shape when absent.",
    )


class ShearWave(Part):
    """A start at which layers slide along x past each other: u = speed sin(2 pi z / wavelength)."""

    speed: Coordinate = Field(description="Greatest speed, along x [m/s].")
    wavelength: Size = Field(description="Length of the wave, along z [m].")


class FluidField(Part):
    """A body of fluid, from a shape or from a fill."""

    name: Name = Field(description="Name of the fluid [-]; its records are fluids/NAME.csv.")
    material: Reference = Field(description="Name of its material [-].")
    shape: Shape | None = Field(None, description="Outline of the body [m].")
    fill: Fill | None = Field(None, description="A fill instead of a shape [m].")
    lattice: Lattice | None = Field(None, description="Lattice that a shape is cut from [m, degrees].")
    hold: Switch = Field(False, description="Whether it is kept at rest until the release at t = 0 [-].")
    velocity: Point = Field(
        (0.0, 0.0), description="Velocity at the start [u, w], in 3-D [u, v, w] [m/s]; at rest when absent."
    )
    shear_wave: ShearWave | None = Field(None, description="A wave of the velocity on top; none when absent.")
    jitter: Annotated[Real, Field(ge=0, le=0.5)] = Field(
        0.0, description="How far at most particles stand off their lattice at the start, each way, in spacings [-]."
    )
    hydrostatic: Switch = Field(
        True, description="Whether it starts with the density that hydrostatic pressure below its own top gives [-]."
    )
    clearance: Annotated[Real, Field(ge=0, le=1000)] = Field(
        0.5, description="Least distance from a particle to any wall, in spacings [-]."
    )

    @model_validator(mode="after")
    def _is_one_body(self) -> FluidField:
        self._need_one_of("shape", "fill")
        if self.hold and (any(self.velocity) or self.shear_wave):
            raise fault("a held fluid starts at rest", "velocity" if any(self.velocity) else "shear_wave")
        if self.fill is not None and self.lattice is not None:
            raise fault("goes with a shape; a fill has a lattice of its own", "lattice")
        return self
