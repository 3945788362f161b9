"""Progress: a bar with an ETA on a terminal, a line now and then elsewhere."""

import contextlib
import os
import sys
import time
from typing import TextIO


def tell(text: str, stream: TextIO | None) -> OSError | None:
    """Write to a terminal, a pipe or a file; one that is closed or full ends no run, and is told nothing more.

    Returns why a file, which is full, did not take it; nothing of a pipe that nobody reads any longer.
    """
    why = None
    if stream is None:  # closed before the program began
        return why
    try:
        stream.write(text)
        stream.flush()
    except (OSError, ValueError) as error:
        why = error if isinstance(error, OSError) and not isinstance(error, BrokenPipeError) else None
        # What was not taken would be tried again at exit, and fail again.
        with contextlib.suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
    return why


class Progress:
    """Tells how far a run has come.

    Args:
        start, end: Simulated time at which the run begins and ends [s].
        particle_count: Fluid particles, for the rate.
        steps: Steps done before.
        stream: Where to tell it, the standard error by default; a bar only if that is a terminal.
    """

    def __init__(self, start: float, end: float, particle_count: int, steps: int, stream: TextIO | None = None) -> None:
        self._start, self._end, self._count = start, end, particle_count
        self._stream = sys.stderr if stream is None else stream
        self._began = self._told = time.perf_counter()
        self._steps_before = steps
        self._is_terminal = self._stream is not None and self._stream.isatty()
        self._told_share = 0.0

    def update(self, simulated: float, steps: int) -> None:
        """`steps` have been done and the simulated time is `simulated` [s]."""
        now = time.perf_counter()
        share = (simulated - self._start) / (self._end - self._start)
        is_due = now - self._told > 0.2 if self._is_terminal else share >= self._told_share + 0.1
        if not is_due or share <= 0.0:
            return
        self._told, self._told_share = now, share
        elapsed = now - self._began
        rate = (steps - self._steps_before) * self._count / elapsed
        text = (
            f"t = {simulated:7.3f} s  {share:4.0%}  {rate / 1e6:5.2f} M particle-updates/s  "
            f"{_clock(elapsed)} gone, {_clock(elapsed / share - elapsed)} to go"
        )
        if self._is_terminal:
            filled = round(24 * share)
            tell(f"\r[{'#' * filled}{'.' * (24 - filled)}] {text} ", self._stream)
        else:
            tell(text + "\n", self._stream)

    def close(self) -> None:
        """Leave the line of the bar."""
        if self._is_terminal and self._told_share:
            tell("\n", self._stream)


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
