"""What the parts of a scene file are made of: numbers, points and names, and mappings that know their keys."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from warpsph.scene.source import show

NAME = r"^[A-Za-z][A-Za-z0-9_]*$"
COLOR = r"^#[0-9A-Fa-f]{6}$"

# A number beyond these is a slip of the pen: no figure of a flow that is drawn is, and products of a few are still
# far from where single precision ends.
LEAST, MOST = 1e-12, 1e12
# Farther from zero than this no map goes [m].
FARTHEST = 1e8
# Two places nearer than this are one [m].
NEAREST = 1e-9
# A longer name is longer than the name of a file may be.
LONGEST_NAME, LONGEST_TEXT = 64, 1000


def fault(message: str, path: str = "") -> PydanticCustomError:
    """A mistake found by a validator; `path` leads from the validated part to the field at fault."""
    return PydanticCustomError("fault", "{message}", {"message": message, "path": path})


def faults(found: Sequence[tuple[str, str]]) -> PydanticCustomError:
    """Several mistakes found by one validator: (path, message) of each."""
    return PydanticCustomError("faults", "{found}", {"found": list(found)})


def part_types(annotation: Any) -> Iterator[type[Part]]:
    """The parts in the type of a field."""
    if isinstance(annotation, type) and issubclass(annotation, Part):
        yield annotation
    for argument in get_args(annotation):
        yield from part_types(argument)


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
    if math.hypot(*value) < LEAST:
        raise fault("a direction is needed, not nothing")
    return value


def _zero_or_something(value: float) -> float:
    if 0.0 < value < LEAST:
        raise fault(f"must be 0, or at least {LEAST:g}, not {value:g}")
    return value


def _printable(value: str) -> str:
    if bad := next((letter for letter in value if not (letter.isprintable() or letter == "\n")), ""):
        raise fault(f"has the letter {bad!a}, which cannot be printed")
    return value


def _one_line(value: str) -> str:
    if "\n" in value:
        raise fault("must be one line")
    return value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-MOST, le=MOST)]
Positive = Annotated[Real, Field(ge=LEAST)]
NotNegative = Annotated[Real, Field(ge=0), AfterValidator(_zero_or_something)]
Coefficient = Annotated[NotNegative, Field(le=1e4)]
Coordinate = Annotated[Real, Field(ge=-FARTHEST, le=FARTHEST)]
Size = Annotated[Real, Field(ge=NEAREST, le=FARTHEST)]
Duration = Annotated[Real, Field(ge=1e-9, le=1e8)]
Rate = Annotated[Real, Field(ge=1e-8, le=1e6)]
Density = Annotated[Real, Field(ge=1e-3, le=1e5)]
Angle = Annotated[Real, Field(ge=-1e6, le=1e6)]
Switch = Annotated[bool, Field(strict=True)]
SwitchOrBounded = Annotated[
    Annotated[Switch, Tag("<switch>")] | Annotated[Literal["bounded"], Tag("<name>")],
    Discriminator(lambda value: "<name>" if isinstance(value, str) else "<switch>"),
]
Name = Annotated[str, Field(pattern=NAME, max_length=LONGEST_NAME)]
# That of another part, which is looked for when all is read.
Reference = Annotated[str, Field(max_length=LONGEST_NAME)]
Text = Annotated[str, Field(max_length=LONGEST_TEXT), AfterValidator(_printable)]
Line = Annotated[Text, AfterValidator(_one_line)]
Pair = Annotated[tuple[Coordinate, Coordinate], BeforeValidator(_numbers("two numbers [a, b]", 2))]
Triple = Annotated[tuple[Coordinate, Coordinate, Coordinate], BeforeValidator(_numbers("three numbers [x, y, z]", 3))]
Direction = Annotated[Triple, AfterValidator(_has_length)]
Moments = Annotated[
    Annotated[Positive, Tag("<number>")] | Annotated[tuple[Positive, Positive, Positive], Tag("<triple>")],
    Discriminator(lambda value: "<triple>" if isinstance(value, (list, tuple)) else "<number>"),
]


class DimensionMark:
    """What the type of a field says of its dimension, which only the whole scene can hold it to."""

    def fault(self, value: Any, part: Part, dimensions: int) -> str | None:
        """What is wrong with the value of the field of `part` in a scene of so many dimensions; None if nothing is."""
        raise NotImplementedError


@dataclass(frozen=True)
class NumbersOfPoint(DimensionMark):
    """A point has as many numbers as the scene has dimensions."""

    def fault(self, value: Any, part: Part, dimensions: int) -> str | None:
        """See `DimensionMark`."""
        if value is None or len(value) == dimensions:
            return None
        numbers = {2: "two numbers", 3: "three numbers"}[dimensions]
        return f"{numbers} are needed in a {dimensions}-D scene, not {len(value)}"


@dataclass(frozen=True)
class Only(DimensionMark):
    """A field that goes with one number of dimensions.

    Attributes:
        dimensions: With which.
        needed: Whether it is never absent there.
        unless: Fields beside it, one of which may be there instead of a needed one.
    """

    dimensions: int
    needed: bool = False
    unless: tuple[str, ...] = ()

    def fault(self, value: Any, part: Part, dimensions: int) -> str | None:
        """See `DimensionMark`."""
        if dimensions != self.dimensions:
            told = f"means nothing in a {dimensions}-D scene; it goes with 'dimensions: {self.dimensions}'"
            return told if value is not None else None
        if self.needed and value is None and not any(getattr(part, name, None) for name in self.unless):
            return f"this field is missing, in a {dimensions}-D scene"
        return None


@dataclass(frozen=True)
class ThreeInSpace(DimensionMark):
    """A number in the plane, and three in space, which are called `names`."""

    names: str

    def fault(self, value: Any, part: Part, dimensions: int) -> str | None:
        """See `DimensionMark`."""
        if isinstance(value, tuple):
            return IN_SPACE.fault(value, part, dimensions)
        if value is not None and dimensions == 3:
            return f"three numbers {self.names} are needed in a 3-D scene"
        return None


@dataclass(frozen=True)
class Along:
    """A field that names places, which count from the origin of the scene.

    Attributes:
        axes: Along which axis its numbers count; empty for points, of which it goes by how many numbers they have.
    """

    axes: str


PLACE = Along("")

IN_PLANE, IN_SPACE = Only(2), Only(3)
# How far a shape drawn in the plane reaches across; a box and a sphere know it themselves.
ACROSS = Only(3, needed=True, unless=("box", "sphere"))

Point = Annotated[
    Annotated[tuple[Coordinate, Coordinate], Tag("<2>")]
    | Annotated[tuple[Coordinate, Coordinate, Coordinate], Tag("<3>")],
    Discriminator(lambda value: f"<{len(value)}>"),
    BeforeValidator(_numbers("two numbers [a, b] (three in a 3-D scene)", 2, 3)),
    NumbersOfPoint(),
]
Range = Annotated[Pair, AfterValidator(_increasing)]


class Part(BaseModel):
    """A mapping of the scene file: no field beyond the known ones, nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def _need_one_of(self, *names: str) -> None:
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise fault(f"exactly one of {', '.join(names)} is needed, not {' and '.join(given) or 'none'}")


