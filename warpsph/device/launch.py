"""Launching: the one place that knows how a kernel is spread over cores or handed to a GPU."""

import json
import os
import re
import shutil
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import pairwise, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from warpsph.kernels.threads import CACHE_LINE, meet

# One end of a scene costs more than the other, for its walls or its splashes: threads take turns, and each has so many
# parts of a launch, if these are not shorter than this.
TURNS, LONG_TURN = 4, 512

# Held while launches are captured: Warp would take in the launches of other threads.
CAPTURE = threading.Lock()


class DeviceError(RuntimeError):
    """The device that was asked for is not there."""


def available_cores(quota: Path = Path("/sys/fs/cgroup/cpu.max")) -> int:
    """Cores that this process may use; a container may have less time than cores: `quota` says how much."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        time, period = quota.read_text(encoding="ascii").split()
        return max(1, min(cores, int(time) // int(period)))
    except (OSError, ValueError):  # there is no such file, or it says "max"
        return cores


@contextmanager
def _native_messages_silenced() -> Iterator[None]:
    """Turn the standard error off meanwhile, below Python.

    On a machine without a GPU Warp's native code reports the missing driver there on every start. That is no news on
    a CPU, and a user who asks for a GPU gets a DeviceError instead.
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


def launch(kernel: wp.Kernel, *arguments: Any, **named: Any) -> Any:
    """What `wp.launch` returns; a kernel that is damaged in the cache on disk is made anew, once."""
    try:
        return wp.launch(kernel, *arguments, **named)
    except (json.JSONDecodeError, UnicodeDecodeError, FileNotFoundError):  # of the facts beside the machine code
        pass
    except Exception as error:  # Warp raises nothing narrower for machine code
        if not str(error).startswith(("Failed to load ", "Failed to find ")):
            raise
    kernel.module.unload()  # and forget what was loaded
    block = 1 if wp.get_device(named.get("device")).is_cpu else kernel.module.options["block_dim"]
    shutil.rmtree(Path(wp.config.kernel_cache_dir) / kernel.module.get_module_identifier(block), ignore_errors=True)
    return wp.launch(kernel, *arguments, **named)


def alias(array: wp.array, dtype: Any, length: int, offset: int = 0) -> wp.array:
    """The memory of `array` from `offset` [bytes] on as `length` entries of another type."""
    seen = wp.array(ptr=array.ptr + offset if offset else array.ptr, dtype=dtype, shape=length, device=array.device)
    seen._keep = array  # Warp does not keep the memory that it looks at
    return seen


def floats(vectors: wp.array) -> wp.array:
    """Vectors of three as the floats that they are made of."""
    return alias(vectors, float, 3 * len(vectors))


def bound(kernel: wp.Kernel, owners: Sequence[object], named: Mapping[str, Any]) -> list[Any]:
    """The arguments of `kernel` after `first`, each by the name of its parameter.

    What `named` has is taken from there, under the whole name or without `_in`, `_inout` or `_out`; the rest is the
    attribute of an owner without these. Vectors are handed over as the numbers that they are made of where the kernel
    reads those.

    Raises:
        TypeError: a parameter that nobody knows, or about which owners do not agree; a name that is no parameter.
    """
    parameters = [(one.label, re.sub("_(in|out|inout)$", "", one.label), one.type) for one in kernel.adj.args[1:]]
    words = [word for name, word, _ in parameters if name not in named]
    unknown = named.keys() - {name for name, *_ in parameters} - {word for _, word, _ in parameters}
    if unknown or len(set(words)) < len(words):
        raise TypeError(
            f"{kernel.key}: has no parameter {unknown}" if unknown else f"{kernel.key}: name {words} in full"
        )
    arguments = []
    for name, word, kind in parameters:
        if name in named or word in named:
            found = [named[name] if name in named else named[word]]
        else:
            found = [value for one in owners if (value := getattr(one, word, None)) is not None]
        if not found or any(value is not found[0] for value in found):
            who = ", ".join(type(one).__name__ for one in owners)
            raise TypeError(f"{kernel.key}: {who} {'do not agree on' if found else 'do not have'} '{word}'")
        arguments.append(_as_read(found[0], getattr(kind, "dtype", None)))
    return arguments


def _as_read(value: Any, dtype: Any) -> Any:
    """An array of vectors as the array of `dtype` that a kernel reads, if these are their parts."""
    if isinstance(value, wp.array) and dtype is not value.dtype and value.dtype in (wp.vec3, wp.vec4):
        if dtype is wp.float32:
            return alias(value, float, value.dtype._length_ * len(value))
        if dtype is wp.uint64 and value.dtype is wp.vec4:
            return alias(value, wp.uint64, 2 * len(value))
    return value


class Launch:
    """A launch that can be repeated by calling it.

    Attributes:
        parts: One command for each thread.
    """

    def __init__(self, parts: Sequence[Callable[[], None]], team: "Team") -> None:
        self.parts, self._team = list(parts), team

    def __call__(self) -> None:
        """Run all parts; where a loop is being captured, record the parts of the thread whose turn it is."""
        self._team.run(self.parts)


