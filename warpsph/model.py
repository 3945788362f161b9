"""Model: everything about a run that does not change from step to step."""

from __future__ import annotations

import math

import numpy as np
import warp as wp

from warpsph.device.cells import Cells, cell_grid
from warpsph.device.launch import Launcher
from warpsph.kernels.damping import Zones
from warpsph.kernels.layout import CPU_LAYOUT, CUDA_LAYOUT
from warpsph.kernels.neighbours import BLOCK_EDGE, CellGrid, mark_walls
from warpsph.kernels.parameters import Parameters
from warpsph.kernels.rates import Formulas
from warpsph.kernels.smoothing import SMOOTHING
from warpsph.kernels.walls import BY_LEG
from warpsph.placement.damping import damping_zones
from warpsph.placement.images import Edge, Image, find_images, image_struct
from warpsph.placement.place import Placement
from warpsph.rheology import viscous
from warpsph.scene.fluids import Material
from warpsph.scene.scene import Scene
from warpsph.scene.schemes import TRAITS
from warpsph.shapes.points import BLOCK, around

# The lists reach this much farther than the support, so that they outlive a few steps: a longer reach costs every pair
# loop (1 + skin)^2, a shorter one costs a rebuild more often.
SKIN = 0.1
# The same for wall points. They stand still, so that lists outlive some steps of flow along a wall only with a longer
# reach; few particles pay for it in a plane, more in space, where walls are surfaces.
WALL_SKIN = {2: 0.4, 3: 0.15}
# How far bodies may move before their dummies are listed anew, in supports.
BODY_SKIN = 0.2
# Rows hold this many times the neighbours of an undisturbed lattice; a fuller row makes the list grow.
ROOM = 1.18
# A particle lighter or denser than this, relative to its own material, has left the physics of a liquid.
LEAST_COMPRESSION, MOST_COMPRESSION = 0.5, 2.0

