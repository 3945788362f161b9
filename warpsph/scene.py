"""The scene file: its fields with their units, and plain words for whatever is wrong with them.

A scene is one YAML file. `load_scene` reads it into the frozen models below, which are also the JSON Schema that an
editor completes from. Every mistake ends as a `SceneError` whose text is the finished line for the user:

    landslide.yaml:31: fluids[1].material: no material named 'watr'; did you mean 'water'?

SI units throughout, z up, angles in degrees. A point is [x, z], in a 3-D scene [x, y, z].
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationError,
    model_validator,
)
from pydantic_core import PydanticCustomError

from warpsph.scene_file import SceneError, SourceMap, apply_override, nearest, read_text, read_yaml, show

# ----------------------------------------------------------------------------------------------------- words and types

NAME = r"^[A-Za-z][A-Za-z0-9_]*$"
COLOR = r"^#[0-9A-Fa-f]{6}$"
# More stages are not tried: rounding grows with their square.
MOST_STAGES = 101


def _fault(message: str, path: str = "") -> PydanticCustomError:
    """A mistake found by a validator; `path` leads from the validated part to the field at fault."""
    return PydanticCustomError("fault", "{message}", {"message": message, "path": path})


def _numbers(words: str, *counts: int) -> Callable[[Any], Any]:
    """A validator that wants a list with one of `counts`, called `words`."""

    def check(value: Any) -> Any:
        if not isinstance(value, (list, tuple)):
            raise _fault(f"{words} are needed, not {show(value)}")
        if len(value) not in counts:
            raise _fault(f"{words} are needed, not {len(value)}")
        return value

    return check


def _increasing(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise _fault("the first must be less than the second")
    return value


def _has_length(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise _fault("a direction is needed, not nothing")
    return value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0)]
NotNegative = Annotated[Real, Field(ge=0)]
Switch = Annotated[bool, Field(strict=True)]
Name = Annotated[str, Field(pattern=NAME)]
Pair = Annotated[tuple[Real, Real], BeforeValidator(_numbers("two numbers [a, b]", 2))]
Triple = Annotated[tuple[Real, Real, Real], BeforeValidator(_numbers("three numbers [x, y, z]", 3))]
Direction = Annotated[Triple, AfterValidator(_has_length)]
Moments = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[tuple[Positive, Positive, Positive], Tag("<triple>")],
    Discriminator(lambda value: "<triple>" if isinstance(value, (list, tuple)) else "<number>"),
]
# A pair in a 2-D scene and a triple in a 3-D one, which only the whole scene can know.
Point = Annotated[
    Annotated[tuple[Real, Real], Tag("<2>")] | Annotated[tuple[Real, Real, Real], Tag("<3>")],
    Discriminator(lambda value: f"<{len(value)}>"),
    BeforeValidator(_numbers("two numbers [a, b] (three in a 3-D scene)", 2, 3)),
]
Range = Annotated[Pair, AfterValidator(_increasing)]
Face = Literal["left", "right", "front", "back", "bottom", "top"]


class Part(BaseModel):
    """A mapping of the scene file: no field beyond the known ones, nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _know_every_key(cls, data: Any) -> Any:
        # Before anything else, so that a misspelt key is named rather than the field that it leaves missing.
        if isinstance(data, dict):
            for key in data:
                if key not in cls.model_fields:
                    raise _fault(f"no such field{nearest(key, cls.model_fields)}", str(key))
        return data

    def _need_one_of(self, *names: str) -> None:
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise _fault(f"exactly one of {', '.join(names)} is needed, not {' and '.join(given) or 'none'}")


# ---------------------------------------------------------------------------------------------------------- the models


class Smoothing(Part):
    """The smoothing kernel."""

    kernel: Literal["wendland_c2", "cubic_spline", "gaussian"] = Field(
        "wendland_c2", description="Smoothing kernel W [-]."
    )
    ratio: Annotated[Real, Field(ge=1, le=4)] = Field(
        1.5, description="Smoothing length over particle spacing, h/dx [-]."
    )


# What each law needs beside its consistency; the last law holds the others.
_LAW_NEEDS: Mapping[str, tuple[str, ...]] = {
    "newtonian": (),
    "power_law": ("exponent", "viscosity_max"),
    "bingham": ("yield_stress", "viscosity_max"),
    "herschel_bulkley": ("exponent", "yield_stress", "viscosity_max"),
}


class Rheology(Part):
    """How the viscosity of a fluid depends on its rate of shear."""

    law: Literal["newtonian", "power_law", "bingham", "herschel_bulkley"] = Field(
        description="Shear stress of a rate of shear [-]: tau = yield_stress + consistency rate^exponent, or a part."
    )
    consistency: Positive = Field(
        description="Consistency K [Pa s^exponent]; of newtonian and bingham, a viscosity [Pa s]."
    )
    exponent: Positive | None = Field(
        None, description="Exponent N of power_law and herschel_bulkley [-]: less than 1 thins, more than 1 thickens."
    )
    yield_stress: NotNegative | None = Field(
        None, description="Stress below which bingham and herschel_bulkley do not flow [Pa]."
    )
    regularisation: Literal["bi_viscous", "papanastasiou", "cross"] | None = Field(
        None, description="What keeps the viscosity of a yield stress finite at rest [-]; bi_viscous when absent."
    )
    viscosity_max: Positive | None = Field(
        None, description="Greatest apparent viscosity [Pa s], which stands for that of a plug."
    )

    @model_validator(mode="after")
    def _has_what_its_law_needs(self) -> Rheology:
        needed = _LAW_NEEDS[self.law]
        for name in ("exponent", "yield_stress", "viscosity_max"):
            if name in needed and getattr(self, name) is None:
                why = f"{self.law} needs it"
                if name == "viscosity_max":
                    rest = "at rest" if (self.exponent or 0.0) <= 1.0 else "in fast flow"
                    why = f"without it the viscosity of {self.law} has no limit {rest}"
                raise _fault(f"this field is missing: {why}", name)
            if name not in needed and getattr(self, name) is not None:
                laws = [law for law, fields in _LAW_NEEDS.items() if name in fields]
                raise _fault(f"goes with {' and '.join(laws)}, not with {self.law}", name)
        if self.regularisation and self.yield_stress is None:
            raise _fault(f"goes with a yield stress, which {self.law} has not", "regularisation")
        if self.law == "bingham" and self.viscosity_max < self.consistency:
            raise _fault(f"must be at least the consistency, {self.consistency:g} Pa s", "viscosity_max")
        return self

    @property
    def viscosity_limit(self) -> float:
        """The greatest viscosity that it can take [Pa s]."""
        return self.consistency if self.viscosity_max is None else self.viscosity_max


