"""What a step is made of: its stages by the clock, its neighbours, its memory."""

import resource
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp
from noise import neighbours, sample

from warpsph.kernels.smoothing import SMOOTHING
from warpsph.scene.scene import Scene
from warpsph.simulation import Simulation

STAGE_STEPS = 100
LISTS, BETWEEN = "lists", "between stages"


@dataclass
class Timed:
    """A callable by the clock."""

    run: Callable[[], Any]
    seconds: dict[str, float]
    name: str

    def __call__(self) -> Any:
        """Run it, and wait for the device."""
        began = time.perf_counter()
        result = self.run()
        wp.synchronize()
        self.seconds[self.name] += time.perf_counter() - began
        return result


def stage_times(step: Any, steps: int = STAGE_STEPS) -> dict[str, float]:
    """Milliseconds a step of every entry of `step.stages`, of the building of lists, and of what lies between.

    Steps are launched stage by stage meanwhile.
    """
    loops, step.loops = step.loops, False
    seconds = dict.fromkeys([*step.stages, LISTS], 0.0)
    step.neighbours.rebuild = Timed(step.neighbours.rebuild, seconds, LISTS)
    began = time.perf_counter()
    try:
        for _ in range(steps):
            for name, stage in step.stages.items():  # anew each time: lists that grow bring new stages
                if not isinstance(stage, Timed):
                    step.stages[name] = Timed(stage, seconds, name)
            step.run(1)
        wp.synchronize()
    finally:
        whole = time.perf_counter() - began
        step.loops = loops
        del step.neighbours.rebuild
        for name, stage in step.stages.items():
            if isinstance(stage, Timed):
                step.stages[name] = stage.run
    seconds[BETWEEN] = whole - sum(seconds.values())
    return {name: 1e3 * spent / steps for name, spent in seconds.items()}


def neighbours_in_support(scene: Scene, position: np.ndarray) -> float:
    """Mean number of fluid neighbours inside the support, from a sample of particles."""
    reach = SMOOTHING[scene.smoothing.kernel].support * scene.smoothing_length * (1.0 - 1e-6)  # 0 at its very edge
    return float(neighbours(position[sample(len(position))], position, reach).mean()) - 1.0  # without itself


def bytes_per_particle(simulation: Simulation) -> float:
    """Memory of all arrays over the particle count, walls and cells too [bytes]."""
    sizes: dict[int, int] = {}  # by address; an array that looks at another's memory has no deleter
    seen: set[int] = set()
    owners: list[Any] = [simulation]
    while owners:
        owner = owners.pop()
        if id(owner) not in seen and type(owner).__module__.startswith("warpsph.") and hasattr(owner, "__dict__"):
            seen.add(id(owner))
            parts = list(vars(owner).values())
            parts += [part for several in parts if isinstance(several, tuple) for part in several]
            owners += parts
            for array in parts:
                if isinstance(array, wp.array) and array.deleter:
                    sizes[array.ptr] = array.capacity
    return sum(sizes.values()) / simulation.model.particle_count


def peak_memory() -> int:
    """The most that this process has taken so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
