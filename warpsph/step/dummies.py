"""The dummy particles of a state: walls and bodies that stand behind its particles in the arrays pair loops read."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import warp as wp

from warpsph.device.cells import Cells
from warpsph.device.launch import Launch, alias
from warpsph.kernels import dummies as kernels
from warpsph.kernels.layout import Rows
from warpsph.kernels.neighbours import mark_walls, wall_points_kernel
from warpsph.model import Model
from warpsph.state import State
from warpsph.step.bodies import Coupling


class DummyLists:
    """The dummies of a state: those of walls, in the order of its model's, then those of bodies.

    Attributes:
        count: How many there are.
        first, list: Particles around dummy d are list[first[d] : first[d + 1]].
        power: What each did to the fluid when it was last told the pressure [W].
    """

    def __init__(self, model: Model, state: State, particles: Cells, bodies: Coupling | None) -> None:
        """`particles` are the cells of the particles."""
        self._model, self._state, self._particles, self._bodies = model, state, particles, bodies
        device, launcher = model.launcher.device, model.launcher
        self._at_rest = len(model.wall_position)
        self._moving = bodies.set.point_count if bodies else 0
        self.count = self._at_rest + self._moving
        state.make_room(self.count)
        room = model.wall_volume.numpy()
        way = np.zeros((self.count, 3), dtype=np.float32)  # bodies let fluid slip
        way[: self._at_rest] = model.wall_way.numpy()
        self._to_wall = wp.array(way, dtype=wp.vec3, device=device)
        if bodies:
            room = np.concatenate([room, *(solid.body.surface.shares for solid in bodies.solids)])
        self._room = wp.array(room, dtype=float, device=device)
        self._position, self._velocity, self._acceleration, self._listed = (
            wp.zeros(self.count, dtype=wp.vec3, device=device) for _ in range(4)
        )
        for places in (self._position, self._listed):
            wp.copy(places, model.wall_position)
        self.first = wp.zeros(self.count + 1, dtype=int, device=device)
        self.list = wp.zeros(1024, dtype=int, device=device)
        self.power = wp.zeros(self.count, dtype=float, device=device)
        self._cells = Cells(model.grid, self._listed, launcher)
        self._cells.sort()
        cells = len(self._cells.start) - 1
        self._anywhere = wp.full(cells, 1, dtype=wp.uint8, device=device)
        reach = math.ceil(model.wall_radius * model.grid.inverse_edge)
        self._mark = [
            launcher.record_in_order(mark_walls, cells, [model.grid, reach, self._cells.start, model.near_wall]),
            launcher.record_in_order(
                kernels.mark_blocks, len(model.wall_block), [model.grid, self._cells.start, model.wall_block]
            ),
        ]
        self._appended_to: Rows | None = None  # the lists that `append` is bound to
        self._record()

    def _record(self) -> None:
        """Bind the launches to the arrays as they are now."""
        m, s, n, record = self._model, self._state, self._model.particle_count, self._model.launcher.record_in_order
        around = [m.grid, m.wall_radius, self._anywhere, self._particles.start, self._cells.cell, self._listed]
        around += [s.listed_position, self.first, self.first, self.list]
        self._count_fluid = record(wall_points_kernel(listing=False), self.count, around)
        self._list_fluid = record(wall_points_kernel(listing=True), self.count, around)
        packed = (s.position_volume, s.velocity_pressure)
        read = packed if m.layout.by_column else [alias(array, float, 4 * len(array)) for array in packed]
        self._press = record(
            kernels.press_dummies_kernel(m.scene.smoothing.kernel, m.scene.dimensions, m.layout),
            self.count,
            [
                *(m.parameters, *read, s.fluid),
                *(self._position, self._velocity, self._acceleration, self._room, self.first, self.list),
                *(*(alias(array[n:], wp.vec4, self.count) for array in packed), self.power),
            ],
        )
        if self._bodies:
            points, moving = self._bodies.set, slice(self._at_rest, None)
            places = [points.point_position, points.point_velocity]
            now = (self._position[moving], self._velocity[moving], self._acceleration[moving])
            self._move = record(
                kernels.move_dummies, self._moving, [m.parameters, s.dt, *places, self._bodies.last_velocity, *now]
            )
            behind = [alias(array[n + self._at_rest :], wp.vec4, self._moving) for array in packed]
            self.show = record(kernels.show_dummies, self._moving, [m.parameters.dimensions, *places, *behind])
            kernel = kernels.load_dummies_kernel(m.scene.smoothing.kernel, m.formulas.artificial_viscosity)
            lists = [s.fluid_and_ghosts, self.first, self.list, points.point_force]
            self._load = record(kernel, self._moving, [m.parameters, self._at_rest, *packed, *lists])

    def count_around(self) -> wp.array:
        """Count the particles around each dummy; an array whose last entry is how many that makes."""
        wp.copy(self._state.fluid_and_ghosts, self._state.fluid, count=self._model.particle_count)
        self._count_fluid()
        wp.utils.array_scan(self.first, self.first, inclusive=False)
        return self.first

    def list_around(self, total: int) -> bool:
        """List them, of whom there are `total`. Returns True where launches must be recorded again: the list grew."""
        grown = total > len(self.list)
        if grown:
            self.list = wp.zeros(total + total // 4, dtype=int, device=self._model.launcher.device)
            self._record()
        self._list_fluid()
        return grown

    def sort(self) -> None:
        """Find the cells of the dummies where bodies were listed."""
        if self._bodies:
            wp.copy(self._listed, self._bodies.listed_point, dest_offset=self._at_rest)
            self._cells.sort()
            for launch in self._mark:
                launch()

    def append(self, count: wp.array, rows: Rows, too_long: wp.array, again: bool = False) -> None:
        """Append the dummies to the rows of the lists of particles, of which `count` entries are in use.

        The second time, `again`, only to the longer ones of them.
        """
        m, s = self._model, self._state
        if self._appended_to is not rows:
            self._appended_to = rows
            self._append = [
                m.launcher.record_in_order(
                    kernels.list_dummies_kernel(m.layout),
                    m.particle_count,
                    [
                        *(m.grid, m.parameters, turn, m.wall_radius, m.near_wall, self._cells.start, self._cells.order),
                        *(self._particles.cell, s.listed_position, self._listed, count, rows, too_long),
                    ],
                )
                for turn in (0, 1)
            ]
        self._append[again]()

    def press(self) -> None:
        """Give the dummies the pressure of the fluid, where they and it are now."""
        if self._bodies:
            self._move()
        self._press()

    def carry_velocity(self, packed_velocity: wp.array) -> Launch:
        """The launch that gives the dummies (u, v, w, mu) of the fluid, behind those of the particles."""
        m, s, n = self._model, self._state, self._model.particle_count
        return m.launcher.record_in_order(
            kernels.carry_velocity_kernel(m.scene.smoothing.kernel),
            self.count,
            [
                *(m.parameters, s.position_volume, packed_velocity, self._position, self._velocity, self._to_wall),
                *(self.first, self.list, alias(packed_velocity[n:], wp.vec4, self.count)),
            ],
        )

    def take_loads(self) -> Callable[[], None]:
        """What finds the loads of the fluid on bodies, with the pressure that dummies have."""
        assert self._bodies, "there are bodies, or nobody asks for their loads"
        add = self._bodies.set.sum_loads()

        def launch() -> None:
            self._load()
            add()

        return launch

    def book(self, share: float = 1.0) -> Launch:
        """The launch that books what dummies do in a `share` of a step."""
        s = self._state
        block = -(-self.count // s.block_count)
        return self._model.launcher.record_in_order(
            kernels.book_power, s.block_count, [self.count, block, share, s.dt, self.power, s.work]
        )