class Material(Part):
    """What a fluid is made of."""

    density: Positive = Field(description="Reference density [kg/m3].")
    sound_speed: Positive = Field(description="Speed of sound c0 of the state equation [m/s].")
    state_equation: Literal["tait", "linear"] = Field(
        "tait", description="Pressure from density [-]: tait (exponent 7) or linear."
    )
    alpha: NotNegative = Field(0.025, description="Coefficient of the artificial viscosity [-].")
    wall_alpha: NotNegative = Field(
        0.0, description="Coefficient of the artificial viscosity against walls [-]; 0 lets the fluid slip freely."
    )
    dynamic_viscosity: NotNegative | None = Field(
        None, description="Dynamic viscosity mu [Pa s]; only the artificial one when absent."
    )
    rheology: Rheology | None = Field(
        None, description="A viscosity that depends on the rate of shear, instead of dynamic_viscosity."
    )
    color: Annotated[str, Field(pattern=COLOR)] | None = Field(
        None, description='Colour in pictures, as "#rrggbb" [-]; from a palette when absent.'
    )

    @model_validator(mode="after")
    def _has_one_viscosity(self) -> Material:
        if self.rheology and self.dynamic_viscosity is not None:
            raise _fault("the rheology has the viscosity; leave one of the two out", "dynamic_viscosity")
        return self

    @property
    def laminar(self) -> Rheology | None:
        """Its own viscosity as a law; None where it has none."""
        if self.dynamic_viscosity:
            return Rheology(law="newtonian", consistency=self.dynamic_viscosity)
        return self.rheology


class Laminar(Part):
    """How forces come of the materials' own viscosities."""

    form: Literal["morris", "cleary", "stress"] = Field(
        "morris",
        description="Force of a pair [-]: morris, cleary (along the line between, so that no torque is left over), or "
        "stress, the divergence of the stress from velocity gradients.",
    )
    mean: Literal["arithmetic", "harmonic"] = Field(
        "harmonic", description="Viscosity between the two particles of a pair [-]."
    )
    weights: Literal["plain", "balanced"] = Field(
        "plain",
        description="Weights of pairs [-]: plain, or balanced, which leave a linear flow alone where particles are in "
        "disorder too, for a sweep more; not with cleary.",
    )
    stages: Annotated[int, Field(strict=True, ge=1, le=MOST_STAGES)] | None = Field(
        None,
        description="Sweeps of a step for viscosity [-]: 1 is explicit, more allow a longer step; as many as let sound "
        "alone limit the step when absent.",
    )

    @model_validator(mode="after")
    def _can_be_stepped(self) -> Laminar:
        if self.stages == 2:
            raise _fault("two stages take no longer a step than one; 1, or 3 and more", "stages")
        if self.weights == "balanced" and self.form == "cleary":
            raise _fault("balanced goes with morris and stress, not with cleary", "weights")
        return self


class Box(Part):
    """An upright rectangle, in 3-D an upright box."""

    min: Point = Field(description="Lower left corner [x, z], in 3-D the front one [x, y, z] [m].")
    max: Point = Field(description="Upper right corner [x, z], in 3-D the back one [x, y, z] [m].")

    @model_validator(mode="after")
    def _has_an_inside(self) -> Box:
        if not all(low < high for low, high in zip(self.min, self.max, strict=False)):
            behind = ", behind it" if len(self.max) == 3 else ""
            raise _fault(f"must lie to the right of min{behind} and above it", "max")
        return self


class BoxWall(Box):
    """The faces of a box."""

    open: tuple[Face, ...] | None = Field(None, description="Faces that are missing, in 3-D [-].")

    @model_validator(mode="after")
    def _has_a_face(self) -> BoxWall:
        if len(set(self.open or ())) == len(get_args(Face)):
            raise _fault("a box without any face is no wall", "open")
        return self


class Disc(Part):
    """A circle, or what lies inside it."""

    center: Pair = Field(description="Centre [x, z] [m].")
    radius: Positive = Field(description="Radius [m].")


class Ball(Part):
    """What lies inside a sphere."""

    center: Triple = Field(description="Centre [x, y, z] [m].")
    radius: Positive = Field(description="Radius [m].")


class Arc(Part):
    """A part of a circle, run counter-clockwise."""

    center: Pair = Field(description="Centre [x, z] [m].")
    radius: Positive = Field(description="Radius [m].")
    start: Real = Field(description="Angle of the first end, counter-clockwise from the x axis [degrees].")
    end: Real = Field(description="Angle of the last end, more than start and less than a turn beyond it [degrees].")

    @model_validator(mode="after")
    def _turns_once(self) -> Arc:
        if not 0 < self.end - self.start < 360:
            raise _fault("must be more than start, and less than a whole turn beyond it", "end")
        return self


class Corner(Part):
    """A point of a path at which an arc, tangent to both legs, rounds the corner."""

    at: Pair = Field(description="Where the two legs would meet [x, z] [m].")
    radius: NotNegative = Field(description="Radius of the arc [m].")


