"""Launching: the one place that knows how a kernel is spread over cores or handed to a GPU."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import pairwise, zip_longest
from typing import Any

import warp as wp

# One end of a scene costs more than the other, for its walls or its splashes: threads take turns, and each has so many
# parts of a launch, if these are not shorter than this.
TURNS, LONG_TURN = 4, 512


class DeviceError(RuntimeError):
    """The device that was asked for is not there."""


def available_cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def _native_messages_silenced() -> Iterator[None]:
    """Turn the standard error off meanwhile, below Python.

    On a machine without a GPU Warp's native code reports the missing driver there on every start. That is no news to
    who runs on the CPU, and who asks for a GPU gets a DeviceError instead.
    """
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def alias(array: wp.array, dtype: Any, length: int) -> wp.array:
    """The memory of `array` as `length` entries of another type."""
    seen = wp.array(ptr=array.ptr, dtype=dtype, shape=length, device=array.device)
    seen._keep = array  # Warp does not keep the memory that it looks at
    return seen


def floats(vectors: wp.array) -> wp.array:
    """Vectors of three as the floats that they are made of."""
    return alias(vectors, float, 3 * len(vectors))


class Launch:
    """A launch that can be repeated by calling it.

    Attributes:
        parts: One command for each thread.
    """

    def __init__(self, parts: Sequence[Callable[[], None]], pool: ThreadPoolExecutor | None) -> None:
        self.parts, self._pool = list(parts), pool

    def __call__(self) -> None:
        """Run all parts; the calling thread takes the first."""
        pending = [self._pool.submit(part) for part in self.parts[1:]]
        self.parts[0]()
        for part in pending:
            part.result()


def _nothing() -> None:
    """The part of a thread that has none."""


def _run_all(commands: Sequence[Callable[[], None]]) -> None:
    for command in commands:
        command()


class Launcher:
    """Records kernel launches on one device and replays them.

    On the CPU Warp runs a launch on one core, but a recorded launch releases the interpreter lock: a range split over
    threads runs in parallel. Each thread writes its own part of every output, so the bits do not depend on the number
    of threads. Kernels take the first index of their part as their first argument.
    """

    def __init__(self, device: str = "cpu", threads: int | None = None) -> None:
        """`threads` counts CPU threads, all available cores by default; a GPU takes one launch.

        Raises:
            DeviceError: there is no such device.
        """
        wp.config.log_level = wp.LOG_WARNING
        try:
            with _native_messages_silenced():
                wp.init()
                self.device = wp.get_device(device)
        except (RuntimeError, ValueError) as error:
            names = ", ".join(d.alias for d in wp.get_devices())
            raise DeviceError(f"no device named '{device}' here; Warp finds: {names}") from error
        self.threads = 1 if self.device.is_cuda else max(1, threads or available_cores())
        # The calling thread takes a part too.
        self._pool = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None

    def record(self, kernel: wp.Kernel, count: int, arguments: Sequence[Any], grain: int = 64) -> "Launch":
        """A callable that launches `kernel` over 0..count-1 each time that it is called.

        `arguments` are those after `first`. Arrays are bound now: write into them in place. `grain` is the least number
        of entries worth waking a thread for.
        """
        parts = self.threads if count >= grain * self.threads else 1
        turns = TURNS if parts > 1 and count >= LONG_TURN * TURNS * parts else 1
        edges = [count * part // (parts * turns) for part in range(parts * turns + 1)]
        commands = [
            wp.launch(kernel, dim=end - begin, inputs=[begin, *arguments], device=self.device, record_cmd=True).launch
            for begin, end in pairwise(edges)
        ]
        if turns == 1:
            return Launch(commands, self._pool)
        return Launch([partial(_run_all, commands[part::parts]) for part in range(parts)], self._pool)

    def chain(self, *launches: "Launch") -> "Launch":
        """Launches in one go: each thread runs its parts of all of them before threads meet.

        None of them may read what another writes of other particles.
        """
        parts = zip_longest(*(launch.parts for launch in launches), fillvalue=_nothing)
        return Launch([partial(_run_all, commands) for commands in parts], self._pool)

    def packed(self, array: wp.array) -> wp.array:
        """Quadruples as the pair loops of this device read them: vectors on a GPU, pairs of floats on a CPU."""
        if self.device.is_cuda:
            return array
        return alias(array, wp.uint64, 2 * len(array))

    def run(self, kernel: wp.Kernel, count: int, arguments: Sequence[Any]) -> None:
        """Launch once."""
        self.record(kernel, count, arguments)()
