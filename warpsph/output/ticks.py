"""When a record, a frame or a checkpoint is due."""

import math


class Ticks:
    """The times k / rate, k an integer, from `start` on; without `start` itself when `is_done`."""

    def __init__(self, rate: float, start: float, is_done: bool) -> None:
        self._rate = rate
        self.index = math.ceil(start * rate + (1e-6 if is_done else -1e-6))

    @property
    def next(self) -> float:
        """The next time [s]."""
        return self.index / self._rate

    def take(self, time: float) -> bool:
        """Whether a tick is due at `time` [s]; if so, go on to the next."""
        is_due = time > self.next - 1e-9
        self.index += is_due
        return is_due
