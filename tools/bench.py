"""Benchmark: whole-step speed of a dam break or of a scene file, on the lattice and in developed flow.

    python tools/bench.py                                  dam break, 40,000 particles, 1 thread and all
    python tools/bench.py --particles 10000 --threads 2
    python tools/bench.py --scene scenes/landslide.yaml
    python tools/bench.py --json bench.json

The dam break is a column of 1 m x 1 m in a tank of 3 m x 1.5 m: Wendland C2, h / dx = 1.5, Tait, c = 10 sqrt(g H),
alpha = 0.02. A particle-update is one fluid particle moved by one whole step, lists and all, output left out.
"""

import argparse
import json
import math
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from warpsph.launch import available_cores
from warpsph.scene import Scene, load_scene
from warpsph.simulation import Simulation

LATTICE_STEPS, DEVELOPED_STEPS = 300, 300
DEVELOPED_TIME = 0.5  # [s]
EVALUATIONS = 1  # of the forces a step; continuity is a second, lighter pair loop

DAM_BREAK = """
title: Dam break, column 1 m x 1 m
spacing: {spacing}
materials:
  water: {{density: 1000.0, sound_speed: {sound_speed}, alpha: 0.02}}
density_diffusion: {{model: {diffusion}}}
tensile_correction: false
xsph: 0.0
allow: [low_sound_speed]
walls:
  - {{name: tank, path: [[0.0, 1.5], [0.0, 0.0], [3.0, 0.0], [3.0, 1.5]]}}
fluids:
  - {{name: water, material: water, shape: {{box: {{min: [0.0, 0.0], max: [1.0, 1.0]}}}}}}
run: {{end_time: 2.0}}
"""

STAGES = {
    "_drift_half": "drift, pressure",
    "_accelerate": "pair loop: forces",
    "_push_off_walls": "walls",
    "_kick_and_drift": "kick, drift, limits",
    "_density_rate": "pair loop: continuity",
    "_finish_density": "density",
    "_watch": "extremes",
    "_advance_clock": "clock",
}


def dam_break(particles: int, diffusion: str) -> Scene:
    """The dam break with about `particles` particles."""
    spacing = 1.0 / round(math.sqrt(particles))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dam_break.yaml"
        sound_speed = 10.0 * math.sqrt(9.81)
        path.write_text(DAM_BREAK.format(spacing=spacing, sound_speed=sound_speed, diffusion=diffusion))
        return load_scene(path)


def time_steps(simulation: Simulation, steps: int) -> dict[str, float]:
    """Run `steps` whole steps; particle-updates a second, and how many steps rebuilt the lists."""
    rebuilds = simulation.step.neighbours.rebuilds
    simulation.step.aim_at(1e9)
    wp.synchronize()
    began = time.perf_counter()
    for _ in range(steps):
        simulation.step()
    wp.synchronize()
    seconds = time.perf_counter() - began
    return {
        "updates per second": steps * simulation.model.particle_count / seconds,
        "steps per list": steps / max(simulation.step.neighbours.rebuilds - rebuilds, 1),
        "neighbours listed": float(simulation.step.neighbours.count.numpy().mean()),
    }


@contextmanager
def stage_clock(simulation: Simulation) -> Any:
    """Time each stage of the steps taken meanwhile: yields a dict of seconds by stage."""
    step, spent = simulation.step, dict.fromkeys([*STAGES.values(), "lists"], 0.0)

    def timed(name: str, run: Callable[..., Any]) -> Callable[..., Any]:
        def stage() -> Any:
            began = time.perf_counter()
            result = run()
            wp.synchronize()
            spent[name] += time.perf_counter() - began
            return result

        return stage

    bound = {attribute: getattr(step, attribute) for attribute in STAGES}
    for attribute, name in STAGES.items():
        setattr(step, attribute, timed(name, bound[attribute]))
    step.neighbours.rebuild = timed("lists", step.neighbours.rebuild)  # a list that grows meanwhile ends the clock
    try:
        yield spent
    finally:
        for attribute, run in bound.items():
            setattr(step, attribute, run)
        del step.neighbours.rebuild


def bytes_per_particle(simulation: Simulation) -> float:
    """Memory of state and lists over the particle count, the grid of the device left out."""
    parts = (simulation.state, simulation.step.neighbours)
    arrays = {id(a): a for part in parts for a in vars(part).values() if isinstance(a, wp.array)}
    return sum(array.capacity for array in arrays.values()) / simulation.model.particle_count


def bench(scene: Scene, device: str, threads: int, developed: bool) -> dict[str, Any]:
    """All figures of one case on one number of threads."""
    simulation = Simulation(scene, device, threads)
    for _ in range(20):  # compiles, fills caches
        simulation.step.aim_at(1e9)
        simulation.step()
    figures: dict[str, Any] = {
        "device": simulation.launcher.device.name,
        "threads": simulation.launcher.threads,
        "particles": simulation.model.particle_count,
        "evaluations per step": EVALUATIONS,
        "on the lattice": time_steps(simulation, LATTICE_STEPS),
    }
    if developed:
        simulation.advance(max(DEVELOPED_TIME, simulation.time))
        figures["developed flow"] = time_steps(simulation, DEVELOPED_STEPS)
    with stage_clock(simulation) as spent:
        for _ in range(100):
            simulation.step()
    figures["milliseconds a step"] = {name: 10.0 * seconds for name, seconds in spent.items()}
    figures["bytes per particle"] = bytes_per_particle(simulation)
    return figures


def show(figures: dict[str, Any]) -> None:
    """Print the figures of one bench."""
    print(f"{figures['particles']:,} particles, {figures['device']}, {figures['threads']} thread(s)")
    for phase in ("on the lattice", "developed flow"):
        if phase in figures:
            f = figures[phase]
            print(
                f"  {phase:<16} {f['updates per second'] / 1e6:6.2f} M particle-updates/s, "
                f"{f['neighbours listed']:.1f} neighbours listed, new lists every {f['steps per list']:.1f} steps"
            )
    stages = figures["milliseconds a step"]
    whole = sum(stages.values())
    for name, milliseconds in stages.items():
        print(f"    {name:<24} {milliseconds:8.3f} ms {milliseconds / whole:6.1%}")
    print(f"  memory           {figures['bytes per particle']:.0f} bytes a particle, grids left out")


def main() -> int:
    """Parse the command line and run the cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", type=Path, help="scene file instead of the dam break")
    parser.add_argument("--particles", type=int, default=40_000, help="of the dam break (default 40,000)")
    parser.add_argument("--diffusion", default="none", help="density diffusion of the dam break (default none)")
    parser.add_argument("--threads", type=int, nargs="+", default=sorted({1, available_cores()}))
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--lattice-only", action="store_true", help="leave out the developed flow")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to FILE as well")
    options = parser.parse_args()
    scene = load_scene(options.scene) if options.scene else dam_break(options.particles, options.diffusion)
    results = []
    for threads in options.threads:
        results.append(bench(scene, options.device, threads, not options.lattice_only))
        show(results[-1])
    if options.json:
        options.json.write_text(json.dumps(results, indent=2, default=np.ndarray.tolist) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
