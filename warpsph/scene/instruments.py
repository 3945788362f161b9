"""What is measured, in a scene file: gauges, probes, forces on walls, run-up and overtopping, and what was observed."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from warpsph.scene.fields import (
    ACROSS,
    NEAREST,
    PLACE,
    Along,
    Coordinate,
    Line,
    Name,
    Part,
    Point,
    Real,
    Reference,
    fault,
)


class Observed(Part):
    """What was measured elsewhere, to be held against a record."""

    file: Line = Field(description="CSV file, from the scene's folder [-].")
    columns: Annotated[tuple[Line, ...], Field(min_length=2, max_length=2)] = Field(
        description="Names of its columns of time and of the quantity, with or without their units [-]; a level is "
        "that above the level at rest."
    )
    quantity: Reference | None = Field(
        None, description="Column of the record that it is held against [-]; level or pressure when absent."
    )
    shift: Real = Field(0.0, description="What is added to its time [s].")
    offset: Real = Field(0.0, description="What is added to its values, in the unit of the record [-].")


class Gauge(Part):
    """A place where the level of the free surface is recorded."""

    name: Name = Field(description="Name of the gauge [-]; its record is gauges/NAME.csv.")
    x: Annotated[Coordinate, Along("x")] = Field(description="Where it stands, x [m].")
    y: Annotated[Coordinate | None, ACROSS, Along("y")] = Field(
        None, description="Where it stands, y [m]; needed in 3-D."
    )
    bottom: Annotated[Coordinate | None, Along("z")] = Field(
        None, description="Height z at which the search for the surface ends [m]; the bed below it when absent."
    )
    observed: Observed | None = Field(None, description="A measured level.")


class Probe(Part):
    """A place where pressure and velocity are recorded."""

    name: Name = Field(description="Name of the probe [-]; its record is probes/NAME.csv.")
    at: Annotated[Point, PLACE] = Field(description="Where it is [m]; on a wall it reads the wall's pressure.")
    body: Name | None = Field(None, description="Name of a body that it rides on [-]; it stands still when absent.")
    observed: Observed | None = Field(None, description="A measured pressure or velocity.")


class Window(Part):
    """An upright box that cuts out a part of a wall."""

    min: Annotated[Point, PLACE] = Field(description="Lower left corner [x, z], in 3-D the front one [x, y, z] [m].")
    max: Annotated[Point, PLACE] = Field(description="Upper right corner [x, z], in 3-D the back one [x, y, z] [m].")

    @model_validator(mode="after")
    def _has_an_order(self) -> Window:
        if not all(low <= high for low, high in zip(self.min, self.max, strict=False)):
            raise fault("must not lie to the left of min or below it", "max")
        return self


class Force(Part):
    """The force and torque of the fluid on a wall."""

    name: Name = Field(description="Name of the force [-]; its record is forces/NAME.csv.")
    wall: Name = Field(description="Name of the wall [-].")
    part: Window | None = Field(None, description="The part of the wall that lies in a box [m]; all of it when absent.")
    about: Annotated[Point | None, PLACE] = Field(
        None, description="Point that the torque is about [m]; the zero of the scene if absent."
    )


class RunUp(Part):
    """The highest wet point along a wall."""

    name: Name = Field(description="Name of the record, run_up/NAME.csv [-].")
    wall: Name = Field(description="Name of the wall [-].")
    part: Window | None = Field(None, description="The part of the wall that lies in a box [m]; all of it when absent.")


class Overtopping(Part):
    """What passes a line, in 3-D an upright rectangle."""

    name: Name = Field(description="Name of the record, overtopping/NAME.csv [-].")
    start: Annotated[Point, PLACE] = Field(
        description="One end of the line, in 3-D the lower corner at one end of the rectangle [m]."
    )
    end: Annotated[Point, PLACE] = Field(
        description="The other end, in 3-D the upper corner at the other [m]. What passes from the left of the way "
        "there to its right counts as positive, that is along x where the line rises, or in "
        "3-D where the rectangle runs along y."
    )

    @model_validator(mode="after")
    def _has_a_size(self) -> Overtopping:
        if len(self.start) == len(self.end) and math.dist(self.start, self.end) < NEAREST:
            raise fault("must not be start", "end")
        if (
            len(self.start) == 3
            and len(self.end) == 3
            and (self.end[2] <= self.start[2] or self.end[:2] == self.start[:2])
        ):
            raise fault("must lie above start, and not straight above it", "end")
        return self
