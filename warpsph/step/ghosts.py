"""The ghosts of a state: its particles as they are seen through mirrors and periodic edges."""

import warp as wp

from warpsph.device.cells import Cells
from warpsph.device.launch import Launch, alias
from warpsph.kernels import images as kernels
from warpsph.kernels.layout import Rows
from warpsph.model import Model
from warpsph.state import State


class Ghosts:
    """The ghosts of a state: made anew with the lists, moved with their particles.

    Attributes:
        source: Slot of the particle that each ghost shows, -1 where there is none, shape [room].
        image: Number of its image, shape [room].
        inner_count: How many entries of a row are particles; those after them are ghosts, shape [particle_count].
    """

    def __init__(self, model: Model, state: State, cells: Cells, count: wp.array) -> None:
        """`cells` hold the particles, `count` is how many entries each row of the lists has."""
        self._model, self._state, self._particles, self._count = model, state, cells, count
        n, device, record = model.particle_count, model.launcher.device, model.launcher.record
        self.inner_count = wp.zeros(n, dtype=int, device=device)
        self._first = wp.zeros(n + 1, dtype=int, device=device)
        self._total = alias(self._first, int, 1, 4 * n)
        s = state
        self._count_ghosts = record(
            kernels.count_ghosts, n, model, radius=model.list_radius, position=s.listed_position, count=self._first
        )
        lift = s.wall_distance  # free between steps
        self._fold = record(kernels.fold, n, model, s, lift=lift)
        self._book_lift = record(kernels.book_lift, s.block_count, s, lift=lift)
        self._make_room(64)

    def _make_room(self, room: int) -> None:
        """Room for so many ghosts."""
        model, state, device = self._model, self._state, self._model.launcher.device
        record, n = model.launcher.record, model.particle_count
        state.make_room(room)
        self.source, self.image = (wp.zeros(room, dtype=int, device=device) for _ in range(2))
        self.ghost_position = wp.zeros(room, dtype=wp.vec3, device=device)
        self.ghost_fluid = alias(state.fluid_and_ghosts, int, room, 4 * n)
        self._cells = Cells(model.grid, self.ghost_position, model.launcher)
        place = {"radius": model.list_radius, "position": state.listed_position, "ghost_first": self._first}
        self._make = record(kernels.make_ghosts, n, model, state, self, **place)
        self._forget = record(kernels.forget_ghosts, room, self, total=self._first, last=n)
        self._appended_to: Rows | None = None  # the lists that `append` is bound to
        behind = {
            f"ghost_{name}": alias(getattr(state, name), wp.vec4, room, 16 * n)
            for name in ("position_volume", "velocity_pressure")
        }
        self.move = record(kernels.move_ghosts, room, model, state, self, **behind)

    def moved(self) -> list[Launch]:
        """The launch that moves the ghosts with their particles."""
        return [self.move]

    def fold(self) -> None:
        """Bring particles that left through an edge back as the images that came in for them."""
        self._fold()
        self._book_lift()

    def make(self) -> bool:
        """Make the ghosts at `listed_position`. Returns True if arrays had to grow: launches must be recorded again."""
        n = self._model.particle_count
        self._count_ghosts()
        wp.utils.array_scan(self._first, self._first, inclusive=False)
        total = int(self._model.launcher.read(self._total)[0])
        grown = total > len(self.source)
        if grown:
            self._make_room(total + total // 4)
        wp.copy(self._state.fluid_and_ghosts, self._state.fluid, count=n)
        self._make()
        self._forget()
        self._cells.sort()
        return grown

    def append(self, rows: Rows, too_long: wp.array, again: bool = False) -> None:
        """Append the ghosts to the rows of the lists; the second time, `again`, only to the longer ones of them."""
        model = self._model
        if self._appended_to is not rows:
            self._appended_to = rows
            self._append = [
                model.launcher.record(
                    kernels.list_ghosts_kernel(model.layout),
                    model.particle_count,
                    *(model, self),
                    again=turn,
                    ghost_start=self._cells.start,
                    ghost_order=self._cells.order,
                    cell=self._particles.cell,
                    position=self._state.listed_position,
                    count=self._count,
                    list=rows,
                    too_long=too_long,
                )
                for turn in (0, 1)
            ]
        self._append[again]()

    def compare_motion(self) -> list[Launch]:
        """What the lists allow between particles and ghosts, as `compare_motion` does it among particles."""
        m, s = self._model, self._state
        ends = {"lower": s.motion_lower, "upper": s.motion_upper}
        return [m.launcher.record(kernels.compare_images, s.cell_block_count, m, s, **ends)]


class NoGhosts:
    """Those of a scene without images."""

    def moved(self) -> list[Launch]:
        """None."""
        return []

    def compare_motion(self) -> list[Launch]:
        """None."""
        return []