def _refuse_width_of_box(part: Wall | Shape) -> None:
    if part.box and part.width:
        raise _fault("a box has its width in min and max", "width")


def _kind_of_path_point(value: Any) -> str:
    return "<corner>" if isinstance(value, (dict, Corner)) else "<point>"


PathPoint = Annotated[
    Annotated[Pair, Tag("<point>")] | Annotated[Corner, Tag("<corner>")], Discriminator(_kind_of_path_point)
]


class Wall(Part):
    """A solid line, in 3-D a surface, that repels fluid on both of its sides."""

    name: Name = Field(description="Name of the wall [-].")
    path: Annotated[tuple[PathPoint, ...], Field(min_length=2)] | None = Field(
        None, description="Polyline through points [x, z] [m] or rounded corners {at, radius}."
    )
    closed: Switch = Field(False, description="Whether the path returns to its first point [-].")
    box: BoxWall | None = Field(None, description="Outline of an upright rectangle, in 3-D the faces of a box [m].")
    disc: Disc | None = Field(None, description="Outline of a circle [m].")
    arc: Arc | None = Field(None, description="A part of a circle [m, degrees].")
    width: Range | None = Field(
        None, description="In 3-D, from y to y: how far a path, disc or arc reaches across [m]."
    )

    @model_validator(mode="after")
    def _is_one_line(self) -> Wall:
        self._need_one_of("path", "box", "disc", "arc")
        _refuse_width_of_box(self)
        if self.closed and self.path is None:
            raise _fault("only a path can be told to close", "closed")
        if self.path is not None:
            if self.closed and len(self.path) < 3:
                raise _fault("a closed path needs 3 points at least, not 2", "path")
            for end in () if self.closed else (0, len(self.path) - 1):
                if isinstance(self.path[end], Corner):
                    raise _fault("the end of an open path is no corner; write it as [x, z]", f"path[{end}]")
        return self


# What suits a law, where it is not what suits `radial`: still water rests where it is drawn.
_WALL_LAWS: Mapping[str, Mapping[str, float]] = {
    "lennard_jones": {"set_back": 0.3},
    "monaghan_kos": {"set_back": 0.8},
    "monaghan_kos_issa": {"strength": 0.02, "set_back": 1.35},
}


class WallModel(Part):
    """How walls push fluid away."""

    force: Literal["radial", "lennard_jones", "monaghan_kos", "monaghan_kos_issa"] = Field(
        "radial", description="Law of the wall force [-]; radial is that of Monaghan and Kajtar."
    )
    refinement: Annotated[Real, Field(ge=1, le=10)] = Field(
        3.0, description="Particle spacing over the spacing of wall points, beta [-]."
    )
    strength: Positive = Field(
        0.01, description="Strength of the wall force, K / c0^2 [-]; 0.02 for monaghan_kos_issa when absent."
    )
    approach: NotNegative = Field(
        0.0, description="Part of the speed of approach in the force of monaghan_kos, beta [-]; more than 0 damps."
    )
    set_back: NotNegative = Field(
        0.95,
        description="How far behind the wall line its points stand, in spacings [-]: still water then rests with its "
        "first row half a spacing off the line, and the volume between the walls is the volume of the fluid. When "
        "absent 0.3 for lennard_jones, 0.8 for monaghan_kos, 1.35 for monaghan_kos_issa.",
    )

    @model_validator(mode="before")
    @classmethod
    def _suit_the_law(cls, data: Any) -> Any:
        law = data.get("force") if isinstance(data, dict) else None
        return _WALL_LAWS[law] | data if isinstance(law, str) and law in _WALL_LAWS else data

    @model_validator(mode="after")
    def _approach_has_a_law(self) -> WallModel:
        if self.approach and self.force != "monaghan_kos":
            raise _fault(f"goes with the force monaghan_kos; {self.force} does not know it", "approach")
        return self


class Mirror(Part):
    """A plane wall, seen as a mirror: the fluid goes on behind it as its own image."""

    point: Point = Field(description="A point of the plane [x, z], in 3-D [x, y, z] [m].")
    normal: Point = Field(description="Direction across the plane, into the fluid; of any length [-].")
    velocity_rule: Literal["free_slip", "no_slip_opposite", "no_slip_wall", "takeda"] = Field(
        "free_slip",
        description="Velocity of the image that friction sees [-]: mirrored, opposite, that of the wall, or "
        "extrapolated linearly from the wall.",
    )
    velocity: Point | None = Field(None, description="Velocity of the wall, along itself [m/s]; at rest when absent.")

    @model_validator(mode="after")
    def _slides_along_itself(self) -> Mirror:
        if not any(self.normal):
            raise _fault("has no direction", "normal")
        if self.velocity:
            if len(self.velocity) != len(self.normal):
                raise _fault(f"{len(self.normal)} numbers are needed, as in normal", "velocity")
            across = sum(u * n for u, n in zip(self.velocity, self.normal, strict=True))
            if abs(across) > 1e-6 * math.hypot(*self.velocity) * math.hypot(*self.normal):
                raise _fault("must be along the wall; a mirror stays where it is", "velocity")
            if self.velocity_rule == "free_slip":
                raise _fault("means nothing to a fluid that slips; choose another velocity_rule", "velocity")
        return self


class Periodic(Part):
    """A pair of parallel plane edges that are the same place: what leaves through one comes in through the other."""

    start: Point = Field(description="A point of one edge [x, z], in 3-D [x, y, z] [m].")
    end: Point = Field(description="The same point on the other edge, straight across [m].")

    @model_validator(mode="after")
    def _has_a_length(self) -> Periodic:
        if self.start == self.end:
            raise _fault("must not be start", "end")
        return self


