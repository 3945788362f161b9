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
    """The dummies of a state: first the walls', in the order of its model, then the bodies'.

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
        start, blocks = self._cells.start, len(model.wall_block)
        self._mark = [
            launcher.record(mark_walls, cells, model, cells=reach, wall_start=start),
            launcher.record(kernels.mark_blocks, blocks, model, start=start, used=model.wall_block),
        ]
        self._appended_to: Rows | None = None  # the lists that `append` is bound to
        self._record()

    def _record(self) -> None:
        """Bind the launches to the arrays as they are now."""
        m, s, n, record = self._model, self._state, self._model.particle_count, self._model.launcher.record
        # Wall points around particles are particles around dummies here: each has the place of the other.
        around = {"radius": m.wall_radius, "near_wall": self._anywhere, "cell": self._cells.cell}
        around |= {"position": self._listed, "wall_position": s.listed_position, "wall_start": self._particles.start}
        around |= {"wall_first": self.first, "count": self.first, "list": self.list}
        self._count_fluid, self._list_fluid = (
            record(wall_points_kernel(listing), self.count, m, **around) for listing in (False, True)
        )
        lists = {"fluid_first": self.first, "fluid_list": self.list}
        places = {"position": self._position, "velocity": self._velocity, "acceleration": self._acceleration}
        self._press = record(
            kernels.press_dummies_kernel(m.scene.smoothing.kernel, m.scene.dimensions, m.layout),
            *(self.count, m, self, s),
            **(places | lists),
            room=self._room,
            position_volume=s.position_volume,
            velocity_pressure=s.velocity_pressure,
            position_volume_out=alias(s.position_volume[n:], wp.vec4, self.count),
            velocity_pressure_out=alias(s.velocity_pressure[n:], wp.vec4, self.count),
        )
        if self._bodies:
            points, mine = self._bodies.set, slice(self._at_rest, None)
            moving = {name: values[mine] for name, values in places.items()}
            self._move = record(kernels.move_dummies, self._moving, m, s, points, self._bodies, **moving)
            self.show = record(
                *(kernels.show_dummies, self._moving, m.parameters, points),
                position_volume=alias(s.position_volume[n + self._at_rest :], wp.vec4, self._moving),
                velocity_pressure=alias(s.velocity_pressure[n + self._at_rest :], wp.vec4, self._moving),
            )
            self._load = record(
                kernels.load_dummies_kernel(m.scene.smoothing.kernel, m.formulas.artificial_viscosity),
                *(self._moving, m, s),
                **lists,
                before=self._at_rest,
                fluid=s.fluid_and_ghosts,
                force=points.point_force,
            )

    def count_around(self) -> wp.array:
        """Count the particles around each dummy; an array whose last entry is how many that makes."""
        wp.copy(self._state.fluid_and_ghosts, self._state.fluid, count=self._model.particle_count)
        self._count_fluid()
        wp.utils.array_scan(self.first, self.first, inclusive=False)
        return self.first

    def list_around(self, total: int) -> bool:
        """List these `total` particles. Returns True where launches must be recorded again: the list grew."""
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
                m.launcher.record(
                    kernels.list_dummies_kernel(m.layout),
                    *(m.particle_count, m),
                    again=turn,
                    radius=m.wall_radius,
                    near_dummies=m.near_wall,
                    dummy_start=self._cells.start,
                    dummy_order=self._cells.order,
                    dummy_position=self._listed,
                    cell=self._particles.cell,
                    position=s.listed_position,
                    count=count,
                    list=rows,
                    too_long=too_long,
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
        """The launch that gives dummies the fluid's (u, v, w, mu), behind the particles' in the array."""
        m, s, n = self._model, self._state, self._model.particle_count
        return m.launcher.record(
            kernels.carry_velocity_kernel(m.scene.smoothing.kernel),
            *(self.count, m, s),
            position=self._position,
            velocity=self._velocity,
            to_wall=self._to_wall,
            fluid_first=self.first,
            fluid_list=self.list,
            packed_velocity=packed_velocity,
            packed_velocity_out=alias(packed_velocity[n:], wp.vec4, self.count),
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
        size = -(-self.count // s.block_count)
        counts = {"dummy_count": self.count, "block_size": size}
        return self._model.launcher.record(kernels.book_power, s.block_count, s, self, share=share, **counts)
