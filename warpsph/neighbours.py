"""Neighbours on the host's side: sorts the particles by cell and builds the lists of a state."""

import warp as wp

from warpsph.kernels import neighbours as kernels
from warpsph.launch import Launch
from warpsph.model import Model
from warpsph.state import State

# Beside the rows of the list: listed position, counts, the grid's cells and ids, the order and the sorting scratch.
NEIGHBOUR_BYTES = 12 + 3 * 4 + 4 * 4 + 4 + (24 + 12 + 8 + 4 + 4)


class Neighbours:
    """Verlet lists of a state: fluid neighbours in rows of fixed room, wall points end to end.

    Attributes:
        grid: Hash grid over the sorted particles at the time of listing.
        count, list: Neighbours of i are list[i row_stride + k column_stride], k < count[i].
        wall_first, wall_list: Wall points of i are wall_list[wall_first[i] : wall_first[i + 1]].
        rebuilds: How often the lists were built.
    """

    def __init__(self, model: Model, state: State) -> None:
        self.model, self.state = model, state
        device, count = model.launcher.device, model.particle_count
        self.grid = wp.HashGrid(*model.grid_shape, device=device)
        self.count = wp.zeros(count, dtype=int, device=device)
        self.list = wp.zeros(count * model.parameters.list_capacity, dtype=int, device=device)
        self.wall_count = wp.zeros(count + 1, dtype=int, device=device)
        self.wall_first = wp.zeros(count + 1, dtype=int, device=device)
        self.wall_list = wp.zeros(1024, dtype=int, device=device)
        self.rebuilds = 0
        self._record()

    def _record(self) -> None:
        """Bind the launches to the arrays as they are now."""
        record, count = self.model.launcher.record, self.model.particle_count
        parameters, walls, listed = self.model.parameters, self.model.wall_position, self.state.listed_position
        self._round = record(kernels.round_position, count, [self.state.position, listed])
        self._list = record(kernels.list_neighbours, count, [self.grid.id, parameters, listed, self.count, self.list])
        wall_arguments = [self.model.wall_grid.id, parameters, listed, walls]
        self._count_walls = record(kernels.count_wall_points, count, [*wall_arguments, self.wall_count])
        self._list_walls = record(kernels.list_wall_points, count, [*wall_arguments, self.wall_first, self.wall_list])
        self._sort = self._record_sort()

    def _record_sort(self) -> list[Launch]:
        """Launches that bring every particle array into the order of the grid, through one scratch array a type."""
        launcher, count = self.model.launcher, self.model.particle_count
        order = wp.zeros(count, dtype=int, device=launcher.device)
        launches = [launcher.record(kernels.cell_order, count, [self.grid.id, order])]
        scratch: dict[type, wp.array] = {}
        for name in State.PARTICLE:
            values = getattr(self.state, name)
            sorted_values = scratch.setdefault(values.dtype, wp.empty_like(values))
            gather = kernels.gather_kernel(values.dtype)
            launches.append(launcher.record(gather, count, [order, values, sorted_values]))
            launches.append(lambda values=values, sorted_values=sorted_values: wp.copy(values, sorted_values))
        return launches

    def rebuild(self) -> bool:
        """Sort the particles by cell and list their neighbours where they are now. Returns as `relist` does."""
        self._round()
        self.grid.build(self.state.listed_position, self.model.cell_size)
        for launch in self._sort:
            launch()
        self._round()
        self.state.moved.zero_()
        return self.relist()

    def relist(self) -> bool:
        """List the neighbours at `state.listed_position`.

        Returns True when a list had to grow: launches that were bound to the old one must be recorded again.
        """
        self.grid.build(self.state.listed_position, self.model.cell_size)
        self._list()
        self._count_walls()
        wp.utils.array_scan(self.wall_count, self.wall_first, inclusive=False)
        grown = self._grow()
        self._list_walls()
        self.rebuilds += 1
        return grown

    def _grow(self) -> bool:
        """Make room where a row or the wall list was too short."""
        model, device = self.model, self.model.launcher.device
        longest, wall_total = int(self.count.numpy().max()), int(self.wall_first.numpy()[-1])
        capacity = model.parameters.list_capacity
        if longest < capacity and wall_total <= len(self.wall_list):
            return False
        if longest >= capacity:
            model.set_list_capacity(model.parameters, longest + longest // 8 + 1)
            self.list = wp.zeros(model.particle_count * model.parameters.list_capacity, dtype=int, device=device)
        if wall_total > len(self.wall_list):
            self.wall_list = wp.zeros(wall_total + wall_total // 4, dtype=int, device=device)
        self._record()
        self._list()
        return True