class Image(Part):
    """A mirror or a periodic pair of edges. All fluid lies on its inner side."""

    name: Name = Field(description="Name of the image [-].")
    mirror: Mirror | None = Field(None, description="A mirror.")
    periodic: Periodic | None = Field(None, description="A periodic pair instead.")

    @model_validator(mode="after")
    def _is_one_image(self) -> Image:
        self._need_one_of("mirror", "periodic")
        return self


class DensityDiffusion(Part):
    """Diffusion of density between particles of one fluid, which keeps the pressure smooth."""

    model: Literal["none", "molteni_colagrossi", "fourtakas", "antuono"] = Field(
        "fourtakas",
        description="What is diffused [-]; fourtakas leaves fluid at rest alone, antuono (delta-SPH) any linear "
        "pressure, for a sweep more.",
    )
    delta: NotNegative = Field(0.1, description="Coefficient of the diffusion [-].")


class DensityFilter(Part):
    """Density made anew from that of all around, now and then."""

    model: Literal["none", "shepard", "mls"] = Field(
        "none",
        description="How it is interpolated [-]: none leaves it, shepard is exact for constants, mls (moving least "
        "squares) for linear fields.",
    )
    every: Annotated[int, Field(strict=True, gt=0)] = Field(20, description="Steps from one time to the next [-].")


class Shifting(Part):
    """A drift of particles to where there are fewer of them, which keeps them in order."""

    model: Literal["none", "fickian"] = Field(
        "none",
        description="How particles drift beside their velocity [-]: none, or fickian, against the gradient of their "
        "concentration at the pace of the shear rate, and along a free surface only.",
    )
    strength: Positive = Field(6.0, description="Coefficient of the drift, A [-].")
    velocity: Literal["own", "local"] = Field(
        "own",
        description="Velocity of a particle that drifts [-]: its own, so that momentum is conserved, or that of the "
        "place it drifts to, in materials with a viscosity of their own.",
    )


class Shape(Part):
    """The outline of a body of fluid: exactly one of box, polygon, disc and sphere."""

    box: Box | None = Field(None, description="Upright rectangle, in 3-D a box [m].")
    polygon: Annotated[tuple[Pair, ...], Field(min_length=3)] | None = Field(
        None, description="Corners [x, z] of a polygon [m], either way round."
    )
    disc: Disc | None = Field(None, description="Circle [m].")
    sphere: Ball | None = Field(None, description="Sphere, in 3-D [m].")
    width: Range | None = Field(None, description="In 3-D, from y to y: how far a polygon or disc reaches across [m].")

    @model_validator(mode="after")
    def _is_one_shape(self) -> Shape:
        self._need_one_of("box", "polygon", "disc", "sphere")
        _refuse_width_of_box(self)
        if self.sphere and self.width:
            raise _fault("a sphere has no other width", "width")
        return self


class Fill(Part):
    """Fluid at rest below a level and above a wall."""

    level: Real = Field(description="Height of the free surface, z [m].")
    above: str = Field(description="Name of the wall that carries the fluid [-].")
    between: Range | None = Field(
        None, description="Least and largest x of the fill [m]; the extent of the wall when absent."
    )


class Lattice(Part):
    """The square (in 3-D cubic) lattice that a shape is cut from: particles stand at the centres of its cells."""

    angle: Real = Field(0.0, description="Turn of the lattice in the x-z plane, counter-clockwise [degrees].")
    origin: Point | None = Field(
        None,
        description="A corner of a cell [x, z], in 3-D [x, y, z] [m]; the first corner of the shape when absent.",
    )


class ShearWave(Part):
    """A start at which layers slide along x past each other: u = speed sin(2 pi z / wavelength)."""

    speed: Real = Field(description="Greatest speed, along x [m/s].")
    wavelength: Positive = Field(description="Length of the wave, along z [m].")


class Fluid(Part):
    """A body of fluid, from a shape or from a fill."""

    name: Name = Field(description="Name of the fluid [-]; its records are fluids/NAME.csv.")
    material: str = Field(description="Name of its material [-].")
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
    clearance: NotNegative = Field(0.5, description="Least distance from a particle to any wall, in spacings [-].")

    @model_validator(mode="after")
    def _is_one_body(self) -> Fluid:
        self._need_one_of("shape", "fill")
        if self.hold and (any(self.velocity) or self.shear_wave):
            raise _fault("a held fluid starts at rest", "velocity" if any(self.velocity) else "shear_wave")
        if self.fill is not None and self.lattice is not None:
            raise _fault("goes with a shape; a fill has a lattice of its own", "lattice")
        return self


class MeshFile(Part):
    """A closed surface from a file."""

    file: str = Field(description="Path of the file, from the scene file's folder [-]; whatever meshio reads.")
    scale: Positive = Field(1.0, description="Metres to a unit of the file [-].")


class Solid(Part):
    """The shape of a rigid body: exactly one of box, polygon, disc, path, sphere and mesh."""

    box: Box | None = Field(None, description="Upright rectangle, in 3-D a box [m].")
    polygon: Annotated[tuple[Pair, ...], Field(min_length=3)] | None = Field(
        None, description="Corners [x, z] of a polygon, either way round, in 2-D [m]."
    )
    disc: Disc | None = Field(None, description="Circle, in 2-D [m].")
    path: Annotated[tuple[PathPoint, ...], Field(min_length=3)] | None = Field(
        None, description="Closed polyline through points [x, z] or rounded corners {at, radius}, in 2-D [m]."
    )
    sphere: Ball | None = Field(None, description="Sphere, in 3-D [m].")
    mesh: MeshFile | None = Field(None, description="Closed surface from a file, in 3-D [m].")

    @model_validator(mode="after")
    def _is_one_shape(self) -> Solid:
        self._need_one_of("box", "polygon", "disc", "path", "sphere", "mesh")
        return self


