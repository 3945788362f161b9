"""How pairs are read: where particles and neighbours lie in memory, and how to let a compiler take several at once."""

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import warp as wp

# Leave to add the terms of a sum in any order: without it no compiler runs several pairs at once. NaN and infinity keep
# their meaning. (Options of LLVM, for the CPU; CUDA does not read them.)
REORDER_SUMS = " -mreassociate -fno-signed-zeros"
# Four vectors of pairs in flight hide each other's gathers.
LONG_ROWS = REORDER_SUMS + " -mllvm=-force-vector-interleave=4"
# A row of cells holds a dozen or so candidates: one vector, with the lanes masked that are too many.
SHORT_ROWS = REORDER_SUMS + (
    " -mllvm=-force-vector-interleave=1 -mllvm=-force-vector-width=16"
    " -mllvm=-prefer-predicate-over-epilogue=predicate-else-scalar-epilogue"
)
# A load for each neighbour rather than gathers, which wait for the slowest of eight (measured on Zen 5).
LOAD_ONE_BY_ONE = " -target-feature +prefer-no-gather" if platform.machine() in ("x86_64", "AMD64") else ""


def compiler_options(one_by_one: bool = False, neighbours: str = "lists") -> dict[str, str]:
    """Module options of a kernel whose loop may be run several pairs at a time, or loads its neighbours one by one."""
    flags = "-march=native" if wp.config.cpu_compiler_flags is None else wp.config.cpu_compiler_flags
    flags += SHORT_ROWS if neighbours == "cells" else LONG_ROWS + (LOAD_ONE_BY_ONE if one_by_one else "")
    return {"cpu_compiler_flags": flags}


@wp.func
def low(pair: wp.uint64) -> float:
    """The first of two floats that were loaded at once."""
    return wp.cast(wp.uint32(pair), wp.float32)


@wp.func
def high(pair: wp.uint64) -> float:
    """The second of two floats that were loaded at once."""
    return wp.cast(wp.uint32(pair >> wp.uint64(32)), wp.float32)


@wp.func
def pack_velocity(dimensions: int, x: float, u: wp.vec3, last: float) -> wp.vec4:
    """(u, v, w) and one number more as pair loops read them; in a plane x lies in the place of v."""
    return wp.vec4(u[0], wp.where(dimensions == 2, x, u[1]), u[2], last)


@wp.func
def load_pairs(position_volume: wp.array[wp.uint64], velocity_pressure: wp.array[wp.uint64], i: int):
    """x, y, z, V, u, v, w, p of particle i, in four loads of two floats."""
    x_y, z_V = position_volume[2 * i], position_volume[2 * i + 1]
    u_v, w_p = velocity_pressure[2 * i], velocity_pressure[2 * i + 1]
    return low(x_y), high(x_y), low(z_V), high(z_V), low(u_v), high(u_v), low(w_p), high(w_p)


@wp.func
def load_pairs_in_plane(position_volume: wp.array[wp.uint64], velocity_pressure: wp.array[wp.uint64], i: int):
    """The same in a plane, in three loads: x lies beside u, in the place of v, and every term of y and v vanishes."""
    z_V = position_volume[2 * i + 1]
    u_x, w_p = velocity_pressure[2 * i], velocity_pressure[2 * i + 1]
    return high(u_x), 0.0, low(z_V), high(z_V), low(u_x), 0.0, low(w_p), high(w_p)


# Warp's vec4 is not aligned, so that a load of it is four loads of a float. This is one of 16 bytes, by the read-only
# path: what pair loops read of neighbours nobody writes meanwhile.
@wp.func_native(
    """
#if defined(__CUDA_ARCH__)
    const float4 four = __ldg(reinterpret_cast<const float4*>(values.data) + i);
    return wp::vec_t<4, wp::float32>(four.x, four.y, four.z, four.w);
#else
    return values.data[i];
#endif
"""
)
def load_four(values: wp.array[wp.vec4], i: int) -> wp.vec4:
    """values[i] in a single load."""
    ...


@wp.func
def load_vectors(position_volume: wp.array[wp.vec4], velocity_pressure: wp.array[wp.vec4], i: int):
    """x, y, z, V, u, v, w, p of particle i, in two loads of four floats."""
    xV, up = load_four(position_volume, i), load_four(velocity_pressure, i)
    return xV[0], xV[1], xV[2], xV[3], up[0], up[1], up[2], up[3]


