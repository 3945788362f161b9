"""What bounds the fluid in a scene file: walls and their law of force, mirrors, periodic edges."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, model_validator

from warpsph.scene.fields import (
    ACROSS,
    IN_SPACE,
    LEAST,
    NEAREST,
    PLACE,
    Along,
    Coefficient,
    Name,
    Part,
    Point,
    Range,
    Real,
    Switch,
    fault,
)
from warpsph.scene.shapes import MOST_CORNERS, Arc, BoxField, Corner, Disc, PathPoint, refuse_width_of_box

Face = Literal["left", "right", "front", "back", "bottom", "top"]


class BoxWall(BoxField):
    """The faces of a box."""

    open: Annotated[tuple[Face, ...] | None, IN_SPACE] = Field(None, description="Faces that are missing, in 3-D [-].")

    @model_validator(mode="after")
    def _has_a_face(self) -> BoxWall:
        if len(set(self.open or ())) == len(get_args(Face)):
            raise fault("a box without any face is no wall", "open")
        return self


class WallField(Part):
    """A solid line, in 3-D a surface, that repels fluid on both of its sides."""

    name: Name = Field(description="Name of the wall [-].")
    path: Annotated[Annotated[tuple[PathPoint, ...], Field(min_length=2, max_length=MOST_CORNERS)] | None, PLACE] = (
        Field(None, description="Polyline through points [x, z] [m] or rounded corners {at, radius}.")
    )
    closed: Switch = Field(False, description="Whether the path returns to its first point [-].")
    box: BoxWall | None = Field(None, description="Outline of an upright rectangle, in 3-D the faces of a box [m].")
    disc: Disc | None = Field(None, description="Outline of a circle [m].")
    arc: Arc | None = Field(None, description="A part of a circle [m, degrees].")
    width: Annotated[Range | None, ACROSS, Along("y")] = Field(
        None, description="In 3-D, from y to y: how far a path, disc or arc reaches across [m]."
    )

    @model_validator(mode="after")
    def _is_one_line(self) -> WallField:
        self._need_one_of("path", "box", "disc", "arc")
        refuse_width_of_box(self.box, self.width)
        if self.closed and self.path is None:
            raise fault("only a path can be told to close", "closed")
        if self.path is not None:
            if self.closed and len(self.path) < 3:
                raise fault("a closed path needs 3 points at least, not 2", "path")
            for end in () if self.closed else (0, len(self.path) - 1):
                if isinstance(self.path[end], Corner):
                    raise fault("the end of an open path is no corner; write it as [x, z]", f"path[{end}]")
        return self


# What suits a law that pushes: still water rests about where it is drawn.
_WALL_LAWS: Mapping[str, Mapping[str, float | str]] = {
    "radial": {"refinement": 3.0, "set_back": 0.95, "slip": "free"},
    "lennard_jones": {"refinement": 3.0, "set_back": 0.3, "slip": "free"},
    "monaghan_kos": {"refinement": 3.0, "set_back": 0.8, "slip": "free"},
    "monaghan_kos_issa": {"refinement": 3.0, "strength": 0.02, "set_back": 1.35, "slip": "free"},
    "reflecting": {"slip": "free"},
}


WallLaw = Literal["dummy_particles", "radial", "lennard_jones", "monaghan_kos", "monaghan_kos_issa", "reflecting"]


class WallModel(Part):
    """What walls are made of, or how they push fluid away."""

    force: WallLaw = Field(
        "dummy_particles",
        description="Law of the wall force [-]: dummy_particles stand in layers behind the wall with the pressure of "
        "the fluid before it (Adami, Hu & Adams 2012), and nothing is to be tuned; the others push, radial as Monaghan "
        "and Kajtar do; reflecting, of the scheme mueller alone, throws back what has gone through.",
    )
    refinement: Annotated[Real, Field(ge=1, le=10)] = Field(
        1.0, description="Particle spacing over the spacing of wall points, beta [-]; 3 for laws that push when absent."
    )
    strength: Coefficient = Field(
        0.01, description="Strength of the wall force, K / c0^2 [-]; 0.02 for monaghan_kos_issa when absent."
    )
    approach: Coefficient = Field(
        0.0, description="Part of the speed of approach in the force of monaghan_kos, beta [-]; more than 0 damps."
    )
    set_back: Annotated[Real, Field(ge=0, le=10)] = Field(
        0.0,
        description="How far behind the wall line the points of a law that pushes stand, in spacings [-]: still water "
        "then rests with its first row half a spacing off the line. When absent 0.95 for radial, 0.3 for "
        "lennard_jones, 0.8 for monaghan_kos, 1.35 for monaghan_kos_issa.",
    )

    restitution: Annotated[Real, Field(ge=0, le=1)] = Field(
        0.75,
        description="Part of its velocity, all components, that a particle keeps when a reflecting wall throws it back "
        "[-].",
    )
    slip: Literal["none", "free"] = Field(
        "none",
        description="How fluid with a viscosity of its own goes along dummy_particles [-]: none, it sticks to walls, "
        "or free, as along walls of other laws when absent. It slips along bodies too, and where it has no viscosity; "
        "there wall_alpha of its material makes it rub.",
    )

    @model_validator(mode="before")
    @classmethod
    def _suit_the_law(cls, data: Any) -> Any:
        law = data.get("force") if isinstance(data, dict) else None
        return _WALL_LAWS[law] | data if isinstance(law, str) and law in _WALL_LAWS else data

    @model_validator(mode="after")
    def _dummies_need_no_tuning(self) -> WallModel:
        for name in ("refinement", "strength", "set_back") if self.force in ("dummy_particles", "reflecting") else ():
            if getattr(self, name) != type(self).model_fields[name].default:
                why = "which have nothing to tune" if self.force == "dummy_particles" else "which has a restitution"
                raise fault(f"means nothing to {self.force}, {why}", name)
        return self

    @model_validator(mode="after")
    def _sticks_to_dummies(self) -> WallModel:
        if self.slip == "none" and self.force != "dummy_particles":
            raise fault(f"none goes with dummy_particles; {self.force} lets fluid slip", "slip")
        return self

    @model_validator(mode="after")
    def _restitution_has_a_law(self) -> WallModel:
        if self.force != "reflecting" and self.restitution != type(self).model_fields["restitution"].default:
            raise fault(f"goes with the force reflecting; {self.force} does not know it", "restitution")
        return self

    @model_validator(mode="after")
    def _approach_has_a_law(self) -> WallModel:
        if self.approach and self.force != "monaghan_kos":
            raise fault(f"goes with the force monaghan_kos; {self.force} does not know it", "approach")
        return self


class Mirror(Part):
    """A plane wall, seen as a mirror: the fluid goes on behind it as its own image."""

    point: Annotated[Point, PLACE] = Field(description="A point of the plane [x, z], in 3-D [x, y, z] [m].")
    normal: Point = Field(description="Direction across the plane, into the fluid; of any length [-].")
    velocity_rule: Literal["free_slip", "no_slip_opposite", "no_slip_wall", "takeda"] = Field(
        "free_slip",
        description="Velocity of the image that friction sees [-]: mirrored, opposite, the wall's own, or "
        "extrapolated linearly from the wall.",
    )
    velocity: Point | None = Field(None, description="Velocity of the wall, along itself [m/s]; at rest when absent.")

    @model_validator(mode="after")
    def _slides_along_itself(self) -> Mirror:
        if math.hypot(*self.normal) < LEAST:
            raise fault("has no direction", "normal")
        if self.velocity:
            if len(self.velocity) != len(self.normal):
                raise fault(f"{len(self.normal)} numbers are needed, as in normal", "velocity")
            across = sum(u * n for u, n in zip(self.velocity, self.normal, strict=True))
            if abs(across) > 1e-6 * math.hypot(*self.velocity) * math.hypot(*self.normal):
                raise fault("must be along the wall; a mirror stays where it is", "velocity")
            if self.velocity_rule == "free_slip":
                raise fault("means nothing to a fluid that slips; choose another velocity_rule", "velocity")
        return self


class Periodic(Part):
    """A pair of parallel plane edges that are the same place: what leaves through one comes in through the other."""

    start: Annotated[Point, PLACE] = Field(description="A point of one edge [x, z], in 3-D [x, y, z] [m].")
    end: Annotated[Point, PLACE] = Field(description="The same point on the other edge, straight across [m].")

    @model_validator(mode="after")
    def _has_a_length(self) -> Periodic:
        if len(self.start) == len(self.end) and math.dist(self.start, self.end) < NEAREST:
            raise fault("must not be start", "end")
        return self


class ImageField(Part):
    """A mirror or a periodic pair of edges. All fluid lies on its inner side."""

    name: Name = Field(description="Name of the image [-].")
    mirror: Mirror | None = Field(None, description="A mirror.")
    periodic: Periodic | None = Field(None, description="A periodic pair instead.")

    @model_validator(mode="after")
    def _is_one_image(self) -> ImageField:
        self._need_one_of("mirror", "periodic")
        return self
