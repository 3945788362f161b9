"""The origin of a scene: a drawing far from zero, on a map, is placed and run from a point nearby.

Single precision, in which pairs of particles are summed, has steps of 0.03 m at x = 412,345 m. So the numbers of the
scene are shifted once, before anything is placed, and what leaves a run has the origin added again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from decimal import Decimal
from typing import Any

from warpsph.scene.bodies import BodyField
from warpsph.scene.fields import PLACE, Part, places_of
from warpsph.scene.scene import Scene

# A drawing that reaches no farther from zero than so many spacings, or than so many times its own size, is left there.
NEAR_SPACINGS, NEAR_SIZES = 2000.0, 2.0


def localised(scene: Scene) -> Scene:
    """The scene as it is seen from its origin, which `Scene.origin` tells; the same where that is 0."""
    if any(scene.origin):
        return scene
    by = find_origin(scene)
    if not any(by.values()):
        return scene
    local = _moved(scene, by)
    if local.wave_maker:  # from its own numbers: sums of large ones would be rounded
        local = local.model_copy(update={"bodies": (*local.bodies[:-1], local.paddle(local.wave_maker))})
    local._origin = tuple(float(by[axis]) for axis in "xyz")
    return local


def find_origin(scene: Scene) -> dict[str, int]:
    """The origin along each axis [m]: 0 near zero, and else the whole metre that is nearest to the least coordinate.

    So a scene that is moved by whole metres from one far place to another is the same scene seen from its origin, and
    also one that is drawn at zero with its least coordinates from -0.5 m to less than 0.5 m.
    """
    drawn: dict[str, list[float]] = {"x": [], "y": [], "z": []}
    parts: list[Any] = [*scene.walls, *(part for fluid in scene.fluids for part in (fluid.shape, fluid.fill) if part)]
    parts += [body for body in scene.bodies if body.at] + [body.shape for body in scene.bodies if not body.at]
    for part in parts:
        for axis, value in _numbers(part):
            drawn[axis].append(value)
    size = max(max(values) - min(values) for values in drawn.values() if values)
    near = max(NEAR_SPACINGS * scene.spacing, NEAR_SIZES * size)
    return {
        axis: math.floor(Decimal(repr(min(values))) + Decimal("0.5"))
        if max(map(abs, values), default=0.0) > near
        else 0
        for axis, values in drawn.items()
    }


def _axes(value: Any, axes: str) -> str:
    return axes * len(value) if axes else "xz" if len(value) == 2 else "xyz"


def _numbers(value: Any, axes: str | None = None) -> Iterator[tuple[str, float]]:
    """Axis and coordinate [m] of all places in a part of a scene."""
    if isinstance(value, BodyField):
        value, axes = value.at, PLACE.axes
    if isinstance(value, Part):
        for name in type(value).model_fields:
            yield from _numbers(getattr(value, name), places_of(type(value)).get(name))
    elif isinstance(value, tuple) and value and isinstance(value[0], (tuple, Part)):
        for one in value:
            yield from _numbers(one, axes)
    elif isinstance(value, tuple) and axes is not None:
        yield from zip(_axes(value, axes), value, strict=True)
    elif isinstance(value, float) and axes:
        yield axes, value


def _moved(value: Any, by: Mapping[str, int], axes: str | None = None) -> Any:
    """The same with `by` [m] taken off each coordinate in it; the same object where there is none."""
    if isinstance(value, BodyField):
        return _moved_body(value, by)
    if isinstance(value, Part):
        places = places_of(type(value))
        fields = {name: getattr(value, name) for name in type(value).model_fields}
        moved = {name: _moved(old, by, places.get(name)) for name, old in fields.items()}
        changed = {name: new for name, new in moved.items() if new is not fields[name]}
        return value.model_copy(update=changed) if changed else value
    if isinstance(value, tuple) and value and isinstance(value[0], (tuple, Part)):
        parts = tuple(_moved(one, by, axes) for one in value)
        return parts if any(new is not old for new, old in zip(parts, value, strict=True)) else value
    if isinstance(value, tuple) and axes is not None:
        return tuple(_less(one, by[axis]) for one, axis in zip(value, _axes(value, axes), strict=True))
    if isinstance(value, float) and axes:
        return _less(value, by[axes])
    return value


def _moved_body(body: BodyField, by: Mapping[str, int]) -> BodyField:
    """A body elsewhere: drawn there, or, where its drawing is put or turned or comes from a file, put there."""
    motion = _moved(body.motion, by)
    if body.at is None and not body.angle and not body.shape.mesh:
        centre = _moved(body.centre, by, PLACE.axes)
        return body.model_copy(update={"shape": _moved(body.shape, by), "centre": centre, "motion": motion})
    at = body.at or (0.0,) * (3 if body.shape.mesh or body.shape.sphere or _is_in_space(body) else 2)
    return body.model_copy(update={"at": _moved(at, by, PLACE.axes), "motion": motion})


def _is_in_space(body: BodyField) -> bool:
    return body.shape.box is not None and len(body.shape.box.min) == 3


def _less(value: float, origin: int) -> float:
    """`value` less `origin`, as one would have typed it: 412345.7 less 412345 is 0.7, to the last bit."""
    return float(Decimal(repr(float(value))) - origin)