class BodyMotion(Part):
    """A motion that is prescribed: a body goes its way whatever pushes it."""

    kind: Literal["constant", "ramp", "sine", "table"] = Field(description="Its course [-].")
    shift: Point | None = Field(
        None,
        description="Velocity of constant, and of ramp at last [m/s]; amplitude of sine [m]; none when absent.",
    )
    turn: Real = Field(
        0.0, description="Rate of constant and ramp [degrees/s], amplitude of sine [degrees], counter-clockwise."
    )
    pivot: Point | None = Field(None, description="What it turns about at the start [m]; the centre when absent.")
    axis: Direction | None = Field(
        None, description="In 3-D, along what it turns, right-handed [-]; [0, -1, 0] when absent."
    )
    begin: Real = Field(0.0, description="When it begins [s].")
    period: Positive | None = Field(None, description="Period of sine, and how long ramp takes [s].")
    phase: Real = Field(0.0, description="Phase of sine at its beginning [degrees].")
    file: str | None = Field(
        None,
        description="CSV file of table, from the scene's folder [-]: time [s] and any of x, y, z [m], angle [deg].",
    )

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> BodyMotion:
        needs = {"period": ("ramp", "sine"), "file": ("table",)}
        for name, kinds in needs.items():
            if self.kind in kinds and getattr(self, name) is None:
                raise _fault(f"this field is missing: {self.kind} needs it", name)
            if self.kind not in kinds and getattr(self, name) is not None:
                raise _fault(f"goes with {' and '.join(kinds)}, not with {self.kind}", name)
        if self.kind == "table" and (self.shift is not None or self.turn):
            raise _fault("is in the table", "turn" if self.turn else "shift")
        if self.kind != "table" and self.shift is None and not self.turn:
            raise _fault("a shift or a turn is needed")
        return self


class Touch(Part):
    """How a body touches walls and other bodies; of two bodies the geometric mean counts."""

    restitution: Annotated[Real, Field(ge=0, le=1)] = Field(0.0, description="Speed after a bounce over before [-].")
    static_friction: NotNegative = Field(0.0, description="Coefficient of Coulomb's friction at rest [-].")
    dynamic_friction: NotNegative = Field(0.0, description="The same in motion, not more than at rest [-].")

    @model_validator(mode="after")
    def _rubs_less_in_motion(self) -> Touch:
        if self.dynamic_friction > self.static_friction:
            raise _fault(f"must be at most static_friction, {self.static_friction:g}", "dynamic_friction")
        return self


LOCKS = {2: ("x", "z", "angle"), 3: ("x", "y", "z", "turn_x", "turn_y", "turn_z")}


class Body(Part):
    """A rigid body, moved by the fluid, gravity and what it touches, or by a prescribed motion."""

    name: Name = Field(description="Name of the body [-]; its record is bodies/NAME.csv.")
    shape: Solid = Field(description="Its shape, as drawn [m].")
    at: Point | None = Field(None, description="Where the origin of the drawing is put [m]; where it is when absent.")
    angle: Real = Field(0.0, description="Turn of the drawing about its origin, counter-clockwise in x-z [degrees].")
    axis: Direction | None = Field(
        None, description="In 3-D, along what the drawing is turned, right-handed [-]; [0, -1, 0] when absent."
    )
    density: Positive | None = Field(None, description="Density [kg/m3].")
    mass: Positive | None = Field(None, description="Mass, instead of the density [kg], in 2-D [kg/m].")
    centre: Point | None = Field(None, description="Centre of mass, as drawn [m]; that of the shape when absent.")
    inertia: Moments | None = Field(
        None,
        description="Moment of inertia about the centre [kg m2/m], in 3-D the three [Jx, Jy, Jz] along the axes of the "
        "drawing [kg m2]; that of the shape when absent.",
    )
    velocity: Point | None = Field(None, description="Velocity at the start or the release [m/s]; at rest when absent.")
    spin: Real | Triple | None = Field(
        None,
        description="Spin at the start or the release, counter-clockwise; in 3-D [wx, wy, wz] [rad/s]; none if absent.",
    )
    locked: tuple[Literal["x", "y", "z", "angle", "turn_x", "turn_y", "turn_z"], ...] = Field(
        (), description="Ways in which it cannot move [-]: x, z and angle, in 3-D x, y, z, turn_x, turn_y and turn_z."
    )
    motion: BodyMotion | None = Field(None, description="A prescribed motion instead.")
    hold: Switch = Field(False, description="Whether it is kept where it is until the release at t = 0 [-].")
    contact: Touch = Field(Touch(), description="How it touches walls and other bodies.")
    color: Annotated[str, Field(pattern=COLOR)] | None = Field(
        None, description='Colour in pictures, as "#rrggbb" [-]; from a palette when absent.'
    )

    @model_validator(mode="after")
    def _is_possible(self) -> Body:
        self._need_one_of("density", "mass")
        if self.motion:
            for name in ("velocity", "spin", "hold", "locked"):
                if getattr(self, name):
                    raise _fault("contradicts its prescribed motion", name)
        return self


class Gauge(Part):
    """A place where the level of the free surface is recorded."""

    name: Name = Field(description="Name of the gauge [-]; its record is gauges/NAME.csv.")
    x: Real = Field(description="Where it stands, x [m].")
    y: Real | None = Field(None, description="Where it stands, y [m]; needed in 3-D.")
    bottom: Real | None = Field(
        None, description="Height z at which the search for the surface ends [m]; the lowest wall point when absent."
    )


class WarmUp(Part):
    """Settling before the release, from t = -duration to t = 0."""

    duration: Positive = Field(description="How long the settling lasts [s].")
    damping: NotNegative = Field(description="Rate at which velocity is damped meanwhile [1/s].")
    settling: NotNegative | None = Field(
        None,
        description="How long a fill keeps the density of rest while its particles find their places [s]; half the "
        "duration when absent.",
    )

    @property
    def settling_time(self) -> float:
        """How long a fill keeps the density of rest [s]."""
        return 0.5 * self.duration if self.settling is None else min(self.settling, self.duration)


