"""Tanks and drops: the scenes that tests of several rooms stand on, put together from a few parts.

A part is a mapping of the scene file; `scene` makes the text of such a file, for `make_scene` or a file of its own.
"""

import math
from collections.abc import Sequence
from typing import Any

import yaml

Point = Sequence[float]

DUMMIES = "wall_model: {force: dummy_particles}"
# Walls that push, in texts that are not loaded by `make_scene`, which says the same.
PUSHING_WALLS = "wall_model: {force: radial}\nsmoothing: {kernel: wendland_c2, ratio: 1.5}"


def scene(
    title: str,
    spacing: float,
    walls: Sequence[dict[str, Any]] = (),
    fluids: Sequence[dict[str, Any]] = (),
    *lines: str,
    sound_speed: float = 20.0,
    end_time: float = 1.0,
    dimensions: int = 2,
    **water: float,
) -> str:
    """A scene of water, 1000 kg/m3, of which `water` says more; other fields are `lines` of YAML."""
    known = {"density": 1000.0, "sound_speed": sound_speed, **water}
    fields = {
        "title": title,
        "dimensions": dimensions,
        "spacing": spacing,
        "materials": {"water": known},
        "walls": list(walls),
        "fluids": list(fluids),
    }
    written = [_written({name: value}) for name, value in fields.items() if value != []]
    return "\n".join(["", *written, *lines, _written({"run": {"end_time": end_time}}), ""])


def _written(field: dict[str, Any]) -> str:
    """A field of the scene file on a line of its own."""
    return yaml.safe_dump(field, default_flow_style=True, sort_keys=False, width=math.inf)[1:-2]


def tank(width: float, height: float, left: float = 0.0, name: str = "tank", **fields: Any) -> dict[str, Any]:
    """A wall: two upright ends with a bed between them, at z = 0, open above."""
    right = left + width
    return {"name": name, "path": [[left, height], [left, 0.0], [right, 0.0], [right, height]], **fields}


def crate(*size: float, name: str = "tank") -> dict[str, Any]:
    """A wall: the faces of a box in space from the origin on, open above."""
    return {"name": name, "box": {"min": [0.0] * len(size), "max": list(size), "open": ["top"]}}


def pool(level: float, above: str = "tank", name: str = "water", **fields: Any) -> dict[str, Any]:
    """A fluid: water at rest up to a level; `between` which ends, if not from wall to wall."""
    between = {"between": fields.pop("between")} if "between" in fields else {}
    return {"name": name, "material": "water", "fill": {"level": level, "above": above, **between}, **fields}


def block(low: Point, high: Point, name: str = "water", **fields: Any) -> dict[str, Any]:
    """A fluid: water from one corner to the other."""
    return {"name": name, "material": "water", "shape": {"box": {"min": list(low), "max": list(high)}}, **fields}


def drop(radius: float, center: Point = (0.0, 0.0), name: str = "drop", **fields: Any) -> dict[str, Any]:
    """A fluid: a disc of water."""
    return {"name": name, "material": "water", "shape": {"disc": {"center": list(center), "radius": radius}}, **fields}
