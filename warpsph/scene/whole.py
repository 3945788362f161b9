"""A whole scene, field by field, and the numbers that follow from a few of them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from warpsph.scene.bodies import BodyField
from warpsph.scene.boundaries import ImageField, WallField, WallModel
from warpsph.scene.fields import Coefficient, Line, Name, NotNegative, Part, Point, Real, SwitchOrBounded, Text
from warpsph.scene.fluids import FluidField, Material
from warpsph.scene.instruments import Force, Gauge, Overtopping, Probe, RunUp
from warpsph.scene.numerics import (
    DensityDiffusion,
    DensityFilterField,
    RunField,
    Shifting,
    Smoothing,
    ViscosityField,
    WarmUp,
)
from warpsph.scene.output import Output
from warpsph.scene.schemes import SchemeName
from warpsph.scene.waves import DampingZone, WaveMaker

# More than these are a slip, not a scene: each is tested against all others.
MOST_WALLS, MOST_FLUIDS, MOST_BODIES, MOST_GAUGES = 200, 50, 100, 500

# The lists of instruments of a scene, and the folders of their records.
INSTRUMENTS = ("gauges", "probes", "forces", "run_up", "overtopping")


class SceneFields(Part):
    """A whole scene file, field by field."""

    title: Line = Field(description="One line for reports [-].")
    source: Text = Field("", description="Where the case comes from [-].")
    scheme: SchemeName = Field(
        "weakly_compressible",
        description="How the equations of flow are solved [-]: weakly_compressible, or mueller, Braga's (2018) for the "
        "sake of comparison: density by summation, a kernel for each purpose, walls that throw particles back, 2-D.",
    )
    dimensions: Literal[2, 3] = Field(
        2, description="Dimensions of space [-]; a 2-D scene lies in the x-z plane, points of a 3-D one are [x, y, z]."
    )
    spacing: Annotated[Real, Field(ge=1e-6, le=1e4)] = Field(description="Particle spacing dx [m].")
    gravity: Annotated[NotNegative, Field(le=1e4)] = Field(9.81, description="Gravity along -z [m/s2].")
    body_force: Point | None = Field(
        None, description="Acceleration of all fluid besides gravity [u, w], in 3-D [u, v, w] [m/s2]; none when absent."
    )
    smoothing: Smoothing = Field(Smoothing(), description="The smoothing kernel.")
    materials: Annotated[dict[Name, Material], Field(min_length=1, max_length=MOST_FLUIDS)] = Field(
        description="Materials by name."
    )
    artificial_viscosity: Literal["signal", "monaghan"] = Field(
        "signal", description="Artificial viscosity [-]: signal (all pairs) or monaghan (approaching pairs only)."
    )
    artificial_viscosity_beta: Coefficient = Field(
        0.0, description="Quadratic coefficient beta of the monaghan artificial viscosity [-]."
    )
    viscosity: ViscosityField = Field(
        ViscosityField(), description="How forces come of the materials' own viscosities."
    )
    density_diffusion: DensityDiffusion = Field(DensityDiffusion(), description="Diffusion of density.")
    continuity: Literal["plain", "renormalised"] = Field(
        "plain",
        description="Divergence in the rate of density [-]: plain, the partner of the pressure force, or renormalised, "
        "exact for linear velocities in disorder and at a surface, for which energy is kept less well.",
    )
    density_filter: DensityFilterField = Field(DensityFilterField(), description="Density made anew, now and then.")
    shifting: Shifting = Field(Shifting(), description="A drift that keeps particles in order.")
    tensile_correction: SwitchOrBounded = Field(
        "bounded",
        description="Whether to correct the tensile instability [-]; bounded: so far only that no pair in tension is "
        "pushed apart.",
    )
    xsph: Annotated[Real, Field(ge=0, le=1)] = Field(0.0, description="XSPH smoothing of the velocity, epsilon [-].")
    neighbours: Literal["auto", "lists", "cells"] = Field(
        "auto",
        description="How pair loops find neighbours [-]: lists (fast), or the cells around (little memory); auto: "
        "lists, but cells where only these fit into the memory that is free.",
    )
    walls: Annotated[tuple[WallField, ...], Field(max_length=MOST_WALLS)] = Field((), description="Walls.")
    wall_model: WallModel = Field(WallModel(), description="How walls push fluid away.")
    images: Annotated[tuple[ImageField, ...], Field(max_length=6)] = Field(
        (), description="Mirrors and periodic edges."
    )
    fluids: Annotated[tuple[FluidField, ...], Field(min_length=1, max_length=MOST_FLUIDS)] = Field(
        description="Bodies of fluid; a later one leaves out places closer than one spacing to an earlier one."
    )
    bodies: Annotated[tuple[BodyField, ...], Field(max_length=MOST_BODIES)] = Field((), description="Rigid bodies.")
    wave_maker: WaveMaker | None = Field(None, description="A paddle that makes waves; it is the last of the bodies.")
    damping_zones: Annotated[tuple[DampingZone, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="Zones in which waves are damped."
    )
    gauges: Annotated[tuple[Gauge, ...], Field(max_length=MOST_GAUGES)] = Field((), description="Wave gauges.")
    probes: Annotated[tuple[Probe, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="Probes of pressure and velocity."
    )
    forces: Annotated[tuple[Force, ...], Field(max_length=MOST_GAUGES)] = Field((), description="Forces on walls.")
    run_up: Annotated[tuple[RunUp, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="Highest wet points along walls."
    )
    overtopping: Annotated[tuple[Overtopping, ...], Field(max_length=MOST_GAUGES)] = Field(
        (), description="What passes lines, in 3-D rectangles."
    )
    warm_up: WarmUp | None = Field(None, description="Settling before the release; none when absent.")
    run: RunField = Field(description="When to stop, and how far a step reaches.")
    output: Output = Field(Output(), description="What is written while the scene runs.")
    allow: tuple[Literal["low_sound_speed"], ...] = Field((), description="Refusals to turn into warnings [-].")

    @property
    def smoothing_length(self) -> float:
        """h [m]."""
        return self.smoothing.ratio * self.spacing

    @property
    def acceleration(self) -> tuple[float, float, float]:
        """Gravity and the body force [m/s2], shape [3]."""
        x, *y, z = self.body_force or (0.0, 0.0)
        return x, y[0] if y else 0.0, z - self.gravity

    @property
    def wall_spacing(self) -> float:
        """Largest distance between neighbouring points of a wall [m]."""
        return self.spacing / self.wall_model.refinement

    @property
    def start_time(self) -> float:
        """Where the clock starts [s]: 0, or minus the length of the warm-up."""
        return -self.warm_up.duration if self.warm_up else 0.0