class Team:
    """The threads that share launches.

    Between two launches they wait for each other. Waking a thread takes some 50 microseconds, as much as many a launch;
    so a loop of steps has a graph for each thread, which meets the others by looking for them.
    """

    def __init__(self, size: int, device: wp.Device) -> None:
        self._size, self._device = size, device
        self._pool = ThreadPoolExecutor(size - 1) if size > 1 else None
        self._captured: int | None = None  # the thread whose graph is being captured
        self._meetings = wp.zeros(size * CACHE_LINE, dtype=int, device="cpu")
        self._meet = [
            launch(meet, 1, [thread, size, self._meetings], device="cpu", record_cmd=True).launch
            for thread in range(size if size > 1 else 0)
        ]

    @property
    def can_capture(self) -> bool:
        """Whether graphs can be captured: on a CPU only if each thread has a core, since one looks for the other."""
        return wp.is_conditional_graph_supported() if self._device.is_cuda else self._size <= available_cores()

    def run(self, parts: Sequence[Callable[[], None]]) -> None:
        """Run all parts, the calling thread the first of them; or record them, one thread's into its graph."""
        if self._captured is not None:
            for part in parts[self._captured : self._captured + 1]:
                part()
            for wait in self._meet[self._captured : self._captured + 1]:
                wait()
            return
        pending = [self._pool.submit(part) for part in parts[1:]] if self._pool else []
        parts[0]()
        for future in pending:
            future.result()

    def capture(self, body: Callable[[], None], running: wp.array | None = None) -> Callable[[], None]:
        """What `body` launches as a graph for each thread; a loop that is interrupted clears `running`."""
        graphs = []
        with CAPTURE:
            for thread in range(self._size):
                self._captured = thread
                try:
                    with wp.ScopedCapture(self._device) as capture:
                        body()
                finally:
                    self._captured = None
                graphs.append(partial(wp.capture_launch, capture.graph))
        return partial(self._replay, graphs, running)

    def _replay(self, graphs: Sequence[Callable[[], None]], running: wp.array | None) -> None:
        try:
            self.run(graphs)
        except BaseException:  # from the keyboard, perhaps before this thread's part: let the others go
            if running is not None:
                running.zero_()
            self._meetings[:1].fill_(1 << 30)
            if self._pool:
                self._pool.shutdown()
            raise


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
        self._team = Team(self.threads, self.device)
        self._pinned: dict[tuple[Any, int], wp.array] = {}  # by type and length

    def record(self, kernel: wp.Kernel, count: int, /, *owners: object, grain: int = 64, **named: Any) -> "Launch":
        """A callable that launches `kernel` over 0..count-1 each time that it is called.

        Arguments go by name, as `bound` tells. Arrays are bound now: write into them in place. `grain` is the least
        number of entries worth waking a thread for.
        """
        return self.record_in_order(kernel, count, bound(kernel, owners, named), grain)

    def record_in_order(self, kernel: wp.Kernel, count: int, arguments: Sequence[Any], grain: int = 64) -> "Launch":
        """The same with the arguments after `first` in the order of the kernel's parameters."""
        parts = self.threads if count >= grain * self.threads else 1
        turns = TURNS if parts > 1 and count >= LONG_TURN * TURNS * parts else 1
        edges = [count * part // (parts * turns) for part in range(parts * turns + 1)]
        commands = [
            launch(kernel, dim=end - begin, inputs=[begin, *arguments], device=self.device, record_cmd=True).launch
            for begin, end in pairwise(edges)
        ]
        if turns == 1:
            return Launch(commands, self._team)
        return Launch([partial(_run_all, commands[part::parts]) for part in range(parts)], self._team)

    def chain(self, *launches: "Launch") -> "Launch":
        """Launches in one go: each thread runs its parts of all of them before threads meet.

        None of them may read what another writes of other particles.
        """
        parts = zip_longest(*(launch.parts for launch in launches), fillvalue=_nothing)
        return Launch([partial(_run_all, commands) for commands in parts], self._team)

    @property
    def can_loop(self) -> bool:
        """Whether a loop of launches can be handed to the device as a whole."""
        return self._team.can_capture

    def loop(self, running: wp.array, body: Callable[[], None]) -> Callable[[], None]:
        """A callable that repeats `body`, made of launches recorded here alone, while `running[0]` is not 0."""
        return self._team.capture(lambda: wp.capture_while(running, body), running)

    def sequence(self, launches: Sequence["Launch"]) -> Callable[[], None]:
        """A callable that runs launches one after the other, handed to the device as a whole where that can be."""
        body = partial(_run_all, launches)
        return self._team.capture(body) if self.can_loop else body

    def packed(self, array: wp.array) -> wp.array:
        """Quadruples as the pair loops of this device read them: vectors on a GPU, pairs of floats on a CPU."""
        if self.device.is_cuda:
            return array
        return alias(array, wp.uint64, 2 * len(array))

    def read(self, array: wp.array) -> np.ndarray:
        """A few numbers on the host, which they reach by way of memory that is pinned once: for numbers read often.

        They stay as they are until the next array of the same type and length is read.
        """
        if not self.device.is_cuda:
            return array.numpy()
        key = (array.dtype, len(array))
        if key not in self._pinned:
            self._pinned[key] = wp.empty(len(array), dtype=array.dtype, device="cpu", pinned=True)
        wp.copy(self._pinned[key], array)
        wp.synchronize_stream(self.device)
        return self._pinned[key].numpy()

    def run(self, kernel: wp.Kernel, count: int, /, *owners: object, **named: Any) -> None:
        """Launch once, with arguments as `record` takes them."""
        self.record(kernel, count, *owners, **named)()
