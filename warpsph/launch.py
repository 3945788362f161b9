"""Launching: the one place that knows how a kernel is spread over cores or handed to a GPU."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import warp as wp

Launch = Callable[[], None]


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

    def record(self, kernel: wp.Kernel, count: int, arguments: Sequence[Any]) -> Launch:
        """A callable that launches `kernel` over 0..count-1 each time that it is called.

        `arguments` are those after `first`. Arrays are bound now: write into them in place.
        """
        parts = self.threads if count >= 64 * self.threads else 1
        edges = [count * part // parts for part in range(parts + 1)]
        commands = [
            wp.launch(kernel, dim=end - begin, inputs=[begin, *arguments], device=self.device, record_cmd=True).launch
            for begin, end in pairwise(edges)
        ]
        if len(commands) == 1:
            return commands[0]
        mine, others, submit = commands[0], commands[1:], self._pool.submit

        def launch() -> None:
            pending = [submit(command) for command in others]
            mine()
            for part in pending:
                part.result()

        return launch

    def run(self, kernel: wp.Kernel, count: int, arguments: Sequence[Any]) -> None:
        """Launch once."""
        self.record(kernel, count, arguments)()
