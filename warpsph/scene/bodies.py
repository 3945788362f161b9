"""Rigid bodies in a scene file: mass, motion and touch."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from warpsph.scene.fields import (
    COLOR,
    IN_SPACE,
    PLACE,
    Angle,
    Coordinate,
    Density,
    Direction,
    Duration,
    Line,
    Moments,
    Name,
    NotNegative,
    Part,
    Point,
    Positive,
    Real,
    Switch,
    ThreeInSpace,
    Triple,
    fault,
)
from warpsph.scene.shapes import SolidField

LOCKS = {2: ("x", "z", "angle"), 3: ("x", "y", "z", "turn_x", "turn_y", "turn_z")}


class BodyMotion(Part):
    """A motion that is prescribed: a body goes its way whatever pushes it."""

    kind: Literal["constant", "ramp", "sine", "table"] = Field(description="Its course [-].")
    shift: Point | None = Field(
        None,
        description="Velocity of constant, and of ramp at last [m/s]; amplitude of sine [m]; none when absent.",
    )
    turn: Angle = Field(
        0.0, description="Rate of constant and ramp [degrees/s], amplitude of sine [degrees], counter-clockwise."
    )
    pivot: Annotated[Point | None, PLACE] = Field(
        None, description="What it turns about at the start [m]; the centre when absent."
    )
    axis: Annotated[Direction | None, IN_SPACE] = Field(
        None, description="In 3-D, along what it turns, right-handed [-]; [0, -1, 0] when absent."
    )
    begin: Coordinate = Field(0.0, description="When it begins [s].")
    period: Duration | None = Field(None, description="Period of sine, and how long ramp takes [s].")
    phase: Angle = Field(0.0, description="Phase of sine at its beginning [degrees].")
    file: Line | None = Field(
        None,
        description="CSV file of table, from the scene's folder [-]: time [s] and any of x, y, z [m], angle [deg].",
    )

    @model_validator(mode="after")
    def _has_what_it_needs(self) -> BodyMotion:
        needs = {"period": ("ramp", "sine"), "file": ("table",)}
        for name, kinds in needs.items():
            if self.kind in kinds and getattr(self, name) is None:
                raise fault(f"this field is missing: {self.kind} needs it", name)
            if self.kind not in kinds and getattr(self, name) is not None:
                raise fault(f"goes with {' and '.join(kinds)}, not with {self.kind}", name)
        if self.kind == "table" and (self.shift is not None or self.turn):
            raise fault("is in the table", "turn" if self.turn else "shift")
        if self.kind != "table" and self.shift is None and not self.turn:
            raise fault("a shift or a turn is needed")
        return self


class Touch(Part):
    """How a body touches walls and other bodies; of two bodies the geometric mean counts."""

    restitution: Annotated[Real, Field(ge=0, le=1)] = Field(0.0, description="Speed after a bounce over before [-].")
    static_friction: NotNegative = Field(0.0, description="Coefficient of Coulomb's friction at rest [-].")
    dynamic_friction: NotNegative = Field(0.0, description="The same in motion, not more than at rest [-].")

    @model_validator(mode="after")
    def _rubs_less_in_motion(self) -> Touch:
        if self.dynamic_friction > self.static_friction:
            raise fault(f"must be at most static_friction, {self.static_friction:g}", "dynamic_friction")
        return self


class BodyField(Part):
    """A rigid body, moved by the fluid, gravity and what it touches, or by a prescribed motion."""

    name: Name = Field(description="Name of the body [-]; its record is bodies/NAME.csv.")
    shape: SolidField = Field(description="Its shape, as drawn [m].")
    at: Annotated[Point | None, PLACE] = Field(
        None, description="Where the origin of the drawing is put [m]; where it is when absent."
    )
    angle: Angle = Field(0.0, description="Turn of the drawing about its origin, counter-clockwise in x-z [degrees].")
    axis: Annotated[Direction | None, IN_SPACE] = Field(
        None, description="In 3-D, along what the drawing is turned, right-handed [-]; [0, -1, 0] when absent."
    )
    density: Density | None = Field(None, description="Density [kg/m3].")
    mass: Positive | None = Field(None, description="Mass, instead of the density [kg], in 2-D [kg/m].")
    centre: Annotated[Point | None, PLACE] = Field(
        None, description="Centre of mass, as drawn [m]; the shape's own when absent."
    )
    inertia: Annotated[Moments | None, ThreeInSpace("[Jx, Jy, Jz]")] = Field(
        None,
        description="Moment of inertia about the centre [kg m2/m], in 3-D the three [Jx, Jy, Jz] along the axes of the "
        "drawing [kg m2]; the shape's own when absent.",
    )
    velocity: Point | None = Field(None, description="Velocity at the start or the release [m/s]; at rest when absent.")
    spin: Annotated[Angle | Triple | None, ThreeInSpace("[wx, wy, wz]")] = Field(
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
    def _is_possible(self) -> BodyField:
        self._need_one_of("density", "mass")
        if self.motion:
            for name in ("velocity", "spin", "hold", "locked"):
                if getattr(self, name):
                    raise fault("contradicts its prescribed motion", name)
        return self