@wp.func
def load_vectors_in_plane(position_volume: wp.array[wp.vec4], velocity_pressure: wp.array[wp.vec4], i: int):
    """The same in a plane: every term of y and v vanishes."""
    xV, up = load_four(position_volume, i), load_four(velocity_pressure, i)
    return xV[0], 0.0, xV[2], xV[3], up[0], 0.0, up[2], up[3]


@wp.struct
class Rows:
    """Lists of neighbours: rows of one length, and longer ones for the few particles that have more.

    Lists may have more entries than an int counts, and so a table of two dimensions, of which an entry is found by its
    place in the memory behind a 64-bit product. (Warp's own index of two dimensions hides from LLVM that the entries of
    a row lie side by side: half the speed.)
    """

    long_row: wp.array[int]  # row of the longer ones that particle i has, -1: none
    long_capacity: int  # how many entries each of these has room for
    short_rows: wp.array2d[int]  # shape [particle_count, capacity], by column [capacity, particle_count]
    long_rows: wp.array2d[int]  # shape [room, long_capacity], by column [long_capacity, room]


@wp.func_native(
    """
    const int longer = rows.long_row.data[i];
    const int* row = longer < 0 ? rows.short_rows.data + (long long)rows.short_rows.shape[1] * i
                                : rows.long_rows.data + (long long)rows.long_rows.shape[1] * longer;
    return row[k];
"""
)
def entry_of_row(rows: Rows, i: int, k: int) -> int:
    """Neighbour k of particle i where lists lie row by row."""
    ...


@wp.func_native(
    """
    const int longer = rows.long_row.data[i];
    const int* row = longer < 0 ? rows.short_rows.data + i : rows.long_rows.data + longer;
    const long long apart = longer < 0 ? rows.short_rows.shape[1] : rows.long_rows.shape[1];
    return row[apart * k];
"""
)
def entry_of_column(rows: Rows, i: int, k: int) -> int:
    """The same where they lie column by column."""
    ...


# The row that particle i has among the longer ones is handed over: it would be asked for anew after every store.
@wp.func_native(
    """
    int* row = longer < 0 ? rows.short_rows.data + (long long)rows.short_rows.shape[1] * i
                          : rows.long_rows.data + (long long)rows.long_rows.shape[1] * longer;
    row[k] = j;
"""
)
def set_entry_of_row(rows: Rows, longer: int, i: int, k: int, j: int):
    """Make j neighbour k of particle i, row by row; `longer` is its long_row."""
    ...


@wp.func_native(
    """
    int* row = longer < 0 ? rows.short_rows.data + i : rows.long_rows.data + longer;
    const long long apart = longer < 0 ? rows.short_rows.shape[1] : rows.long_rows.shape[1];
    row[apart * k] = j;
"""
)
def set_entry_of_column(rows: Rows, longer: int, i: int, k: int, j: int):
    """The same column by column."""
    ...


@dataclass(frozen=True)
class Layout:
    """How the pair loop reads memory.

    Attributes:
        packed: Type under which (x, y, z, V) and (u, v, w, p) are handed over: the same memory, seen in two ways.
        load: wp.func that loads what a particle has, by dimension of space.
        by_column: Whether the lists lie column by column, so that a warp reads side by side, or row by row.
    """

    packed: Any
    load: Mapping[int, Callable[..., Any]]
    by_column: bool

    def __hash__(self) -> int:
        return hash(self.by_column)

    @property
    def entry(self) -> wp.Function:
        """entry(rows, i, k): neighbour k of particle i."""
        return entry_of_column if self.by_column else entry_of_row

    @property
    def set_entry(self) -> wp.Function:
        """set_entry(rows, rows.long_row[i], i, k, j) makes it j."""
        return set_entry_of_column if self.by_column else set_entry_of_row

    def list_shape(self, particle_count: int, capacity: int) -> tuple[int, int]:
        """Shape of the lists of so many particles, with room for `capacity` neighbours each."""
        return (capacity, particle_count) if self.by_column else (particle_count, capacity)


# A GPU loads four floats at once. On a CPU such a load ties the four together and the loop stays scalar; floats in
# pairs are gathered for 8 neighbours at a time.
CPU_LAYOUT = Layout(wp.uint64, {2: load_pairs_in_plane, 3: load_pairs}, False)
CUDA_LAYOUT = Layout(wp.vec4, {2: load_vectors_in_plane, 3: load_vectors}, True)
