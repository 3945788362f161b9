"""What a frame tells of each particle besides where it is: listed once for whatever writes frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from warpsph.state import Snapshot


@dataclass(frozen=True)
class Field:
    """A field of a frame.

    Attributes:
        name: In files.
        description: With its unit.
        values: Of a snapshot, of shape [particle_count] or [particle_count, 3]; None where it has no such field.
        is_whole: Whether values are whole numbers.
        is_rheological: Whether only fluids with a rheology have it.
    """

    name: str
    description: str
    values: Callable[[Snapshot], np.ndarray | None]
    is_whole: bool = False
    is_rheological: bool = False


FIELDS = (
    Field("velocity", "Velocity [m/s].", lambda snapshot: snapshot.velocity),
    Field("speed", "Speed [m/s].", lambda snapshot: np.linalg.norm(snapshot.velocity, axis=1)),
    Field("pressure", "Pressure [Pa].", lambda snapshot: snapshot.pressure),
    Field("density", "Density [kg/m3].", lambda snapshot: snapshot.density),
    Field("fluid", "Number of the fluid in the scene, from 0.", lambda snapshot: snapshot.fluid, is_whole=True),
    Field("id", "The same number for the same particle in every frame.", lambda snapshot: snapshot.id, is_whole=True),
    Field(
        "apparent_viscosity",
        "Apparent viscosity [Pa s].",
        lambda snapshot: snapshot.apparent_viscosity,
        is_rheological=True,
    ),
    Field(
        "yielded",
        "1 where the fluid flows, 0 where it is a plug.",
        lambda snapshot: snapshot.yielded,
        is_whole=True,
        is_rheological=True,
    ),
)


def fields_of(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """The values of all fields that a snapshot has, by name."""
    found = {field.name: field.values(snapshot) for field in FIELDS}
    return {name: values for name, values in found.items() if values is not None}