def _marks_in(annotation: Any) -> Iterator[DimensionMark]:
    for argument in get_args(annotation):
        if isinstance(argument, DimensionMark):
            yield argument
        yield from _marks_in(argument)


@cache
def marks_of(kind: type[Part]) -> Mapping[str, tuple[DimensionMark, ...]]:
    """The marks of each field of a kind of part."""
    found = {}
    for name, field in kind.model_fields.items():
        outermost = (one for one in field.metadata if isinstance(one, DimensionMark))
        found[name] = (*outermost, *_marks_in(field.annotation))
    return found


@cache
def places_of(kind: type[Part]) -> Mapping[str, str]:
    """The fields of a kind of part that name places, with the axes of their marks."""
    marked = {
        name: [one for one in field.metadata if isinstance(one, Along)] for name, field in kind.model_fields.items()
    }
    return {name: marks[-1].axes for name, marks in marked.items() if marks}


def parts_within(value: Any, path: str = "") -> Iterator[tuple[str, Part]]:
    """All parts of a scene within `value`, itself included, each with its path such as `fluids[1].shape`."""
    if isinstance(value, Part):
        yield path, value
        for name in type(value).model_fields:
            yield from parts_within(getattr(value, name), f"{path}.{name}" if path else name)
    elif isinstance(value, tuple):
        for i, one in enumerate(value):
            yield from parts_within(one, f"{path}[{i}]")
    elif isinstance(value, dict):
        for key, one in value.items():
            yield from parts_within(one, f"{path}.{key}")