# Position, velocity, density and fluid of particles.
Initial = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class Model:
    """Constants of a run: parameters for kernels, walls with their grid, initial particles, the choice of formulas.

    Attributes:
        particle_count: Number of fluid particles.
        top: Height of the highest particle at the start [m].
        ground: Height of the lowest point of the walls [m].
        viscous: The materials' own viscosities; None where there are none.
        sides: Side of each wall on which the fluid is, as `wet_side`.
        zones: Damping zones as kernels read them; None where there are none.
        grid: Cells over the scene.
        images: Mirrors and periodic edges as kernels read them; None where there are none.
        edges, seen_images: The same on the host, as `find_images` gives them.
        wall_position: Wall points [m], on the device, sorted by cell, shape [wall_count].
        wall_velocity: Theirs, 0 [m/s], shape [wall_count].
        wall_normal: Unit normals towards the fluid, 0 where there is fluid on both sides, shape [wall_count].
        wall_before, wall_after: From each point to its neighbours on the wall [m], 0 where it ends, shape [wall_count].
        wall_volume: What each fills behind the wall, of dummy particles [m3, in 2-D m2], shape [wall_count].
        wall_way: From each dummy particle to its wall's nearest point [m], 0 where fluid slips, shape [wall_count].
        wall_line: Points on the walls themselves [m], and unit normals as of `wall_normal`, on the host.
        wall_start: Slots of the wall points of each cell, as in `Cells.start`.
        near_wall: Whether wall points may be on the list of a particle in a cell, shape [cell_count].
        wall_block: Whether there are wall points in a block of cells, shape [block_count].
    """

    def __init__(self, scene: Scene, placement: Placement, launcher: Launcher) -> None:
        self.scene = scene
        self.launcher = launcher
        self.layout = CUDA_LAYOUT if launcher.device.is_cuda else CPU_LAYOUT
        device = launcher.device
        materials = [scene.materials[fluid.material] for fluid in scene.fluids]

        self.particle_count = len(placement.position)
        density = hydrostatic_density(materials, placement, scene.gravity)
        self._initial: Initial | None = (placement.position, placement.velocity, density, placement.fluid)
        self.top, self.ground = float(placement.position[:, 2].max()), placement.ground
        self.sides = placement.sides
        self.fluid_names = [fluid.name for fluid in scene.fluids]
        self.spacing = scene.spacing
        self.support = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
        self.skin = SKIN * self.support
        capacity, self.list_radius = list_capacity(scene)
        self.wall_skin = WALL_SKIN[scene.dimensions] * self.support
        if TRAITS[scene.scheme].list_reach:  # with walls that are no points
            self.skin, self.wall_skin = self.list_radius - scene.smoothing_length, math.inf
        self.has_dummies = has_dummies(scene)
        self.body_skin = body_skin(scene)
        self.wall_radius = wall_radius(scene)
        walls = len(placement.wall_position) > 0

        self.formulas = Formulas(
            smoothing=scene.smoothing.kernel,
            artificial_viscosity=scene.artificial_viscosity,
            diffusion=scene.density_diffusion.model,
            tensile_correction=scene.tensile_correction,
            xsph=scene.xsph > 0.0,
            renormalised=scene.continuity == "renormalised",
            fluid_count=len(scene.fluids),
            dimensions=scene.dimensions,
            neighbours="cells" if scene.neighbours == "cells" else "lists",
            walled=self.has_dummies,
        )
        self.parameters = self._parameters(scene, placement, materials, capacity)
        self.viscous = viscous(scene, device)
        self.zones = _zones(scene, device)
        lower, upper = around(placement.wall_position, placement.dummies.position, placement.position)
        self.images, self.edges, self.seen_images = None, list[Edge](), list[Image]()
        if scene.images:
            self.edges, self.seen_images = find_images(scene, self.list_radius, *_with_room(scene, lower, upper, walls))
            self.images = image_struct(self.edges, self.seen_images, device)
        self.grid = box_of_cells(scene, lower, upper, walls, self.particle_count)
        # Lists are made anew before any particle has gone farther than this since it was listed [m].
        self.longest_motion = int(BLOCK_EDGE) / self.grid.inverse_edge - 0.5 * self.support
        points = placement.dummies.position if self.has_dummies else placement.wall_position
        cells = Cells(self.grid, wp.array(points, dtype=wp.vec3, device=device), launcher)
        cells.sort()
        order = cells.order.numpy()[: len(points)]

        def vectors(values: np.ndarray) -> wp.array:
            return wp.array(values[order], dtype=wp.vec3, device=device)

        self.wall_position, self.wall_line = vectors(points), (placement.wall_position, placement.wall_normal)
        ways = (placement.wall_normal, placement.wall_before, placement.wall_after)
        if self.has_dummies:
            self.wall_volume = wp.array(placement.dummies.volume[order], dtype=float, device=device)
            sticks = 1.0 if scene.wall_model.slip == "none" else 0.0
            self.wall_way = vectors(sticks * placement.dummies.to_wall)
            ways, order = (np.empty((0, 3)),) * 3, order[:0]
        self.wall_normal, self.wall_before, self.wall_after = map(vectors, ways)
        self.wall_velocity = wp.zeros_like(self.wall_position)
        self.wall_start = cells.start
        self.wall_block = wp.array(blocks_in_use(self.grid, cells.start.numpy()), dtype=int, device=device)
        self.near_wall = wp.zeros(len(cells.start) - 1, dtype=wp.uint8, device=device)
        reach = math.ceil(self.wall_radius * self.grid.inverse_edge)
        launcher.run(mark_walls, len(self.near_wall), self, cells=reach)

    def _parameters(self, scene: Scene, placement: Placement, materials: list[Material], capacity: int) -> Parameters:
        kernel = SMOOTHING[scene.smoothing.kernel]
        dimensions, dx, h = scene.dimensions, scene.spacing, scene.smoothing_length
        norm = kernel.normalisation[dimensions] / h**dimensions

        p = Parameters()
        p.dimensions = dimensions
        p.particle_count = self.particle_count
        p.smoothing_length, p.inverse_h = h, 1.0 / h
        p.kernel_norm, p.gradient_norm = norm, norm / h**2
        p.inverse_shape_dx = 1.0 / float(kernel.shape(dx / h))
        p.list_radius = self.list_radius
        p.list_capacity = capacity
        p.gravity = wp.vec3(*scene.acceleration)
        p.hydrostatic = wp.vec3(0.0, 0.0, -scene.gravity)
        p.artificial_viscosity_beta = scene.artificial_viscosity_beta
        p.xsph = scene.xsph
        p.diffusion = scene.density_diffusion.delta
        # beta points stand where one fluid particle would in the plane, beta^2 in space.
        points = scene.wall_model.refinement ** (dimensions - 1)
        p.inverse_spacing = 1.0 / dx
        p.wall_strength = scene.wall_model.strength / (1.0 if scene.wall_model.force in BY_LEG else points)
        p.wall_approach = scene.wall_model.approach
        p.courant = scene.run.courant
        p.least_compression, p.most_compression = LEAST_COMPRESSION, MOST_COMPRESSION
        p.lower, p.upper = domain(placement, 2.0 * h)
        if scene.wall_model.force == "reflecting":  # which brings back whatever goes through
            p.lower, p.upper = wp.vec3(-math.inf), wp.vec3(math.inf)

        def table(values: list[float]) -> wp.array:
            return wp.array(np.array(values, dtype=np.float32), device=self.launcher.device)

        # One entry more, for particles that have left: of a fluid that is held, and that no sum counts.
        materials, volumes = [*materials, materials[0]], [*placement.volume, placement.volume[0]]
        p.mass = table([material.density * volume for material, volume in zip(materials, volumes, strict=True)])
        p.rest_density = table([material.density for material in materials])
        p.sound_speed = table([material.sound_speed for material in materials])
        p.stiffening = table([1.0 if material.state_equation == "tait" else 0.0 for material in materials])
        p.alpha = table([material.alpha for material in materials])
        p.wall_alpha = table([material.wall_alpha / points for material in materials])
        p.still_level = table([*(fluid.fill.level if fluid.fill else -math.inf for fluid in scene.fluids), -math.inf])
        p.mobility = table([*(0.0 if fluid.hold else 1.0 for fluid in scene.fluids), 0.0])
        return p

    def take_initial(self) -> Initial:
        """Position [m], velocity [m/s], density [kg/m3] and fluid of the particles at the start, for a state to begin.

        They are had once: on the device they are needed, here they would only take memory.
        """
        initial, self._initial = self._initial, None
        assert initial is not None, "it has been taken"
        return initial


