"""How much of a device's memory bandwidth a step uses.

What a step must move is estimated from below: every array that a stage's kernel is given counts once if the kernel
reads or writes it and twice if it does both (`*_inout`), lists by what is in them; neighbours that a pair loop loads
again and again are taken to come from the caches, and the building of lists is left out.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import warp as wp

from warpsph.device.launch import Launch, Launcher
from warpsph.simulation import Simulation

COPY_BYTES = 512 * 2**20
COPIES = 20

Recorded = list[tuple[Launch, list[tuple[wp.array, int]]]]  # arrays, and how often each is moved


def copy_bandwidth(device: str, size: int = COPY_BYTES) -> float:
    """Bytes a second that copying `size` bytes from one array to another reads and writes."""
    source = wp.zeros(size // 4, dtype=float, device=device)
    target = wp.empty_like(source)
    wp.copy(target, source)
    wp.synchronize()
    began = time.perf_counter()
    for _ in range(COPIES):
        wp.copy(target, source)
    wp.synchronize()
    return 2.0 * 4 * len(source) * COPIES / (time.perf_counter() - began)


@contextmanager
def recorded_launches() -> Iterator[Recorded]:
    """Note every launch that is recorded or chained meanwhile."""
    recorded: Recorded = []
    record, chain = Launcher.record_in_order, Launcher.chain

    def note(launcher: Launcher, kernel: wp.Kernel, count: int, arguments: Sequence[Any], *grain: int) -> Launch:
        launch = record(launcher, kernel, count, arguments, *grain)
        parameters = kernel.adj.args[1:]  # the first is `first`
        arrays = [
            (value, 2 if parameter.label.endswith("_inout") else 1)
            for parameter, value in zip(parameters, arguments, strict=True)
            if isinstance(value, wp.array)
        ]
        recorded.append((launch, arrays))
        return launch

    def note_chain(launcher: Launcher, *launches: Launch) -> Launch:
        launch = chain(launcher, *launches)
        links = {id(link) for link in launches}
        recorded.append((launch, [array for link, arrays in recorded if id(link) in links for array in arrays]))
        return launch

    Launcher.record_in_order, Launcher.chain = note, note_chain
    try:
        yield recorded
    finally:
        Launcher.record_in_order, Launcher.chain = record, chain


def step_bytes(simulation: Simulation, recorded: Recorded) -> float:
    """Bytes that a step must move at least, from the launches recorded while `simulation` was made."""
    neighbours = simulation.step.neighbours
    used = {
        neighbours.neighbour_list.short_rows.ptr: 4.0 * float(neighbours.neighbour_count.numpy().sum()),
        neighbours.wall_list.ptr: 4.0 * float(neighbours.wall_first.numpy()[-1]),
    }
    stages = {id(stage) for stage in simulation.step.stages.values()}
    return sum(
        moves * used.get(array.ptr, float(array.size * wp.types.type_size_in_bytes(array.dtype)))
        for launch, arrays in recorded
        if id(launch) in stages
        for array, moves in arrays
    )
