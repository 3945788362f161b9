"""A scene that holds together: the model of a scene file, and facts about the scene as a whole."""

from __future__ import annotations

from typing import Any, Protocol

import yaml
from pydantic import PrivateAttr, ValidationError, model_validator

from warpsph.scene.bodies import BodyField, BodyMotion
from warpsph.scene.contradictions import contradictions
from warpsph.scene.fields import fault, faults
from warpsph.scene.mistakes import mistakes
from warpsph.scene.schemes import suited
from warpsph.scene.source import SceneError, SourceMap
from warpsph.scene.waves import PADDLE, WaveMaker
from warpsph.scene.whole import SceneFields


class Point(Protocol):
    """A place [x, y, z], whatever holds its numbers."""

    def __getitem__(self, axis: int, /) -> float:
        """The coordinate along an axis [m]."""


class Scene(SceneFields):
    """A whole scene file."""

    _source: SourceMap = PrivateAttr(default_factory=SourceMap)
    _origin: tuple[float, float, float] = PrivateAttr((0.0, 0.0, 0.0))

    @property
    def origin(self) -> tuple[float, float, float]:
        """What has been taken off all places of this scene [m], as `placement.origin` does; 0 as it was read."""
        return self._origin

    def spot(self, point: Point) -> str:
        """Where a point [x, y, z] of this scene [m] is, in words and in the coordinates of the user."""
        axes = "xz" if self.dimensions == 2 else "xyz"
        places = {axis: (point["xyz".index(axis)], self.origin["xyz".index(axis)]) for axis in axes}
        return ", ".join(f"{axis} = {place(*place_of)} m" for axis, place_of in places.items())

    def error(self, path: str, message: str) -> SceneError:
        """A `SceneError` about the field at `path` (such as `fluids[1].shape`), for the caller to raise."""
        if self.wave_maker and path.startswith(f"bodies[{len(self.bodies) - 1}]"):
            path = "wave_maker"  # nobody has written its paddle
        return self._source.error(path, message)

    def resolved_yaml(self) -> str:
        """The scene with every default filled in, as YAML that loads back to an equal `Scene`."""
        data = self.model_dump(mode="json", exclude_none=True)
        if self.wave_maker:
            data["bodies"].pop()  # the paddle, which comes of it
        return yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)

    def paddle(self, maker: WaveMaker) -> BodyField:
        """The paddle of a wave maker as a body, whose motion is found when it is placed."""
        thickness, low = maker.thickness or 6.0 * self.spacing, max(maker.bed, maker.hinge or maker.bed)
        left, right, high = maker.x - thickness, maker.x, maker.upper_edge
        shape: dict[str, Any] = {"box": {"min": (left, low), "max": (right, high)}}
        if self.dimensions == 3:
            front, back = maker.width or (0.0, 1.0)
            shape = {"box": {"min": (left, front, low), "max": (right, back, high)}}
        elif maker.paddle == "flap":
            # Its back is cut away below, so that it does not turn into the bed.
            cut = low + 0.3 * thickness
            shape = {"polygon": ((right, low), (right, high), (left, high), (left, cut))}
        try:
            body = BodyField.model_validate({"name": PADDLE, "shape": shape, "density": 1000.0})
        except ValidationError as error:  # of a size that no body has
            raise fault(f"its paddle cannot be drawn: {next(mistakes(error, BodyField))[1]}", "wave_maker") from None
        course: dict[str, Any] = {"kind": "waves"}  # which no scene can ask of a body
        motion = BodyMotion.model_construct(**course)
        return body.model_copy(update={"motion": motion})

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
        if self.wave_maker:
            self.__dict__["bodies"] = (*self.bodies, self.paddle(self.wave_maker))
        if found := list(contradictions(self)):
            raise faults(found)
        return self

    @model_validator(mode="before")
    @classmethod
    def _suit_the_scheme(cls, data: Any) -> Any:
        return suited(data) if isinstance(data, dict) else data

    @model_validator(mode="before")
    @classmethod
    def _know_new_words(cls, data: Any) -> Any:
        """Scenes from before real viscosity had the plain word say `viscosity` of the artificial one."""
        if isinstance(data, dict):
            for old, new in _RENAMED.items():
                if old in data:
                    raise fault(f"this field is called {new} now", old)
            if data.get("viscosity") in _ARTIFICIAL:
                raise fault(f"{data['viscosity']} is an artificial viscosity: write artificial_viscosity", "viscosity")
        return data


_ARTIFICIAL = ("signal", "monaghan")
_RENAMED = {"viscosity_beta": "artificial_viscosity_beta", "laminar": "viscosity"}


def place(coordinate: float, origin: float) -> str:
    """A coordinate of a scene [m] in words, `origin` [m] added: to four figures of the scene's size."""
    if not origin:
        return f"{coordinate:.4g}"
    return f"{coordinate + origin:.4f}".rstrip("0").rstrip(".")
