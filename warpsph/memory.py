"""How much memory a scene takes, told before anything is allocated, and what would fit where it does not."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import warp as wp

from warpsph.kernels.density import BY_GRADIENT
from warpsph.kernels.neighbours import BLOCK_EDGE
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.model import box_of_cells, has_dummies, list_capacity, wall_radius
from warpsph.placement.drawing import solid, wall_surface
from warpsph.placement.dummies import layer_count
from warpsph.placement.images import find_edges
from warpsph.placement.origin import localised
from warpsph.placement.place import Placement
from warpsph.placement.sound import round_up
from warpsph.rheology import Viscous, viscous
from warpsph.scene.contradictions import wants_lists
from warpsph.scene.scene import Scene
from warpsph.scene.schemes import TRAITS
from warpsph.shapes.outline import Array
from warpsph.shapes.points import BLOCK, around, inside_box
from warpsph.shapes.wall import Wall
from warpsph.step.bodies import MOST_MOTION

# Of the interpreter, numpy, Warp, Matplotlib and USD, and of the kernels of a scene, as measured [bytes].
PROGRAM = 420e6
# At most this share of the free memory is asked for.
MOST_SHARE = 0.97


class NoRoomError(Exception):
    """There is not enough memory; the text is one line that says what would fit."""


@dataclass(frozen=True)
class Counts:
    """What the size of all arrays comes from.

    Attributes:
        particles, walls: How many particles and wall points there are.
        wet: How many of the wall points lie in or around the box of a fluid.
        bodies: Points on bodies.
        ghosts: Particles that are seen through an edge.
        box: Lower and upper corner of the box around particles and walls [m].
    """

    particles: float
    walls: float
    wet: float
    bodies: float
    ghosts: float
    box: tuple[Array, Array]

    def coarser(self, times: float, dimensions: int) -> Counts:
        """The same at a spacing so many times as wide."""
        surface, volume = times ** (1 - dimensions), times**-dimensions
        return replace(
            self,
            particles=self.particles * volume,
            walls=self.walls * surface,
            wet=self.wet * surface,
            bodies=self.bodies * surface,
            ghosts=self.ghosts * surface,
        )


@dataclass(frozen=True)
class Memory:
    """What a run takes at its peak [bytes].

    Attributes:
        arrays: On the device.
        placing: On the host until the arrays are there.
        outputs: On the host while a frame is written.
        shared: Whether device and host have one memory, as on a CPU.
    """

    arrays: float
    placing: float
    outputs: float
    shared: bool

    @property
    def host(self) -> float:
        """The peak on the host, program included [bytes]."""
        arrays = self.arrays if self.shared else 0.0
        return PROGRAM + max(self.placing, arrays + self.outputs)


def counts_of(scene: Scene, placement: Placement) -> Counts:
    """The counts of a scene that has been placed."""
    # Wall points stand back, and the first row of particles off the wall.
    back = _layers(scene) if has_dummies(scene) else scene.wall_model.set_back
    wet, reach, end = 0, (back + 0.51) * scene.spacing, 0
    boxes = []
    for count in placement.counts:
        mine = placement.position[end : end + count]
        end += count
        lower, upper = around(mine)
        boxes.append((lower - reach, upper + reach))
    walls = placement.dummies.position if has_dummies(scene) else placement.wall_position
    for begin in range(0, len(walls), BLOCK):
        some = walls[begin : begin + BLOCK]
        wet += int(np.count_nonzero(np.any([inside_box(some, *box) for box in boxes], axis=0)))
    ghosts, edges = 0, find_edges(scene)[0]
    for begin in range(0, len(placement.position) if edges else 0, BLOCK):
        some = placement.position[begin : begin + BLOCK]
        ghosts += sum(int(np.sum(some @ edge.normal - edge.offset < _list_radius(scene))) for edge in edges)
    bodies = sum(len(one.body.surface.points) for one in placement.solids)
    return Counts(len(placement.position), len(walls), wet, bodies, ghosts, around(walls, placement.position))


def rough_counts(scene: Scene) -> Counts:
    """About the counts of a scene, from its drawing alone: bodies, ghosts and what fluids take from each other are left
    out."""
    walls = [wall_surface(scene, i) for i in range(len(scene.walls))]
    names = [wall.name for wall in scene.walls]
    particles, corners = 0.0, []
    for fluid in scene.fluids:
        if fluid.fill:
            bed = walls[names.index(fluid.fill.above)]
            lower, upper = bed.box()
            upper[2] = fluid.fill.level
            if fluid.fill.between:
                lower[0], upper[0] = np.clip(fluid.fill.between, lower[0], upper[0])
            particles += _filled(scene, bed, lower, upper) / scene.spacing**scene.dimensions
            corners += [lower, upper]
        elif fluid.shape:
            body = solid(scene, fluid.shape)
            particles += body.volume / scene.spacing**scene.dimensions
            corner = body.first_corner()
            corners.append(corner)
    corners += [corner for wall in walls for corner in wall.box()]
    points = sum(one.area for one in walls) / scene.wall_spacing ** (scene.dimensions - 1)
    points *= _layers(scene) if has_dummies(scene) else 1.0
    return Counts(particles, points, 0.5 * points, 0.0, 0.0, (np.min(corners, axis=0), np.max(corners, axis=0)))


def _filled(scene: Scene, bed: Wall, lower: Array, upper: Array) -> float:
    """Volume, in 2-D area, of the part of a box that a wall carries [m3 or m2]."""
    size = np.maximum(upper - lower, 0.0)
    count = [64, 1 if scene.dimensions == 2 else 8, 64]
    places = [a + s * (np.arange(n) + 0.5) / n for a, s, n in zip(lower, size, count, strict=True)]
    points = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 3)
    share = float(bed.carries(points, float(upper[2])).mean())
    return share * float(np.prod(size if scene.dimensions == 3 else size[[0, 2]]))


def memory_of(scene: Scene, counts: Counts, shared: bool) -> Memory:
    """What a run takes; `shared` says whether the device is the host."""
    return Memory(_arrays(scene, counts), _placing(scene, counts), _outputs(scene, counts), shared)


def _layers(scene: Scene) -> int:
    """Of dummy particles behind a wall."""
    return layer_count(SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length, scene.spacing)


def _list_radius(scene: Scene) -> float:
    return list_capacity(scene)[1]


def _arrays(scene: Scene, counts: Counts) -> float:
    """Bytes of the arrays on the device: of State, Viscosity, Neighbours, Cells, Ghosts, Coupling and Model."""
    law = viscous(scene, wp.get_device("cpu"))
    averages = scene.run.integrator == "predictor_corrector"
    a_particle = 192.0
    a_particle += 12.0 * (scene.density_diffusion.model in BY_GRADIENT) + 24.0 * averages
    a_particle += 8.0 * (scene.density_filter.model != "none") + 4.0 * (scene.shifting.model != "none")
    a_particle += 4.0  # first wall point
    a_particle += TRAITS[scene.scheme].bytes
    if law:
        a_particle += 12.0 * law.balanced + 8.0 * (law.law is not None) + 16.0 + 8.0 + 12.0 + 36.0
        a_particle += 4.0 * (law.law is None) + 12.0 * law.balanced + 16.0 * has_dummies(scene)
        a_particle += 52.0 * (law.stages > 1) + 16.0 * (scene.dimensions**2 // 3 if law.form == "stress" else 0)
    if scene.neighbours != "cells":
        a_particle += 8.0 + 4.0 * list_capacity(scene)[0]
    if scene.images:
        a_particle += 8.0
    if scene.bodies:
        a_particle += 8.0
    if scene.overtopping:
        a_particle += 52.0
    grid = box_of_cells(scene, *counts.box, counts.walls > 0, int(counts.particles))
    a_cell = 9.0 + 28.0 / 27.0 + 4.0 / 27.0
    # Entries of the list of walls: a wall point is on the lists of the particles in a cap of the ball around it.
    near = _in_cap(scene, wall_radius(scene))
    support = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
    beyond = int(BLOCK_EDGE) / grid.inverse_edge + (MOST_MOTION - 0.5) * support
    a_body = 120.0 + 4.0 * 1.25 * _in_cap(scene, max(support + scene.wall_spacing, _list_radius(scene)) + beyond)
    return (
        a_particle * counts.particles
        + a_cell * math.prod(grid.count)
        + (4.0 * math.prod(grid.count) if scene.images else 0.0)
        + (_a_dummy(law) if has_dummies(scene) else 60.0) * counts.walls
        + (5.0 * math.prod(grid.count) if has_dummies(scene) else 0.0)
        + 4.0 * 1.25 * near * counts.wet
        + a_body * counts.bodies
        + 76.0 * 1.25 * counts.ghosts
    )


def _a_dummy(law: Viscous | None) -> float:
    """Bytes of a dummy particle of a wall."""
    return 224.0 + (16.0 * (2 + (law.stages > 1)) if law else 0.0)


def _in_cap(scene: Scene, radius: float) -> float:
    """Particles within `radius` [m] of a point that stands back behind a plane wall."""
    reach = radius / scene.spacing
    back = 0.5 * _layers(scene) if has_dummies(scene) else scene.wall_model.set_back
    high = max(reach - back, 0.0)
    if scene.dimensions == 3:
        return math.pi * high**2 * (3.0 * reach - high) / 3.0
    return reach**2 * math.acos(min(back / reach, 1.0)) - back * math.sqrt(max(reach**2 - back**2, 0.0))


def _placing(scene: Scene, counts: Counts) -> float:
    """Bytes of a placement, and of the first arrays that are made of it."""
    a_particle = 36.0 + 8.0 + 48.0 + 4.0
    a_wall = 56.0 + 48.0 + 60.0 + 28.0
    return a_particle * counts.particles + a_wall * counts.walls


def _outputs(scene: Scene, counts: Counts) -> float:
    """Bytes of a snapshot, and of the copies that taking it or making a frame of it needs: about as much."""
    if not (scene.output.pictures or scene.output.usd or scene.output.vtk):
        return 0.0
    return 124.0 * counts.particles


# ----------------------------------------------------------------------------------------------------- what there is


def free_memory(device: wp.Device) -> float:
    """What is free on a device, or on the host for a CPU [bytes]; without end where nobody tells."""
    if device.is_cuda:
        return float(device.free_memory)
    free = math.inf
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration, ValueError, IndexError):
        if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
            free = float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    try:
        limit, used = (int(Path(f"/sys/fs/cgroup/memory.{name}").read_text("ascii")) for name in ("max", "current"))
        inactive = Path("/sys/fs/cgroup/memory.stat").read_text("ascii").split()
        cached = int(inactive[inactive.index("inactive_file") + 1])  # files that can be let go
        free = min(free, float(limit - used + cached))
    except (OSError, ValueError, IndexError):  # there is no such file, or it says "max"
        pass
    return free


def refuse_too_big(scene: Scene, counts: Counts, device: wp.Device, slack: float = 1.0) -> None:
    """Raises NoRoomError for a run that takes more than `slack` times the free memory of the device or the host."""
    if words := _no_room(scene, counts, device, slack):
        raise NoRoomError(words)


def with_neighbours(scene: Scene, device: wp.Device) -> Scene:
    """The scene with `neighbours: auto` made lists, or cells where only these fit.

    Lists are nowhere slower, as measured: whole steps with cells take 1.4 times (plane) and 2.5 times (space) as long
    on CPU cores, 1.0 and 1.9 times on an H100.
    """
    if scene.neighbours != "auto":
        return scene
    lists, cells = (scene.model_copy(update={"neighbours": name}) for name in ("lists", "cells"))
    if wants_lists(scene):
        return lists
    counts = rough_counts(scene)
    return cells if _no_room(lists, counts, device, 1.0) and not _no_room(cells, counts, device, 1.0) else lists


def out_of_memory(scene: Scene, device: wp.Device) -> str:
    """One line for a run that found no more memory."""
    scene = localised(scene)
    counts = rough_counts(scene)
    words = _no_room(scene, counts, device, 0.0)
    return f"out of memory: {words}"


def _no_room(scene: Scene, counts: Counts, device: wp.Device, slack: float) -> str:
    """Why a run does not fit, and which spacing would; nothing where it fits."""
    shared = not device.is_cuda
    limits = {"this machine": free_memory(wp.get_device("cpu"))}
    if not shared:
        limits = {"this device": free_memory(device), **limits}

    def wanted(some: Counts) -> list[float]:
        memory = memory_of(scene, some, shared)
        return [memory.host] if shared else [memory.arrays, memory.host]

    for k, (name, free) in enumerate(limits.items()):
        need = wanted(counts)[k]
        if need <= slack * free:
            continue
        words = f"needs about {_size(need)}, {name} has {_size(free)} free"
        times = 1.0
        while times < 1e3 and any(
            need > MOST_SHARE * free
            for need, free in zip(wanted(counts.coarser(times, scene.dimensions)), limits.values(), strict=True)
        ):
            times *= 1.02
        if times >= 1e3:
            return f"{words}, which is not enough for any scene"
        if times == 1.0:
            return words
        return f"{words}; spacing={round_up(times * scene.spacing):g} would fit"
    return ""


def _size(value: float) -> str:
    return f"{value / 1e9:.3g} GB" if value >= 1e9 else f"{value / 1e6:.3g} MB"