class Run(Part):
    """When to stop, and how far a step reaches."""

    end_time: Positive = Field(description="End of the run [s]; t = 0 is the release.")
    courant: Annotated[Real, Field(gt=0, le=1)] = Field(
        0.5, description="Courant number: dt = courant h / (c + u) [-]."
    )
    integrator: Literal["verlet", "predictor_corrector", "runge_kutta"] = Field(
        "verlet",
        description="How a step is taken [-]: verlet, predictor_corrector (Heun) or runge_kutta (midpoint rule), all "
        "of second order; verlet keeps energy best; predictor_corrector does not move bodies.",
    )
    max_steps: Annotated[int, Field(strict=True, gt=0)] | None = Field(
        None, description="Greatest number of steps [-]; no limit when absent."
    )


class View(Part):
    """The window of a picture."""

    x: Range = Field(description="From x to x [m].")
    z: Range = Field(description="From z to z [m].")


class Output(Part):
    """What is written while the scene runs."""

    frames_per_second: Positive = Field(30.0, description="Pictures and USD frames [1/s].")
    samples_per_second: Positive = Field(200.0, description="Lines of the records of gauges, energy and fluids [1/s].")
    pictures: Switch = Field(True, description="Whether to draw PNG frames and an animation [-].")
    usd: Switch = Field(True, description="Whether to write a USD point cache [-].")
    checkpoint_every: Positive = Field(0.5, description="Simulated time from one checkpoint to the next [s].")
    view: View | None = Field(None, description="Window of the pictures [m]; around everything when absent.")
    speed_scale: Positive | None = Field(
        None, description="Speed at which the colours of the pictures end [m/s]; a guess from gravity when absent."
    )


class Scene(Part):
    """A whole scene file."""

    title: str = Field(description="One line for reports [-].")
    source: str = Field("", description="Where the case comes from [-].")
    dimensions: Literal[2, 3] = Field(
        2, description="Dimensions of space [-]; a 2-D scene lies in the x-z plane, points of a 3-D one are [x, y, z]."
    )
    spacing: Positive = Field(description="Particle spacing dx [m].")
    gravity: NotNegative = Field(9.81, description="Gravity along -z [m/s2].")
    body_force: Point | None = Field(
        None, description="Acceleration of all fluid besides gravity [u, w], in 3-D [u, v, w] [m/s2]; none when absent."
    )
    smoothing: Smoothing = Field(Smoothing(), description="The smoothing kernel.")
    materials: Annotated[dict[Name, Material], Field(min_length=1)] = Field(description="Materials by name.")
    viscosity: Literal["signal", "monaghan"] = Field(
        "signal", description="Artificial viscosity [-]: signal (all pairs) or monaghan (approaching pairs only)."
    )
    viscosity_beta: NotNegative = Field(0.0, description="Quadratic coefficient beta of the monaghan viscosity [-].")
    laminar: Laminar = Field(Laminar(), description="How forces come of the materials' own viscosities.")
    density_diffusion: DensityDiffusion = Field(DensityDiffusion(), description="Diffusion of density.")
    continuity: Literal["plain", "renormalised"] = Field(
        "plain",
        description="Divergence in the rate of density [-]: plain, the partner of the pressure force, or renormalised, "
        "exact for linear velocities in disorder and at a surface, for which energy is kept less well.",
    )
    density_filter: DensityFilter = Field(DensityFilter(), description="Density made anew, now and then.")
    shifting: Shifting = Field(Shifting(), description="A drift that keeps particles in order.")
    tensile_correction: Switch = Field(True, description="Whether to correct the tensile instability [-].")
    xsph: Annotated[Real, Field(ge=0, le=1)] = Field(0.5, description="XSPH smoothing of the velocity, epsilon [-].")
    neighbours: Literal["lists", "cells"] = Field(
        "lists", description="How pair loops find neighbours [-]: lists (fast), or the cells around (little memory)."
    )
    walls: tuple[Wall, ...] = Field((), description="Walls.")
    wall_model: WallModel = Field(WallModel(), description="How walls push fluid away.")
    images: tuple[Image, ...] = Field((), description="Mirrors and periodic edges.")
    fluids: Annotated[tuple[Fluid, ...], Field(min_length=1)] = Field(
        description="Bodies of fluid; a later one leaves out places closer than one spacing to an earlier one."
    )
    bodies: tuple[Body, ...] = Field((), description="Rigid bodies.")
    gauges: tuple[Gauge, ...] = Field((), description="Wave gauges.")
    warm_up: WarmUp | None = Field(None, description="Settling before the release; none when absent.")
    run: Run = Field(description="When to stop, and how far a step reaches.")
    output: Output = Field(Output(), description="What is written while the scene runs.")
    allow: tuple[Literal["low_sound_speed"], ...] = Field((), description="Refusals to turn into warnings [-].")

    _source: SourceMap = PrivateAttr(default_factory=SourceMap)

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

    def error(self, path: str, message: str) -> SceneError:
        """A `SceneError` about the field at `path` (such as `fluids[1].shape`), for the caller to raise."""
        return self._source.error(path, message)

    def resolved_yaml(self) -> str:
        """The scene with every default filled in, as YAML that loads back to an equal `Scene`."""
        data = self.model_dump(mode="json", exclude_none=True)
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)

    @model_validator(mode="before")
    @classmethod
    def _rest_in_space(cls, data: Any) -> Any:
        # Rest is the default, and has as many components as the scene has dimensions.
        if isinstance(data, dict) and data.get("dimensions") == 3 and isinstance(data.get("fluids"), (list, tuple)):
            rest = {"velocity": (0.0, 0.0, 0.0)}
            fluids = [rest | fluid if isinstance(fluid, dict) else fluid for fluid in data["fluids"]]
            return data | {"fluids": fluids}
        return data

    @model_validator(mode="after")
    def _holds_together(self) -> Scene:
        for path, message in _contradictions(self):
            raise _fault(message, path)
        return self


