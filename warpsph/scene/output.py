"""What is written while a scene runs, how often, and from where its pictures are seen."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from warpsph.scene.fields import IN_SPACE, Duration, Part, Range, Rate, Size, Switch

# Fewer pictures than this of an animation look like slides [1/s].
SMOOTH = 15.0

Projection = Literal["front", "above", "perspective"]


class View(Part):
    """From where pictures are seen, and how much of the scene."""

    projection: Annotated[Projection | None, IN_SPACE] = Field(
        None,
        description="From where a 3-D scene is seen [-]: front (where y is least), above, or in perspective; the last "
        "when absent. A 2-D scene is seen from its front.",
    )
    x: Range | None = Field(None, description="From x to x [m]; all of it when absent.")
    y: Annotated[Range | None, IN_SPACE] = Field(None, description="From y to y, in 3-D [m]; all of it when absent.")
    z: Range | None = Field(None, description="From z to z [m]; all of it when absent.")


class Output(Part):
    """What is written while the scene runs."""

    frames_per_second: Rate = Field(30.0, description="Pictures and frames of USD and VTK [1/s].")
    samples_per_second: Rate = Field(200.0, description="Lines of the records of gauges, energy and fluids [1/s].")
    pictures: Switch = Field(True, description="Whether to draw PNG frames and an animation [-].")
    usd: Switch = Field(True, description="Whether to write a USD point cache [-].")
    vtk: Switch = Field(False, description="Whether to write particles for ParaView [-].")
    checkpoint_every: Duration = Field(0.5, description="Simulated time from one checkpoint to the next [s].")
    usd_fields: Switch = Field(True, description="Whether the USD cache holds density and pressure [-].")
    usd_walls: Switch = Field(True, description="Whether a renderer sees the walls of the USD cache [-].")
    animation_rate: Rate | None = Field(
        None,
        description="Pictures of the animation [1/s]; when absent frames_per_second, as it happens, but 15 at least.",
    )
    view: View = Field(View(), description="From where pictures are seen, and how much of the scene.")
    speed_scale: Size | None = Field(
        None, description="Speed at which the colours of the pictures end [m/s]; a guess from gravity when absent."
    )

    @property
    def shown_per_second(self) -> float:
        """Pictures of the animation [1/s]."""
        return self.animation_rate or max(self.frames_per_second, SMOOTH)
