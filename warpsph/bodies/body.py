"""A rigid body on the host, as it is at the start: what it weighs, its shape, and what holds it.

In 2-D a body is a slice 1 m wide. A refusal is a ValueError of one line, for the scene to put a place before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from warpsph.bodies.motion import Motion
from warpsph.shapes.mesh import Mesh
from warpsph.shapes.outline import Outline
from warpsph.shapes.points import Array
from warpsph.shapes.sampling import Surface
from warpsph.shapes.section import MassProperties


@dataclass(frozen=True)
class Body:
    """A rigid body as it is at the start.

    Attributes:
        name: As in the scene.
        mass: See `MassProperties`.
        surface: Its points.
        outline: In 2-D the exact outline, counter-clockwise, for contact.
        mesh: In 3-D the exact surface, for contact.
        ball: Centre [m], shape [3], and radius [m] of a sphere, which touches as one and not as its mesh.
        velocity: Of the centre [m/s], shape [3].
        spin: [rad/s], shape [3], positive from z to x about y.
        free_shift, free_turn: 1 where it may move along an axis or turn about it, 0 where that is locked, shape [3].
        motion: Prescribed; then loads do not move it.
        release: Held until then [s].
        restitution: Speed after a bounce over speed before.
        static_friction, dynamic_friction: Coulomb's coefficients.
    """

    name: str
    mass: MassProperties
    surface: Surface
    outline: Outline | None = None
    mesh: Mesh | None = None
    ball: tuple[Array, float] | None = None
    velocity: Array | Sequence[float] = (0.0, 0.0, 0.0)
    spin: Array | Sequence[float] = (0.0, 0.0, 0.0)
    free_shift: Array | Sequence[float] = (1.0, 1.0, 1.0)
    free_turn: Array | Sequence[float] = (1.0, 1.0, 1.0)
    motion: Motion | None = None
    release: float = -math.inf
    restitution: float = 0.0
    static_friction: float = 0.0
    dynamic_friction: float = field(default=0.0)

    def __post_init__(self) -> None:
        start = {"velocity": self.velocity, "spin": self.spin}
        for (name, values), free in zip(start.items(), (self.free_shift, self.free_turn), strict=True):
            for axis, value, is_free in zip("xyz", values, free, strict=True):
                if value and not is_free:
                    raise ValueError(f"its initial {name} of {value:g} is about a locked axis, {axis}")
                if value and self.motion:
                    raise ValueError(f"its initial {name} contradicts its prescribed motion")
        if not 0.0 <= self.restitution <= 1.0:
            raise ValueError(f"a restitution of {self.restitution:g} is not between 0 and 1")
        if not 0.0 <= self.dynamic_friction <= self.static_friction:
            raise ValueError(
                f"friction must not be less at rest ({self.static_friction:g}) than in motion "
                f"({self.dynamic_friction:g}), nor negative"
            )


# The x-z plane: neither along y, nor about x or z.
PLANE_SHIFT = (1.0, 0.0, 1.0)
PLANE_TURN = (0.0, 1.0, 0.0)
