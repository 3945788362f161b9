"""Shapes in a scene file: boxes, circles, balls, paths and meshes, of fluids, walls and bodies."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag, model_validator

from warpsph.scene.fields import (
    ACROSS,
    IN_PLANE,
    IN_SPACE,
    PLACE,
    Along,
    Angle,
    Coordinate,
    Line,
    Pair,
    Part,
    Point,
    Range,
    Real,
    Size,
    Triple,
    fault,
)

# An outline of more is read slowly, and its particles are placed more slowly still.
MOST_CORNERS = 2000


class BoxField(Part):
    """An upright rectangle, in 3-D an upright box."""

    min: Annotated[Point, PLACE] = Field(description="Lower left corner [x, z], in 3-D the front one [x, y, z] [m].")
    max: Annotated[Point, PLACE] = Field(description="Upper right corner [x, z], in 3-D the back one [x, y, z] [m].")

    @model_validator(mode="after")
    def _has_an_inside(self) -> BoxField:
        if not all(low < high for low, high in zip(self.min, self.max, strict=False)):
            behind = ", behind it" if len(self.max) == 3 else ""
            raise fault(f"must lie to the right of min{behind} and above it", "max")
        return self


class Disc(Part):
    """A circle, or what lies inside it."""

    center: Annotated[Pair, PLACE] = Field(description="Centre [x, z] [m].")
    radius: Size = Field(description="Radius [m].")


class BallField(Part):
    """What lies inside a sphere."""

    center: Annotated[Triple, PLACE] = Field(description="Centre [x, y, z] [m].")
    radius: Size = Field(description="Radius [m].")


class Arc(Part):
    """A part of a circle, run counter-clockwise."""

    center: Annotated[Pair, PLACE] = Field(description="Centre [x, z] [m].")
    radius: Size = Field(description="Radius [m].")
    start: Angle = Field(description="Angle of the first end, counter-clockwise from the x axis [degrees].")
    end: Angle = Field(description="Angle of the last end, more than start and less than a turn beyond it [degrees].")

    @model_validator(mode="after")
    def _turns_once(self) -> Arc:
        if not 0 < self.end - self.start < 360:
            raise fault("must be more than start, and less than a whole turn beyond it", "end")
        return self


class Corner(Part):
    """A point of a path at which an arc, tangent to both legs, rounds the corner."""

    at: Annotated[Pair, PLACE] = Field(description="Where the two legs would meet [x, z] [m].")
    radius: Annotated[Coordinate, Field(ge=0)] = Field(description="Radius of the arc [m].")


def _kind_of_path_point(value: Any) -> str:
    return "<corner>" if isinstance(value, (dict, Corner)) else "<point>"


PathPoint = Annotated[
    Annotated[Pair, Tag("<point>")] | Annotated[Corner, Tag("<corner>")], Discriminator(_kind_of_path_point)
]


def refuse_width_of_box(box: BoxField | None, width: tuple[float, float] | None) -> None:
    """Refuse a width beside a box."""
    if box and width:
        raise fault("a box has its width in min and max", "width")


class Shape(Part):
    """The outline of a body of fluid: exactly one of box, polygon, disc and sphere."""

    box: BoxField | None = Field(None, description="Upright rectangle, in 3-D a box [m].")
    polygon: Annotated[Annotated[tuple[Pair, ...], Field(min_length=3, max_length=MOST_CORNERS)] | None, PLACE] = Field(
        None, description="Corners [x, z] of a polygon [m], either way round."
    )
    disc: Disc | None = Field(None, description="Circle [m].")
    sphere: Annotated[BallField | None, IN_SPACE] = Field(None, description="Sphere, in 3-D [m].")
    width: Annotated[Range | None, ACROSS, Along("y")] = Field(
        None, description="In 3-D, from y to y: how far a polygon or disc reaches across [m]."
    )

    @model_validator(mode="after")
    def _is_one_shape(self) -> Shape:
        self._need_one_of("box", "polygon", "disc", "sphere")
        refuse_width_of_box(self.box, self.width)
        if self.sphere and self.width:
            raise fault("a sphere has no other width", "width")
        return self


class MeshFile(Part):
    """A closed surface from a file."""

    file: Line = Field(
        description="Path of the file, from the scene file's folder [-]; STL, OBJ, PLY, OFF, GLB; with meshio VTK, "
        "MSH and more."
    )
    scale: Annotated[Real, Field(ge=1e-9, le=1e9)] = Field(1.0, description="Metres to a unit of the file [-].")


class SolidField(Part):
    """The shape of a rigid body: exactly one of box, polygon, disc, path, sphere and mesh."""

    box: BoxField | None = Field(None, description="Upright rectangle, in 3-D a box [m].")
    polygon: Annotated[
        Annotated[tuple[Pair, ...], Field(min_length=3, max_length=MOST_CORNERS)] | None, IN_PLANE, PLACE
    ] = Field(None, description="Corners [x, z] of a polygon, either way round, in 2-D [m].")
    disc: Annotated[Disc | None, IN_PLANE] = Field(None, description="Circle, in 2-D [m].")
    path: Annotated[
        Annotated[tuple[PathPoint, ...], Field(min_length=3, max_length=MOST_CORNERS)] | None,
        IN_PLANE,
        PLACE,
    ] = Field(None, description="Closed polyline through points [x, z] or rounded corners {at, radius}, in 2-D [m].")
    sphere: Annotated[BallField | None, IN_SPACE] = Field(None, description="Sphere, in 3-D [m].")
    mesh: Annotated[MeshFile | None, IN_SPACE] = Field(None, description="Closed surface from a file, in 3-D [m].")

    @model_validator(mode="after")
    def _is_one_shape(self) -> SolidField:
        self._need_one_of("box", "polygon", "disc", "path", "sphere", "mesh")
        return self
