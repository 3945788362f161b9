"""Neighbours on the host's side: sorts the particles by cell and builds the lists of a state."""

from collections.abc import Callable

import numpy as np
import warp as wp

from warpsph.device.cells import Cells
from warpsph.device.launch import Launch, alias
from warpsph.kernels import neighbours as kernels
from warpsph.kernels.layout import Rows
from warpsph.model import Model
from warpsph.state import State
from warpsph.step.bodies import Coupling
from warpsph.step.dummies import DummyLists
from warpsph.step.ghosts import Ghosts

# One row in so many may be too short: those get longer ones. Where more are, all are made longer by a quarter.
MOST_LONG = 16


class Neighbours:
    """Verlet lists of a state: fluid neighbours in rows of fixed room, wall points end to end.

    Attributes:
        cells: The particles' cells at the time of listing.
        are_listed: Whether there are lists of neighbours; if not, pair loops walk the cells.
        neighbour_count, neighbour_list: Neighbours of i are entries k < neighbour_count[i] of its row; rows lie one
            after the other on a CPU, side by side on a GPU.
        ghosts: What is seen through images; None where there are none.
        dummies: The dummy particles of walls; None where walls are made of points.
        wall_first, wall_list: Wall points of i are wall_list[wall_first[i] : wall_first[i + 1]].
        rebuilds: How often the lists were built.
    """

    def __init__(self, model: Model, state: State, bodies: Coupling | None = None) -> None:
        self.model, self.state = model, state
        device, count = model.launcher.device, model.particle_count
        # The accelerations are of the last step, and lists are made before the next.
        lent = (state.pressure_acceleration, state.dissipative_acceleration)
        self.cells = Cells(model.grid, state.listed_position, model.launcher, lent)
        self.are_listed = model.formulas.neighbours == "lists"
        self.neighbour_count = wp.zeros(count if self.are_listed else 1, dtype=int, device=device)
        self.neighbour_list = self._make_rows()
        # What the host asks after lists were made: whether a row may have been cut short, how many wall points all
        # particles have on their lists, and how many particles are around all dummies.
        self._asked = wp.zeros(3, dtype=int, device=device)
        self._too_long = self._asked[:1]
        self.wall_first = wp.zeros(count + 1, dtype=int, device=device)
        self.wall_list = wp.zeros(1024, dtype=int, device=device)
        self._long_count = 0  # how many rows are longer ones
        self.rebuilds = 0
        self.ghosts = Ghosts(model, state, self.cells, self.neighbour_count) if model.images else None
        self.dummies = DummyLists(model, state, self.cells, bodies) if model.has_dummies else None
        self._record()
        self._permute = self._record_permutation()

    @property
    def cell_start(self) -> wp.array:
        """start[c] = first slot of cell c, shape [cell_count + 1]."""
        return self.cells.start

    def _make_rows(self) -> Rows:
        """Rows with room for `list_capacity` neighbours a particle, none of them longer."""
        model, device = self.model, self.model.launcher.device
        count, capacity = model.particle_count, model.parameters.list_capacity
        rows = Rows()
        rows.long_row = wp.full(count if self.are_listed else 1, -1, dtype=int, device=device)
        shape = model.layout.list_shape(count, capacity)
        rows.short_rows = wp.zeros(shape if self.are_listed else (1, 1), dtype=int, device=device)
        rows.long_rows, rows.long_capacity = wp.zeros((1, 1), dtype=int, device=device), 1
        return rows

    def _record(self) -> None:
        """Bind the launches to the arrays as they are now."""
        model, record, count = self.model, self.model.launcher.record, self.model.particle_count
        listed = {"cell": self.cells.cell, "position": self.state.listed_position}
        self._round = record(kernels.round_position, count, self.state, rounded=self.state.listed_position)
        lists = {"start": self.cell_start, "count": self.neighbour_count, "list": self.neighbour_list}
        self._list, self._list_again = (
            record(
                *(kernels.list_kernel(model.layout), count, model),
                again=turn,
                too_long=self._too_long,
                **lists,
                **listed,
            )
            for turn in (0, 1)
        )
        walls = listed | {"radius": model.wall_radius, "count": self.wall_first, "list": self.wall_list}
        count_walls, self._list_walls = (
            record(kernels.wall_points_kernel(listing), count, model, self, **walls) for listing in (False, True)
        )
        self._look_around = model.launcher.chain(self._list, count_walls) if self.are_listed else count_walls
        if self.dummies:
            self._look_around = self._list

    def _record_permutation(self) -> Callable[[], None]:
        """What brings every particle array into the order of the cells, through what the step packs anew."""
        launcher, count = self.model.launcher, self.model.particle_count
        launches: list[Launch] = []
        for name in self.state.particle_names:
            values = getattr(self.state, name)
            permuted = alias(self.state.packed, values.dtype, count)
            gather, copy = kernels.gather_kernel(values.dtype), kernels.copy_kernel(values.dtype)
            launches.append(launcher.record(gather, count, self.cells, values=values, values_out=permuted))
            launches.append(launcher.record(copy, count, values=permuted, values_out=values))
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
        has_more_ghosts = self.ghosts is not None and self.ghosts.make()
        if has_more_ghosts:
            self._permute = self._record_permutation()
        if self._long_count:
            self.neighbour_list.long_row.fill_(-1)
            self._long_count = 0
        self._too_long.zero_()
        if self.dummies:
            self.dummies.sort()
        self._look_around()
        self._append()
        if self.dummies:
            around = self.dummies.count_around()
            wp.copy(self._asked, around, dest_offset=2, src_offset=self.dummies.count, count=1)
            grown = self._grow()
        else:
            wp.utils.array_scan(self.wall_first, self.wall_first, inclusive=False)
            grown = self._grow() or has_more_ghosts
            self._list_walls()
        self.state.stale.zero_()
        self.rebuilds += 1
        return grown

    def _append(self, again: bool = False) -> None:
        """What stands behind the particles to their rows; the second time, `again`, only to the longer ones."""
        if self.ghosts:
            self.ghosts.append(self.neighbour_list, self._too_long, again)
        if self.dummies:
            self.dummies.append(self.neighbour_count, self.neighbour_list, self._too_long, again)

    def rows(self) -> np.ndarray:
        """The lists on the host, shape [particle_count, longest]; of row i only the first count[i] mean anything."""
        rows = self.neighbour_list
        short, long = (
            table.numpy().T if self.model.layout.by_column else table.numpy()
            for table in (rows.short_rows, rows.long_rows)
        )
        found = np.zeros((len(short), max(short.shape[1], long.shape[1])), dtype=np.int32)
        found[:, : short.shape[1]] = short
        longer = rows.long_row.numpy()
        found[longer >= 0, : long.shape[1]] = long[longer[longer >= 0]]
        return found

    def _grow(self) -> bool:
        """Make room where a row or the wall list was too short."""
        model, device = self.model, self.model.launcher.device
        wp.copy(self._asked, self.wall_first, dest_offset=1, src_offset=model.particle_count, count=1)
        is_too_long, wall_total, around_dummies = map(int, model.launcher.read(self._asked))
        grown = wall_total > len(self.wall_list)
        if grown:
            self.wall_list = wp.zeros(wall_total + wall_total // 4, dtype=int, device=device)
            self._record()
        if self.dummies:
            grown |= self.dummies.list_around(around_dummies)
        while is_too_long:
            had = self.neighbour_list
            again = self._lengthen_some()
            if not again:
                self._lengthen_all()
            if self.neighbour_list is not had:
                self._record()
                grown = True
            self._too_long.zero_()
            (self._list_again if again else self._list)()
            self._append(again)
            is_too_long = int(model.launcher.read(self._asked)[0])
        return grown

    def _lengthen_some(self) -> bool:
        """Give the rows that were cut short longer ones, unless there are too many of them; whether it was done."""
        model, launcher, rows = self.model, self.model.launcher, self.neighbour_list
        n, capacity = model.particle_count, model.parameters.list_capacity
        cut = wp.empty(n + 1, dtype=int, device=launcher.device)
        found = {"rows": rows, "count": self.neighbour_count, "cut": cut}
        launcher.run(kernels.find_cut_rows, n + 1, model, **found)
        wp.utils.array_scan(cut, cut, inclusive=False)
        number = int(launcher.read(alias(cut, int, 1, 4 * n))[0])
        if number * MOST_LONG > n:
            return False
        # Those that have a longer one already need a longer one still.
        wanted = max(rows.long_capacity, 2 * capacity) if self._long_count == 0 else 2 * rows.long_capacity
        room = rows.long_rows.shape[1 if model.layout.by_column else 0]
        if number > room or wanted > rows.long_capacity:
            longer = Rows()
            longer.long_row, longer.short_rows, longer.long_capacity = rows.long_row, rows.short_rows, wanted
            shape = model.layout.list_shape(number + number // 4, wanted)
            longer.long_rows = wp.zeros(shape, dtype=int, device=launcher.device)
            self.neighbour_list = longer
        launcher.run(kernels.number_long_rows, n, rows, cut=cut)
        self._long_count = number
        return True

    def _lengthen_all(self) -> None:
        """Make every row longer by a quarter."""
        capacity = self.model.parameters.list_capacity
        self.model.parameters.list_capacity = capacity + capacity // 4 + 1
        # Let go before the longer ones are made: both may be more than there is room for.
        self.neighbour_list.short_rows = wp.zeros((1, 1), dtype=int, device=self.model.launcher.device)
        self.neighbour_list = self._make_rows()
        self._long_count = 0
