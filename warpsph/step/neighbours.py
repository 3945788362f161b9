"""Neighbours on the host's side: sorts the particles by cell and builds the lists of a state."""

from collections.abc import Callable

import warp as wp

from warpsph.device.cells import Cells
from warpsph.device.launch import Launch, alias
from warpsph.kernels import neighbours as kernels
from warpsph.model import Model
from warpsph.state import State
from warpsph.step.ghosts import Ghosts


class Neighbours:
    """Verlet lists of a state: fluid neighbours in rows of fixed room, wall points end to end.

    Attributes:
        cells: The particles' cells at the time of listing.
        are_listed: Whether there are lists of neighbours; if not, pair loops walk the cells.
        count, list: Neighbours of i are list[i row_stride + k column_stride], k < count[i].
        ghosts: What is seen through images; None where there are none.
        wall_first, wall_list: Wall points of i are wall_list[wall_first[i] : wall_first[i + 1]].
        rebuilds: How often the lists were built.
    """

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        device, count = model.launcher.device, model.particle_count
        # The accelerations are of the last step, and lists are made before the next.
        lent = (state.pressure_acceleration, state.dissipative_acceleration)
        self.cells = Cells(model.grid, state.listed_position, model.launcher, lent)
        self.are_listed = model.formulas.neighbours == "lists"
        listed = count if self.are_listed else 0
        self.count = wp.zeros(max(listed, 1), dtype=int, device=device)
        self.list = wp.zeros(max(listed * model.parameters.list_capacity, 1), dtype=int, device=device)
        self.wall_first = wp.zeros(count + 1, dtype=int, device=device)
        self.wall_list = wp.zeros(1024, dtype=int, device=device)
        self.rebuilds = 0
        self.ghosts = Ghosts(model, state, self.cells, self.count) if model.images else None
        self._record()
        self._permute = self._record_permutation()

    def _record(self) -> None:
        """Bind the launches to the arrays as they are now."""
        model, record, count = self.model, self.model.launcher.record, self.model.particle_count
        grid, parameters, listed, cell = model.grid, model.parameters, self.state.listed_position, self.cells.cell
        self._round = record(kernels.round_position, count, [self.state.position, listed])
        self._list = record(
            kernels.list_kernel(model.layout.by_column),
            count,
            [grid, parameters, self.cells.start, cell, listed, self.count, self.list],
        )
        near = [grid, model.wall_radius, model.near_wall, model.wall_start, cell, listed, model.wall_position]
        walls = [*near, self.wall_first, self.wall_first, self.wall_list]
        count_walls = record(kernels.wall_points_kernel(listing=False), count, walls)
        self._look_around = model.launcher.chain(self._list, count_walls) if self.are_listed else count_walls
        self._list_walls = record(kernels.wall_points_kernel(listing=True), count, walls)

    def _record_permutation(self) -> Callable[[], None]:
        """What brings every particle array into the order of the cells, through what the step packs anew."""
        launcher, count = self.model.launcher, self.model.particle_count
        launches: list[Launch] = []
        for name in self.state.particle_names:
            values = getattr(self.state, name)
            permuted = alias(self.state.packed, values.dtype, count)
            gather, copy = kernels.gather_kernel(values.dtype), kernels.copy_kernel(values.dtype)
            launches.append(launcher.record(gather, count, [self.cells.order, values, permuted]))
            launches.append(launcher.record(copy, count, [permuted, values]))
        return launcher.sequence([*launches, self._round])

    def rebuild(self) -> bool:
        """Sort the particles by cell and list their neighbours where they are now. Returns as `relist` does."""
        if self.ghosts:
            self.ghosts.fold()
        self._round()
        self.cells.sort()
        self._permute()
        return self._fill_lists()

    def relist(self) -> bool:
        """List the neighbours at `state.listed_position`, by which the particles are sorted already.

        Returns True when a list had to grow: launches that were bound to the old one must be recorded again.
        """
        self.cells.sort()
        return self._fill_lists()

    def _fill_lists(self) -> bool:
        has_more_ghosts = bool(self.ghosts) and self.ghosts.make()
        if has_more_ghosts:
            self._permute = self._record_permutation()
        self._look_around()
        if self.ghosts:
            self.ghosts.append(self.list)
        wp.utils.array_scan(self.wall_first, self.wall_first, inclusive=False)
        grown = self._grow() or has_more_ghosts
        self._list_walls()
        self.state.stale.zero_()
        self.rebuilds += 1
        return grown

    def _grow(self) -> bool:
        """Make room where a row or the wall list was too short."""
        model, device = self.model, self.model.launcher.device
        wall_total = int(self.wall_first.numpy()[-1])
        grown = wall_total > len(self.wall_list)
        if grown:
            self.wall_list = wp.zeros(wall_total + wall_total // 4, dtype=int, device=device)
            self._record()
        while int(self.count.numpy().max()) >= (capacity := model.parameters.list_capacity) - 1:  # cut short, perhaps
            model.set_list_capacity(model.parameters, capacity + capacity // 4 + 1)
            self.list = wp.zeros(model.particle_count * model.parameters.list_capacity, dtype=int, device=device)
            self._record()
            self._list()
            if self.ghosts:
                self.ghosts.append(self.list)
            grown = True
        return grown
