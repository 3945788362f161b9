"""Schemes in a scene file: what suits each of them where a scene says nothing, and what each of them lacks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, Literal

Scene = Any  # of scene.py, which imports this file

SchemeName = Literal["weakly_compressible", "mueller"]


@dataclass(frozen=True)
class Traits:
    """What other rooms ask of a scheme.

    Attributes:
        list_reach: Radius of the lists of neighbours, over h; by the smoothing kernel's support when absent.
        shares_mass: Whether it makes the mass of a particle so that the density is right, whatever the volume.
        bytes: Its own arrays, a particle, less those of the weakly compressible scheme that it does without.
    """

    list_reach: float | None = None
    shares_mass: bool = False
    bytes: float = 0.0


# The kernels of mueller end at h, half as far as the kernel that instruments read with; it has half a step's velocity
# and impulses of walls, and no rates.
TRAITS: Mapping[str, Traits] = {
    "weakly_compressible": Traits(),
    "mueller": Traits(list_reach=1.6, shares_mass=True, bytes=16.0),
}

# What a scheme has in place of the general defaults; `*` stands for every entry. It knows nothing else there.
ONLY: Mapping[str, Mapping[str, Any]] = {
    "mueller": {
        "materials.*.state_equation": "linear",
        "materials.*.alpha": 0.0,
        "density_diffusion.model": "none",
        "tensile_correction": False,
        "wall_model.force": "reflecting",
        "run.integrator": "leapfrog",
    },
}
# Fields that suit it, and may be set otherwise.
SUITS: Mapping[str, Mapping[str, Any]] = {"mueller": {"smoothing.ratio": 1.3}}


def suited(data: dict[str, Any]) -> dict[str, Any]:
    """The fields of a scene as they were read; a field that is left out has the value of the scheme."""
    scheme = data.get("scheme")
    if isinstance(scheme, str):
        for path, value in {**ONLY.get(scheme, {}), **SUITS.get(scheme, {})}.items():
            data = _with_default(data, path.split("."), value)
    return data


def _with_default(data: dict[str, Any], keys: list[str], value: Any) -> dict[str, Any]:
    key, *rest = keys
    if key == "*":
        entries = {name: _with_default(one, rest, value) for name, one in data.items() if isinstance(one, dict)}
        return data | entries
    if not rest:
        return {key: value} | data
    inner = data.get(key, {})
    return data | {key: _with_default(inner, rest, value)} if isinstance(inner, dict) else data


def strange_to_scheme(scene: Scene) -> Iterator[tuple[str, str]]:
    """(path, message) for whatever the scene's scheme does not know, or needs and is not given."""
    if scene.scheme == "mueller":
        yield from _strange_to_mueller(scene)
        return
    words = "goes with the scheme mueller"
    if scene.wall_model.force == "reflecting":
        yield "wall_model.force", f"reflecting {words}"
    if scene.run.integrator == "leapfrog":
        yield "run.integrator", f"leapfrog {words}"
    if scene.run.time_step is not None:
        yield "run.time_step", f"{words}; other steps are as long as they may be, by run.courant"


def _strange_to_mueller(scene: Scene) -> Iterator[tuple[str, str]]:
    known = ONLY["mueller"]
    values = {path: (reduce(getattr, path.split("."), scene), only) for path, only in known.items() if "*" not in path}
    of_materials = {path.removeprefix("materials.*."): only for path, only in known.items() if "*" in path}
    for name, material in scene.materials.items():
        values |= {
            f"materials.{name}.{field}": (getattr(material, field), only) for field, only in of_materials.items()
        }
        if material.rheology:
            yield f"materials.{name}.rheology", "the scheme mueller has no rheology; give a dynamic_viscosity"
    for path, (value, only) in values.items():
        if value != only:
            yield path, f"the scheme mueller knows {str(only).lower()} alone"
    lacks = {
        "dimensions": scene.dimensions == 3,
        "continuity": scene.continuity != "plain",
        "density_filter.model": scene.density_filter.model != "none",
        "shifting.model": scene.shifting.model != "none",
        "xsph": scene.xsph > 0.0,
        "neighbours": scene.neighbours == "cells",
        "images": bool(scene.images),
        "wave_maker": scene.wave_maker is not None,
        "bodies": bool(scene.bodies) and scene.wave_maker is None,
        "damping_zones": bool(scene.damping_zones),
        "forces": bool(scene.forces),
        "warm_up": scene.warm_up is not None,
        "run.absurd": scene.run.absurd != "stop",
    }
    yield from ((path, "the scheme mueller does not know this") for path, is_there in lacks.items() if is_there)
    if len({fluid.material for fluid in scene.fluids}) > 1:
        yield "fluids", "the scheme mueller knows one material in a scene, and particles of one mass"
    if len(scene.walls) != 1 or scene.walls[0].box is None:
        yield "walls", "the scheme mueller needs one wall, a box with all fluid within"
    if scene.run.time_step is None:
        yield "run.time_step", "this field is missing: the scheme mueller has a fixed step"
