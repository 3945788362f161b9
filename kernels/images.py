"""Images: mirrors and periodic edges as isometries of space, and the ghosts that particles see through them.

An image is a reflection, a translation or a product of such: x' = R x + t. The scene within repeats itself through all
of them, without a gap, so that a sum over particles and ghosts is a sum over unbounded fluid. A ghost is its particle,
seen through one image. Ghosts stand behind the particles in the packed arrays, so that pair loops need not know them.

What a ghost carries:

    x' = R x + t,    u' = R u,    p' = p + rho g . (x' - x) by the reflections alone,    V' = V rho / rho'

so that nothing passes a mirror, and fluid at rest is at rest there too: a pressure that is only copied (Vasco 2014,
6.1.2) has no slope across the wall, and lets it fall in. Friction sees another velocity, `velocity_beyond`.
"""

import warp as wp

from .neighbours import BLOCK_EDGE, CellGrid, cell_at, place_of
from .parameters import Parameters


@wp.struct
class Images:
    """The images of a scene. Arrays of the first group have one entry for each image, of the second for each edge.

    Edges are the planes that bound the scene: mirrors, and both ends of each periodic pair. The image through which an
    edge is left has the edge's own number.
    """

    count: int
    rotation: wp.array[wp.mat33]  # R
    translation: wp.array[wp.vec3]  # t [m]
    mirror_translation: wp.array[wp.vec3]  # t without what periodic edges add to it [m]
    friction: wp.array[wp.mat33]  # F and f: the velocity that friction sees is F u + f
    friction_velocity: wp.array[wp.vec3]  # f [m/s]
    extrapolates: wp.array[int]  # 1: that velocity is extrapolated from the wall instead
    wall_normal: wp.array[wp.vec3]  # of that wall, into the fluid
    wall_offset: wp.array[float]  # its points have normal . x = offset [m]
    wall_velocity: wp.array[wp.vec3]  # its own, along itself [m/s]

    edge_count: int
    edge_normal: wp.array[wp.vec3]  # into the scene
    edge_offset: wp.array[float]  # points of the scene have normal . x >= offset [m]


@wp.func
def distance_inside(normal: wp.vec3, offset: float, x: wp.vec3) -> float:
    """How far x lies on the scene's side of a plane [m]."""
    return wp.dot(normal, x) - offset


@wp.func
def velocity_beyond(images: Images, k: int, x_i: wp.vec3, u_i: wp.vec3, x_j: wp.vec3, u_j: wp.vec3) -> wp.vec3:
    """Velocity [m/s] that the friction on particle i sees at the ghost of particle j through image k.

        free_slip          R u_j
        no_slip_opposite   2 u_wall - u_j
        no_slip_wall       u_wall
        takeda             u_wall - (d_j / d_i) (u_i - u_wall), with 1 + d_j / d_i <= 1.5

    Vasco (2014) 6.1.2, rules a, b and c; Takeda, Miyama & Sekiya (1994), limited by Morris, Fox & Zhu (1997). d is the
    distance from the wall, that of a ghost being that of its particle.
    """
    if images.extrapolates[k] == 0:
        return images.friction[k] * u_j + images.friction_velocity[k]
    normal, offset, u_wall = images.wall_normal[k], images.wall_offset[k], images.wall_velocity[k]
    d_i = wp.max(distance_inside(normal, offset, x_i), 1.0e-12)
    d_j = wp.max(distance_inside(normal, offset, x_j), 0.0)
    return u_wall - wp.min(d_j / d_i, 0.5) * (u_i - u_wall)
