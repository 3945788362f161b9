"""Packing: fluid that no lattice fits is set evenly between the dummies of its walls before anything moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import warp as wp

from warpsph.device.launch import bound, launch
from warpsph.kernels.packing import pack_kernel
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.placement.bodies import Solid
from warpsph.placement.dummies import Dummies
from warpsph.placement.fluids import Sites
from warpsph.scene.scene import Scene
from warpsph.shapes.points import Array, near

# Sweeps go on until nothing drifts farther in one than this, in spacings.
EVEN = 2e-4
MOST_SWEEPS = 400
# Rounds of so many more: what found no room in one stays where it was in the next.
MOST_ROUNDS, MORE_SWEEPS = 16, 100
# Layers around what a wall cuts that are free to give way, in spacings.
FREE = 8.0
# Nothing is set closer to a dummy, in spacings.
CLOSEST = 0.6
# Nor farther from where it was, in spacings.
FARTHEST = 1.5


def pack(scene: Scene, fluids: Sequence[Sites], position: Array, dummies: Dummies, solids: Sequence[Solid]) -> Array:
    """Places of all particles [m], shape [n, 3], of which those around cells that a wall cuts stand evenly now."""
    cut = np.concatenate([sites.cut for sites in fluids])
    if not cut.any():
        return position
    filled = np.repeat([bool(sites.mirrors) for sites in fluids], [len(sites.position) for sites in fluids])
    free = filled & near(position, position[cut], FREE * scene.spacing)
    volume = np.repeat([sites.volume for sites in fluids], [len(sites.position) for sites in fluids])
    surfaces = [solid.body.surface for solid in solids]
    walls = np.concatenate([dummies.position, *(surface.points for surface in surfaces)])
    room = np.concatenate([dummies.volume, *(surface.shares for surface in surfaces)])
    mirrors = [mirror for sites in fluids if sites.cut.any() for mirror in sites.mirrors]
    kernel, h, dx = SMOOTHING[scene.smoothing.kernel], scene.smoothing_length, scene.spacing
    reach = kernel.support * h
    # Points near free ones, and no others, counted from a corner: in single precision.
    low, high = position[free].min(axis=0) - 2.0 * reach, position[free].max(axis=0) + 2.0 * reach
    beside = np.flatnonzero(np.all((position > low) & (position < high), axis=1))
    around = np.all((walls > low) & (walls < high), axis=1)
    points = np.concatenate([position[beside], walls[around]]) - low
    volumes = np.concatenate([volume[beside], room[around]])
    mobility = np.concatenate([np.where(free[beside], 1.0, -1.0), np.zeros(int(around.sum()))])
    normals = np.array([normal for normal, _ in mirrors]).reshape(-1, 3)
    offsets = np.array([offset - normal @ low for normal, offset in mirrors])
    norm = kernel.normalisation[scene.dimensions] / h ** (scene.dimensions + 2)
    cells = np.minimum(np.ceil((high - low) / reach).astype(int), 128).tolist()
    holds = [sites.holds for sites in fluids if sites.mirrors]

    def evened(sweeps: int) -> Array:
        """The points after so many sweeps, or as many as it takes."""
        with wp.ScopedDevice("cpu"):
            here = wp.array(points, dtype=wp.vec3)
            there = wp.empty_like(here)
            grid, pack = wp.HashGrid(*cells), pack_kernel(scene.smoothing.kernel)
            given = {"grid": grid.id, "h": h, "gradient_norm": norm, "spacing": dx} | {
                "in_plane": int(scene.dimensions == 2),
                "plane_normal": wp.array(normals, dtype=wp.vec3),
                "plane_offset": wp.array(offsets, dtype=float),
                "volume": wp.array(volumes, dtype=float),
                "mobility": wp.array(mobility, dtype=float),
            }
            to_and_fro = [
                [0, *bound(pack, (), given | {"position": one, "position_out": other})]
                for one, other in ((here, there), (there, here))
            ]
            for sweep in range(sweeps):
                grid.build(here, reach)
                launch(pack, len(points), to_and_fro[sweep % 2])
                here, there = there, here
                if sweep % 10 == 0 and np.abs(here.numpy() - there.numpy()).max() < EVEN * dx:
                    break
            return here.numpy().astype(np.float64)

    for sweeps in (MOST_SWEEPS, *[MORE_SWEEPS] * MOST_ROUNDS):
        points = evened(sweeps)
        # Where water thins out over a bed there is no room: what would go through it stays where it was.
        moved = np.flatnonzero(mobility > 0.0)
        packed, before = points[moved] + low, position[beside[moved]]
        fits = (
            np.any([one(packed) for one in holds], axis=0)
            & ~near(packed, walls, CLOSEST * dx)
            & (np.linalg.norm(packed - before, axis=1) < FARTHEST * dx)
        )
        if fits.all():
            break
        # The others must make room for it again.
        points[moved[~fits]] = before[~fits] - low
        mobility[moved[~fits]] = -1.0
    axes = np.array([0, 1, 2] if scene.dimensions == 3 else [0, 2])
    position = position.copy()
    position[np.ix_(beside[moved], axes)] = (points[moved] + low)[:, axes]
    return position
