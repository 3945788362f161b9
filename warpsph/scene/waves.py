"""Made waves in a scene file: a wave maker with its paddle, and zones in which waves are damped."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from warpsph.scene.fields import (
    ACROSS,
    Along,
    Coordinate,
    Duration,
    Line,
    Name,
    NotNegative,
    Part,
    Range,
    Real,
    Size,
    fault,
)

# The name of the paddle among the bodies.
PADDLE = "paddle"
# What a kind of waves needs, and what else it may have.
_NEEDS = {
    "regular": ("height", "period"),
    "irregular": ("height", "period"),
    "solitary": ("height",),
    "focused": ("height", "period", "focus", "focus_time"),
    "table": ("file",),
}
_MAY = {
    "regular": ("order", "ramp"),
    "irregular": ("spectrum", "peak_enhancement", "components", "seed", "ramp"),
    "solitary": ("count", "every"),
    "focused": ("spectrum", "peak_enhancement", "components", "ramp"),
    "table": (),
}


class WaveMaker(Part):
    """A paddle, drawn by the tool, that goes the way that makes the waves asked for; it pushes along x."""

    paddle: Literal["piston", "flap"] = Field("piston", description="Whether it shifts or turns about a hinge [-].")
    waves: Literal["regular", "irregular", "solitary", "focused", "table"] = Field(
        description="What it makes [-]: regular waves, a sea by a spectrum, solitary waves, waves whose crests meet at "
        "a place, or the way of a measured paddle."
    )
    x: Annotated[Coordinate, Along("x")] = Field(description="Where its face stands at the start, x [m].")
    depth: Size = Field(description="Depth of the water before it [m].")
    bed: Annotated[Coordinate, Along("z")] = Field(0.0, description="Height of the bed before it, z [m].")
    top: Annotated[Coordinate | None, Along("z")] = Field(
        None, description="Height of its upper edge, z [m]; twice the depth over the bed if absent."
    )
    width: Annotated[Range | None, ACROSS, Along("y")] = Field(
        None, description="In 3-D, from y to y: how far it reaches across [m]."
    )
    thickness: Size | None = Field(None, description="Its thickness [m]; six spacings when absent.")
    hinge: Annotated[Coordinate | None, Along("z")] = Field(None, description="Height of the hinge of a flap, z [m].")
    longest_stroke: Size | None = Field(
        None, description="The longest way between its ends that the machine has [m]; any when absent."
    )
    begin: NotNegative = Field(0.0, description="When it begins [s].")
    height: Size | None = Field(
        None, description="Height of the waves; significant height of a sea; height of the crest of focused waves [m]."
    )
    period: Duration | None = Field(
        None, description="Period of the waves; of a sea and focused waves at the peak [s]."
    )
    order: Literal[1, 2] | None = Field(
        None, description="Order of the theory of regular waves [-]; 2 when absent, with a flap 1. Madsen (1971)."
    )
    ramp: NotNegative | None = Field(
        None, description="How long its motion grows to its full size [s]; a period when absent, of focused waves 0."
    )
    spectrum: Literal["jonswap", "pierson_moskowitz"] | None = Field(
        None, description="Spectrum of a sea and of focused waves [-]; jonswap when absent."
    )
    peak_enhancement: Annotated[Real, Field(ge=1, le=10)] | None = Field(
        None, description="Peak enhancement gamma of jonswap [-]; 3.3 when absent."
    )
    components: Annotated[int, Field(strict=True, ge=8, le=4096)] | None = Field(
        None, description="How many waves make up a sea [-]; 128 when absent."
    )
    seed: Annotated[int, Field(strict=True, ge=0, le=2**63)] | None = Field(
        None, description="Number that the phases of a sea come from [-]; 1 when absent."
    )
    count: Annotated[int, Field(strict=True, ge=1, le=1000)] | None = Field(
        None, description="How many solitary waves follow each other [-]; one when absent."
    )
    every: Duration | None = Field(None, description="From one solitary wave to the next [s]; needed for several.")
    focus: Size | None = Field(None, description="How far from the face crests meet [m].")
    focus_time: Duration | None = Field(None, description="When crests meet, after begin [s].")
    file: Line | None = Field(
        None,
        description="CSV file of table, from the scene's folder [-]: time [s], and x [m] of a piston or angle [deg] of "
        "a flap, more than 0 where it leans forward; it counts from its first row.",
    )

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> WaveMaker:
        if self.paddle == "flap" and self.hinge is None:
            raise fault("this field is missing: a flap turns about it", "hinge")
        if self.paddle == "piston" and self.hinge is not None:
            raise fault("goes with a flap, not with a piston", "hinge")
        for name in _NEEDS[self.waves]:
            if getattr(self, name) is None:
                raise fault(f"this field is missing: {self.waves} waves need it", name)
        known = {name for names in (*_NEEDS.values(), *_MAY.values()) for name in names}
        for name in sorted(known - {*_NEEDS[self.waves], *_MAY[self.waves]}):
            if getattr(self, name) is not None:
                raise fault(f"means nothing to {self.waves} waves", name)
        if self.waves == "solitary" and self.paddle == "flap":
            raise fault("solitary waves need a piston", "paddle")
        if self.order == 2 and self.paddle == "flap":
            raise fault("of a flap is known to the first order only", "order")
        if (self.count or 1) > 1 and self.every is None:
            raise fault("this field is missing: several waves need it", "every")
        if self.peak_enhancement is not None and self.spectrum == "pierson_moskowitz":
            raise fault("goes with jonswap", "peak_enhancement")
        if self.top is not None and self.top <= self.bed + self.depth:
            raise fault(f"must lie above the still level, {self.bed + self.depth:g} m", "top")
        if self.hinge is not None and self.hinge >= self.bed + self.depth:
            raise fault(f"must lie below the still level, {self.bed + self.depth:g} m", "hinge")
        return self

    @property
    def upper_edge(self) -> float:
        """Height of its upper edge, z [m]."""
        return self.bed + 2.0 * self.depth if self.top is None else self.top


class DampingZone(Part):
    """A zone in which waves are damped, the more the farther in; at its `end` most."""

    name: Name = Field(description="Name of the zone [-].")
    end: Annotated[Coordinate, Along("x")] = Field(description="Where it ends, x [m].")
    side: Literal["right", "left"] = Field("right", description="Whether it ends at its right or at its left [-].")
    wavelengths: Annotated[Size, Field(le=1000)] = Field(1.0, description="Its length in wavelengths [-].")
    period: Duration | None = Field(
        None, description="Period of the waves [s], of a sea at its peak; the wave_maker's when absent."
    )
    depth: Size | None = Field(None, description="Depth of its water [m]; the wave_maker's when absent.")
