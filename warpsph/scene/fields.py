"""What the parts of a scene file are made of: numbers, points and names, and mappings that know their keys."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from warpsph.scene.source import nearest, show

NAME = r"^[A-Za-z][A-Za-z0-9_]*$"
COLOR = r"^#[0-9A-Fa-f]{6}$"


def fault(message: str, path: str = "") -> PydanticCustomError:
    """A mistake found by a validator; `path` leads from the validated part to the field at fault."""
    return PydanticCustomError("fault", "{message}", {"message": message, "path": path})


def _numbers(words: str, *counts: int) -> Callable[[Any], Any]:
    """A validator that wants a list with one of `counts`, called `words`."""

    def check(value: Any) -> Any:
        if not isinstance(value, (list, tuple)):
            raise fault(f"{words} are needed, not {show(value)}")
        if len(value) not in counts:
            raise fault(f"{words} are needed, not {len(value)}")
        return value

    return check


def _increasing(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise fault("the first must be less than the second")
    return value


def _has_length(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise fault("a direction is needed, not nothing")
    return value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0)]
NotNegative = Annotated[Real, Field(ge=0)]
Switch = Annotated[bool, Field(strict=True)]
SwitchOrBounded = Annotated[
    Annotated[Switch, Tag("<switch>")] | Annotated[Literal["bounded"], Tag("<name>")],
    Discriminator(lambda value: "<name>" if isinstance(value, str) else "<switch>"),
]
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
                    raise fault(f"no such field{nearest(key, cls.model_fields)}", str(key))
        return data

    def _need_one_of(self, *names: str) -> None:
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise fault(f"exactly one of {', '.join(names)} is needed, not {' and '.join(given) or 'none'}")