def _contradictions(scene: Scene) -> Iterator[tuple[str, str]]:
    """What no single field can know: (path, message) for whatever does not fit the rest of the scene."""
    if scene.dimensions == 3 and scene.wall_model.force.startswith("monaghan_kos"):
        law = scene.wall_model.force
        yield "wall_model.force", f"{law} needs walls that are lines; in a 3-D scene take radial or lennard_jones"
    if scene.neighbours == "cells" and scene.density_diffusion.model == "antuono":
        yield "neighbours", "antuono's diffusion of density needs lists"
    needs = {
        "images": scene.images,
        "the materials' own viscosity": any(material.laminar for material in scene.materials.values()),
        "shifting": scene.shifting.model != "none",
        "a density_filter": scene.density_filter.model != "none",
    }
    for name, is_there in needs.items():
        if scene.neighbours == "cells" and is_there:
            yield "neighbours", f"lists are needed for {name}"
    flowing = [scene.materials[fluid.material] for fluid in scene.fluids if fluid.material in scene.materials]
    if scene.shifting.velocity == "local" and not any(material.laminar for material in flowing):
        yield "shifting.velocity", "local needs a fluid with a viscosity of its own"
    yield from _misplaced(scene)
    if scene.images:
        if scene.bodies:
            yield "bodies", "a scene with images has no bodies: they would not be seen through them"
        if scene.density_diffusion.model == "antuono":
            yield "density_diffusion.model", "antuono does not know images; take fourtakas"
    for kind in ("walls", "images", "fluids", "bodies", "gauges"):
        seen: dict[str, int] = {}
        for i, part in enumerate(getattr(scene, kind)):
            # Records are files named after the part, and some file systems do not tell A from a.
            first = seen.setdefault(part.name.casefold(), i)
            if first != i:
                yield f"{kind}[{i}].name", f"'{part.name}' is the name of {kind}[{first}] already"
    for i, fluid in enumerate(scene.fluids):
        if fluid.material not in scene.materials:
            hint = nearest(fluid.material, scene.materials)
            yield f"fluids[{i}].material", f"no material named '{fluid.material}'{hint}"
        if fluid.fill and fluid.fill.above not in (names := [wall.name for wall in scene.walls]):
            yield f"fluids[{i}].fill.above", f"no wall named '{fluid.fill.above}'{nearest(fluid.fill.above, names)}"
    kinds = {name: law.regularisation or "bi_viscous" for name, law in _yielding(scene).items()}
    for name, kind in kinds.items():
        if kind != (first := next(iter(kinds.values()))):
            path = f"materials.{name}.rheology.regularisation"
            yield path, f"one for all materials of a scene is needed, and another one has {first}"
    for i, body in enumerate(scene.bodies):
        yield from ((f"bodies[{i}].{path}", message) for path, message in _impossible_start(scene, body))
    if scene.bodies and scene.run.integrator == "predictor_corrector":
        yield "run.integrator", "predictor_corrector does not move bodies; take verlet or runge_kutta"


def _yielding(scene: Scene) -> dict[str, Rheology]:
    """The laws with a yield stress, by material."""
    laws = {name: material.rheology for name, material in scene.materials.items()}
    return {name: law for name, law in laws.items() if law and law.yield_stress is not None}


def _impossible_start(scene: Scene, body: Body) -> Iterator[tuple[str, str]]:
    """(path, message) where a body is to move as it cannot."""
    for i, lock in enumerate(body.locked):
        if lock not in LOCKS[scene.dimensions]:
            yield f"locked[{i}]", f"'{lock}' means nothing in a {scene.dimensions}-D scene"
    shifts = dict(zip("xz" if scene.dimensions == 2 else "xyz", body.velocity or (), strict=False))
    turns = {"angle": body.spin or 0.0}
    if scene.dimensions == 3:
        turns = dict(zip(("turn_x", "turn_y", "turn_z"), body.spin or (), strict=False))
    for name, starts in {"velocity": shifts, "spin": turns}.items():
        for way, value in starts.items():
            if value and way in body.locked:
                yield name, f"starts with {value:g} along '{way}', which is locked"