def _zones(scene: Scene, device: wp.Device) -> Zones | None:
    """The damping zones as kernels read them; None where there are none."""
    zones = damping_zones(scene)
    if not zones:
        return None
    struct = Zones()
    struct.count = len(zones)
    columns: dict[str, list[float]] = {"begin": [], "length": [], "rate": []}
    for zone in zones:
        columns["begin"].append(zone.begin)
        columns["length"].append(zone.end - zone.begin)
        columns["rate"].append(zone.rate)
    for name, values in columns.items():
        setattr(struct, name, wp.array(np.array(values, dtype=np.float32), device=device))
    return struct


def list_capacity(scene: Scene) -> tuple[int, float]:
    """How many neighbours a row has room for at first, and the radius of the lists [m]."""
    support = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
    reach = TRAITS[scene.scheme].list_reach
    radius = reach * scene.smoothing_length if reach else support + SKIN * support
    spacings = radius / scene.spacing
    return math.ceil(ROOM * (math.pi * spacings**2 if scene.dimensions == 2 else 4.19 * spacings**3)), radius


def wall_radius(scene: Scene) -> float:
    """Within which wall points are listed [m]."""
    support = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
    return support + WALL_SKIN[scene.dimensions] * support + body_skin(scene)


def has_dummies(scene: Scene) -> bool:
    """Whether walls are made of dummy particles."""
    return scene.wall_model.force == "dummy_particles" and bool(scene.walls)


def body_skin(scene: Scene) -> float:
    """How far bodies may move before their dummies are listed anew [m]."""
    support = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length
    return BODY_SKIN * support if has_dummies(scene) and scene.bodies else 0.0


def _with_room(scene: Scene, lower: np.ndarray, upper: np.ndarray, walls: bool) -> tuple[np.ndarray, np.ndarray]:
    """Where most of the fluid will be [m], each of shape [3], from the box around all points.

    What splashes higher counts to the uppermost; a scene without `walls` gets room on every side.
    """
    room = 0.0 if walls else 0.5 * (upper - lower)
    return lower - room, upper + room


def box_of_cells(scene: Scene, lower: np.ndarray, upper: np.ndarray, walls: bool, particles: int) -> CellGrid:
    """The cells of a scene; `lower` and `upper` [m], shape [3], are corners of the box around all points."""
    radius = list_capacity(scene)[1]
    lower, upper = _with_room(scene, lower, upper, walls)
    if scene.images:  # ghosts stand beyond the edges
        lower, upper = lower - radius, upper + radius
        if scene.dimensions == 2:
            lower[1], upper[1] = 0.0, 0.0
    return cell_grid(lower, upper, radius, scene.dimensions, particles)


def blocks_in_use(grid: CellGrid, start: np.ndarray) -> np.ndarray:
    """Whether there are points in each block of cells, shape [block_count]; `start` as `Cells` has it."""
    across, blocks, edge = tuple(grid.count)[::-1], tuple(grid.blocks)[::-1], int(BLOCK_EDGE)
    used = np.zeros([edge * n for n in blocks], dtype=bool)
    used[tuple(slice(n) for n in across)] = np.diff(start).reshape(across) > 0
    (a, b, c) = blocks
    return used.reshape(a, edge, b, edge, c, edge).any(axis=(1, 3, 5)).ravel().astype(np.int32)


def domain(placement: Placement, margin: float) -> tuple[wp.vec3, wp.vec3]:
    """The box that no particle may leave: around walls and fluid, `margin` wider [m], without a lid.

    A scene without walls has no box.
    """
    if not len(placement.wall_position):
        return wp.vec3(-math.inf), wp.vec3(math.inf)
    lower, upper = around(placement.wall_position, placement.position)
    lower, upper = lower - margin, upper + margin
    upper[2] = np.inf
    return wp.vec3(*lower), wp.vec3(*upper)


def hydrostatic_density(materials: list[Material], placement: Placement, gravity: float) -> np.ndarray:
    """Density [kg/m3], shape [particle_count], at which each fluid carries its own weight: p = rho0 g depth."""
    density = np.empty(len(placement.position))
    end = 0
    for material, count in zip(materials, placement.counts, strict=True):
        begin, end = end, end + count
        rho0, c = material.density, material.sound_speed
        for first in range(begin, end, BLOCK):
            mine = slice(first, min(first + BLOCK, end))
            compression = gravity * placement.initial_depth[mine] / c**2
            if material.state_equation == "tait":
                density[mine] = rho0 * (1.0 + 7.0 * compression) ** (1.0 / 7.0)
            else:
                density[mine] = rho0 * (1.0 + compression)
    return density
