"""Signals held while a library loads: it may take whatever is raised then for something of its own.

Some take it for an optional part that is missing, and the command went on; some tell of it as of a fault of theirs.
"""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def held() -> Iterator[None]:
    """What ends a program from outside comes after the block, if it came within it."""
    come: list[int] = []
    before = {}
    if threading.current_thread() is threading.main_thread():  # Python hands signals to no other
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)  # not every system has them all
            if number is not None and callable(signal.getsignal(number)):
                before[number] = signal.signal(number, lambda number, _: come.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in come[:1]:
            os.kill(os.getpid(), number)