def _misplaced(scene: Scene) -> Iterator[tuple[str, str]]:
    """(path, message) for whatever belongs to a scene of the other number of dimensions."""
    points: dict[str, tuple[float, ...] | None] = {}  # has as many numbers as the scene has dimensions
    spatial: dict[str, Any] = {}  # not in 2-D
    needed: dict[str, Any] = {}  # not in 2-D, and never absent in 3-D
    plane: dict[str, Any] = {}  # not in 3-D
    scalars: dict[str, tuple[Any, str]] = {}  # have three numbers in 3-D, which are called so

    def sort_out(path: str, part: Wall | Shape) -> None:
        if part.box:
            points.update({f"{path}.box.min": part.box.min, f"{path}.box.max": part.box.max})
            spatial[f"{path}.box.open"] = getattr(part.box, "open", None)
        elif not getattr(part, "sphere", None):
            needed[f"{path}.width"] = part.width

    for i, wall in enumerate(scene.walls):
        sort_out(f"walls[{i}]", wall)
    points["body_force"] = scene.body_force
    for i, image in enumerate(scene.images):
        for kind, names in {"mirror": ("point", "normal", "velocity"), "periodic": ("start", "end")}.items():
            if part := getattr(image, kind):
                points |= {f"images[{i}].{kind}.{name}": getattr(part, name) for name in names}
    for i, fluid in enumerate(scene.fluids):
        points[f"fluids[{i}].velocity"] = fluid.velocity
        if fluid.lattice:
            points[f"fluids[{i}].lattice.origin"] = fluid.lattice.origin
        if fluid.shape:
            sort_out(f"fluids[{i}].shape", fluid.shape)
            spatial[f"fluids[{i}].shape.sphere"] = fluid.shape.sphere
    for i, body in enumerate(scene.bodies):
        path = f"bodies[{i}]"
        if body.shape.box:
            points.update({f"{path}.shape.box.{end}": getattr(body.shape.box, end) for end in ("min", "max")})
        points |= {f"{path}.{name}": getattr(body, name) for name in ("at", "centre", "velocity")}
        if body.motion:
            points |= {f"{path}.motion.{name}": getattr(body.motion, name) for name in ("shift", "pivot")}
        spatial |= {f"{path}.shape.{name}": getattr(body.shape, name) for name in ("sphere", "mesh")}
        spatial |= {
            f"{path}.{name}": value for name in ("spin", "inertia") if isinstance(value := getattr(body, name), tuple)
        }
        spatial[f"{path}.axis"] = body.axis
        spatial[f"{path}.motion.axis"] = body.motion.axis if body.motion else None
        plane |= {f"{path}.shape.{name}": getattr(body.shape, name) for name in ("polygon", "disc", "path")}
        scalars |= {f"{path}.spin": (body.spin, "[wx, wy, wz]"), f"{path}.inertia": (body.inertia, "[Jx, Jy, Jz]")}
    needed |= {f"gauges[{i}].y": gauge.y for i, gauge in enumerate(scene.gauges)}

    numbers = {2: "two numbers", 3: "three numbers"}[scene.dimensions]
    for path, point in points.items():
        if point is not None and len(point) != scene.dimensions:
            yield path, f"{numbers} are needed in a {scene.dimensions}-D scene, not {len(point)}"
    if scene.dimensions == 3:
        yield from ((path, "this field is missing, in a 3-D scene") for path, value in needed.items() if value is None)
        for path, value in plane.items():
            if value is not None:
                yield path, "means nothing in a 3-D scene; it goes with 'dimensions: 2'"
        for path, (value, names) in scalars.items():
            if value is not None and not isinstance(value, tuple):
                yield path, f"three numbers {names} are needed in a 3-D scene"
    else:
        for path, value in (spatial | needed).items():
            if value is not None:
                yield path, "means nothing in a 2-D scene; it goes with 'dimensions: 3'"


# ------------------------------------------------------------------------------------------------------------- loading


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a scene file, for editors."""
    return Scene.model_json_schema()


def load_scene(path: Path | str, overrides: Sequence[str] = ()) -> Scene:
    """Read the scene file at `path`, with `overrides` such as `materials.water.alpha=0.03` on top.

    Raises SceneError for a file that cannot be read, is not YAML, or is not a scene: for its first mistake.
    """
    data, source = read_yaml(read_text(path), str(path))
    if data is None:
        raise SceneError(f"{path}: the file is empty")
    if not isinstance(data, dict):
        raise source.error("", f"a scene is a mapping of fields, not {show(data)}")
    for override in overrides:
        apply_override(data, source, override)
    _find_files(data, Path(path).parent)
    try:
        scene = Scene.model_validate(data)
    except ValidationError as error:
        found = error.errors(include_url=False)
        # A list counts as too short when its entries are wrong: the entries are what to name.
        found = [mistake for mistake in found if mistake["type"] != "too_short"] or found
        mistakes = [_explain(mistake) for mistake in found]
        raise source.error(*min(mistakes, key=lambda mistake: source.place(mistake[0])[0])) from None
    scene._source = source
    return scene


def _find_files(data: dict[str, Any], folder: Path) -> None:
    """Make the paths of files that a scene names absolute, so that the scene of the run folder finds them too."""
    bodies = data.get("bodies")
    for body in bodies if isinstance(bodies, list) else ():
        shape = body.get("shape") if isinstance(body, dict) else None
        for part in (
            shape.get("mesh") if isinstance(shape, dict) else None,
            isinstance(body, dict) and body.get("motion"),
        ):
            if isinstance(part, dict) and isinstance(part.get("file"), str):
                part["file"] = str((folder / part["file"]).resolve())


_NEEDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping of fields",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_PATTERNS = {NAME: "a name made of letters, digits and _ is needed", COLOR: 'a colour such as "#8a6a4a" is needed'}


def _explain(mistake: Mapping[str, Any]) -> tuple[str, str]:
    """(path, message) of one mistake that pydantic found, in our words."""
    path = ""
    for key in mistake["loc"]:
        if isinstance(key, int):
            path += f"[{key}]"
        elif not key.startswith(("<", "[")):  # pydantic's marks for "which of a union" and "the key itself"
            path += f".{key}" if path else key
    kind, value, context = mistake["type"], mistake["input"], mistake.get("ctx", {})
    if kind == "fault":
        inner = context["path"]
        return (f"{path}.{inner}" if path and inner else path + inner), context["message"]
    if kind == "missing":
        return path, "this field is missing"
    if kind in _NEEDS:
        return path, f"{_NEEDS[kind]} is needed, not {show(value)}"
    if kind in _BOUNDS:
        bound, words = _BOUNDS[kind]
        return path, f"must be {words} {context[bound]:g}, not {show(value)}"
    if kind == "literal_error":
        names = re.findall(r"[\w.]+", context["expected"].replace(" or ", " "))
        return path, f"{show(value)} is not known here{nearest(value, names)}"
    if kind == "string_pattern_mismatch":
        return path, f"{_PATTERNS[context['pattern']]}, not {show(value)}"
    if kind == "too_short":
        return path, f"needs {context['min_length']} or more entries, not {context['actual_length']}"
    return path, mistake["msg"]
