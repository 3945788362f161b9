"""Benchmark: whole-step speed on this machine, on the lattice and in developed flow.

    python tools/bench/bench.py                                      dam break, 40,000 particles, 1 thread and all
    python tools/bench/bench.py --particles 10000 40000 160000 --threads 2 --repeat 3
    python tools/bench/bench.py --case column_3d --particles 100000 1000000
    python tools/bench/bench.py --case landslide --json bench.json
    python tools/bench/bench.py --peer pysph --peer-python ~/pysph/bin/python

The dam break is a column of 1 m x 1 m in a tank of 3 m x 1.5 m: Wendland C2, h / dx = 1.5, Tait, c = 10 sqrt(g H),
alpha = 0.02. `column_3d` is a cube of 0.5 m, `landslide` the scene that ships. A particle-update is one fluid particle
moved by one whole step, lists and all, output left out. "On the lattice" are the first steps of the case, "developed
flow" those from t = 0.5 s. Every repeat starts from the same particles, so their range is the machine's own.

What it prints beside the speed:
- sweeps: pair loops over every neighbour of every particle;
- neighbours listed (within the support and a margin) and inside the support;
- a table of the stages of a step, timed one by one, which adds some microseconds to each;
- bytes per particle: arrays on the device, the scratch of sorting left out; peak memory: what the process took
  beyond Python, Warp and kernels, until the first timed run ended (kernels compiled here hide some of it: run again);
- pressure noise: see noise.py; --peer: see peer.py; on a GPU the share of its bandwidth: see bandwidth.py.
"""

import argparse
import gc
import json
import os
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from bandwidth import Recorded, copy_bandwidth, recorded_launches, step_bytes
from cases import CASES, SIZES, Case, dam_break
from noise import pressure_noise
from peer import PROGRAM, PeerError, run_peer, write_case
from stages import LISTS, bytes_per_particle, neighbours_in_support, peak_memory, stage_times

from warpsph.device.launch import DeviceError, available_cores
from warpsph.output.checkpoint import read_checkpoint, write_checkpoint
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.simulation import BlowUpError, Simulation

LATTICE, DEVELOPED = "on the lattice", "developed flow"
DEVELOPED_TIME = 0.5  # [s]
NOISE_TIMES = np.linspace(0.2, 0.5, 16)  # [s]
WARM_UP_STEPS = 20


# --------------------------------------------------------------------------------------------------------- running it


@dataclass(frozen=True)
class Plan:
    """What to measure: `repeat` times `steps` steps on each number of threads, beside a peer's if `peer` is named."""

    device: str
    threads: list[int]
    steps: int
    repeat: int
    developed: bool
    peer: str | None
    peer_python: str


@dataclass(frozen=True)
class Timing:
    """What one timed run gave."""

    updates_per_second: float
    simulated_per_wall: float  # [s/s]
    steps_per_list: float
    neighbours_listed: float


@dataclass
class Phase:
    """A phase of a case, timed: one entry a repeat, for each number of threads."""

    start: Path | None  # folder of a checkpoint; None: the beginning
    ours: dict[int, list[Timing]] = field(default_factory=dict)
    theirs: dict[int, list[float]] = field(default_factory=dict)  # particle-updates/s of the peer
    in_support: float = 0.0  # mean number of neighbours
    peak: int = 0  # memory of the process after the first run [bytes]


def begin(scene: Scene, device: str, threads: int, start: Path | None) -> Simulation:
    """A simulation at the beginning, or where the checkpoint in `start` was written."""
    gc.collect()
    simulation = Simulation(scene, device, threads)
    if start:
        read_checkpoint(start, simulation)
        simulation.enter_phase()
        simulation.step.resume()
    return simulation


def ready(scene: Scene, device: str, threads: int, start: Path | None) -> Simulation:
    """A simulation that has compiled its kernels and filled its caches."""
    simulation = begin(scene, device, threads, start)
    simulation.step.aim_at(1e9)
    simulation.step.run(WARM_UP_STEPS)
    return simulation


def time_steps(simulation: Simulation, steps: int) -> Timing:
    """Run `steps` whole steps by the clock.

    Raises:
        BlowUpError: it stopped before.
    """
    rebuilds, first, simulated = simulation.step.neighbours.rebuilds, simulation.step_count, simulation.time
    wp.synchronize()
    began = time.perf_counter()
    simulation.step.run(steps)
    wp.synchronize()
    seconds = time.perf_counter() - began
    if (taken := simulation.step_count - first) != steps:
        raise BlowUpError(f"only {taken} of {steps} steps could be taken")
    return Timing(
        updates_per_second=steps * simulation.model.particle_count / seconds,
        simulated_per_wall=(simulation.time - simulated) / seconds,
        steps_per_list=steps / max(simulation.step.neighbours.rebuilds - rebuilds, 1),
        neighbours_listed=float(simulation.step.neighbours.neighbour_count.numpy().mean()),
    )


def run_up(case: Case, device: str, threads: int, folder: Path) -> list[float]:
    """Run to developed flow and leave a checkpoint in `folder`; the pressure noise on the way."""
    simulation = begin(case.scene, device, threads, None)
    noise = []
    for moment in NOISE_TIMES if case.pressure_scale else ():
        simulation.reach(moment)
        s = simulation.state.snapshot()
        walls, spacing = simulation.model.wall_position.numpy(), case.scene.spacing
        noise.append(pressure_noise(s.position, s.pressure, walls, spacing, case.pressure_scale))
    simulation.reach(DEVELOPED_TIME)
    folder.mkdir()
    write_checkpoint(folder, simulation)
    return noise


def time_phase(case: Case, plan: Plan, start: Path | None) -> Phase:
    """Time a phase, all numbers of threads in turn, then all again; the peer after each."""
    phase = Phase(start)
    with tempfile.TemporaryDirectory() as folder:
        peer_case = Path(folder) / "case.npz"
        for _ in range(plan.repeat):
            for threads in plan.threads:
                simulation = ready(case.scene, plan.device, threads, start)
                phase.ours.setdefault(threads, []).append(time_steps(simulation, plan.steps))
                phase.peak = phase.peak or peak_memory()
                del simulation
                if plan.peer:
                    if not peer_case.exists():
                        snapshot = begin(case.scene, plan.device, threads, start).state.snapshot()
                        write_case(peer_case, case.scene, snapshot, WARM_UP_STEPS, plan.steps)
                    speed = run_peer(plan.peer, plan.peer_python, peer_case, threads)
                    phase.theirs.setdefault(threads, []).append(speed)
                show_run(phase, threads)
    position = begin(case.scene, plan.device, max(plan.threads), start).state.snapshot().position
    phase.in_support = neighbours_in_support(case.scene, position)
    return phase


# ---------------------------------------------------------------------------------------------------------- the figures


def bench(case: Case, plan: Plan, own_memory: int) -> list[dict[str, Any]]:
    """All figures of one case, an entry for each number of threads; `own_memory` is the interpreter's [bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        noise: list[float] = []
        phases = {LATTICE: time_phase(case, plan, None)}
        if plan.developed:
            start = Path(folder) / "developed"
            noise = run_up(case, plan.device, max(plan.threads), start)
            phases[DEVELOPED] = time_phase(case, plan, start)
        results = [summary(case, plan.device, threads, phases) for threads in plan.threads]
    for result in results:
        result["peak memory"] = phases[LATTICE].peak - own_memory
        if noise:
            result["pressure noise"], result["pressure noise samples"] = float(np.median(noise)), noise
    return results


def summary(case: Case, device: str, threads: int, phases: dict[str, Phase]) -> dict[str, Any]:
    """The figures of all phases on a number of threads, and the stages of the last."""
    *_, (name, last) = phases.items()
    with recorded_launches() as recorded:
        simulation = ready(case.scene, device, threads, last.start)
        stages = stage_times(simulation.step)
    found: dict[str, Any] = {
        "case": case.name,
        "device": simulation.launcher.device.name,
        "threads": simulation.launcher.threads,
        "particles": simulation.model.particle_count,
        "evaluations per step": simulation.step.evaluations,
        "sweeps per step": simulation.step.sweeps,
        "milliseconds a step": stages,
        "list rebuild share": stages[LISTS] / sum(stages.values()),
        "bytes per particle": bytes_per_particle(simulation),
    }
    for phase, times in phases.items():
        found[phase] = phase_figures(times, threads, found["sweeps per step"])
    if simulation.launcher.device.is_cuda:
        found["bandwidth"] = bandwidth_share(simulation, recorded, found[name]["updates per second"])
    return found


def phase_figures(phase: Phase, threads: int, sweeps_per_step: int) -> dict[str, Any]:
    """The figures of a phase on a number of threads: medians, and the range of the speed."""
    ours, theirs = phase.ours[threads], phase.theirs.get(threads, [])
    speeds = [timing.updates_per_second for timing in ours]
    speed = float(np.median(speeds))
    found: dict[str, Any] = {
        "updates per second": speed,
        "range": [min(speeds), max(speeds)],
        "sweeps per second": speed * sweeps_per_step,
        "simulated seconds per second": float(np.median([timing.simulated_per_wall for timing in ours])),
        "steps per list": ours[-1].steps_per_list,
        "neighbours listed": ours[-1].neighbours_listed,
        "neighbours in support": phase.in_support,
    }
    if theirs:
        found["peer updates per second"] = theirs
        found["ratios"] = [our / their for our, their in zip(speeds, theirs, strict=True)]
    return found


def bandwidth_share(simulation: Simulation, recorded: Recorded, updates_per_second: float) -> dict[str, float]:
    """Copy bandwidth [bytes/s], bytes that a step must move, and the share of the bandwidth that steps use."""
    copied, moved = copy_bandwidth(simulation.launcher.device.alias), step_bytes(simulation, recorded)
    share = moved * updates_per_second / simulation.model.particle_count / copied
    return {"copy bandwidth": copied, "bytes a step": moved, "share": share}


# ------------------------------------------------------------------------------------------------------------- printing


def show_run(phase: Phase, threads: int) -> None:
    """Print the last timed run of a phase on a number of threads, as it comes."""
    ours, name = phase.ours[threads][-1].updates_per_second, DEVELOPED if phase.start else LATTICE
    line = f"{name}, {threads} thread(s): {ours / 1e6:.2f} M particle-updates/s"
    if threads in phase.theirs:
        theirs = phase.theirs[threads][-1]
        line += f", peer {theirs / 1e6:.2f}, ours over theirs {ours / theirs:.2f}"
    print(line, flush=True)


def show(figures: dict[str, Any]) -> None:
    """Print the figures of one case on one number of threads."""
    print(
        f"{figures['case']}: {figures['particles']:,} particles, {figures['device']}, {figures['threads']} thread(s), "
        f"{figures['evaluations per step']} evaluation(s) and {figures['sweeps per step']} sweep(s) a step"
    )
    for phase in (LATTICE, DEVELOPED):
        if phase in figures:
            show_phase(phase, figures[phase])
    stages = figures["milliseconds a step"]
    whole = sum(stages.values())
    for name, milliseconds in stages.items():
        print(f"    {name:<40} {milliseconds:8.3f} ms {milliseconds / whole:6.1%}")
    print(f"  list building    {figures['list rebuild share']:.1%} of the time")
    peak = figures["peak memory"]
    print(
        f"  memory           {figures['bytes per particle']:.0f} bytes a particle; peak "
        f"{peak / 2**20:.0f} MB over the interpreter's own, {peak / figures['particles']:.0f} bytes a particle"
    )
    if "pressure noise" in figures:
        print(f"  pressure noise   {figures['pressure noise']:.2%} of rho g H, median of t = 0.2 to 0.5 s")
    if "bandwidth" in figures:
        b = figures["bandwidth"]
        print(
            f"  bandwidth        {b['share']:.1%} at least of {b['copy bandwidth'] / 1e9:.0f} GB/s copied; "
            f"a step moves {b['bytes a step'] / 1e6:.1f} MB or more"
        )


def show_phase(name: str, f: dict[str, Any]) -> None:
    """Print the figures of a phase."""
    low, high = f["range"]
    print(
        f"  {name:<16} {f['updates per second'] / 1e6:6.2f} M particle-updates/s "
        f"[{low / 1e6:.2f} to {high / 1e6:.2f}], {f['sweeps per second'] / 1e6:.2f} M sweeps/s, "
        f"{f['simulated seconds per second']:.3g} simulated s/s"
    )
    print(
        f"  {'':<16} neighbours: {f['neighbours listed']:.1f} listed, {f['neighbours in support']:.1f} in the support; "
        f"new lists every {f['steps per list']:.1f} steps"
    )
    if "ratios" in f:
        low, high = min(f["ratios"]), max(f["ratios"])
        print(f"  {'':<16} {np.median(f['ratios']):.2f} times the peer's speed [{low:.2f} to {high:.2f}]")


def at_least_one(text: str) -> int:
    """A count from the command line."""
    if (count := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"{count} is less than 1")
    return count


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", choices=CASES, default="dam_break")
    parser.add_argument(
        "--particles", type=at_least_one, nargs="+", metavar="N", help="sizes (default 40,000; column_3d 100,000)"
    )
    parser.add_argument("--diffusion", metavar="NAME", help="density diffusion (dam break: none unless named here)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change a field of the scene")
    parser.add_argument("--threads", type=at_least_one, nargs="+", metavar="N", default=sorted({1, available_cores()}))
    parser.add_argument("--device", default="cpu", help="cpu or cuda:0; a GPU counts as one thread")
    parser.add_argument("--steps", type=at_least_one, default=300, help="steps of a timed run (default 300)")
    parser.add_argument("--repeat", type=at_least_one, help="timed runs of each kind (default 1; 3 with a peer)")
    parser.add_argument("--lattice-only", action="store_true", help="leave out the developed flow")
    parser.add_argument("--peer", choices=PROGRAM, help="run the dam break in another code too, in turns")
    parser.add_argument("--peer-python", default=sys.executable, metavar="PATH", help="interpreter that has the peer")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures to FILE as well")
    options = parser.parse_args(arguments)
    if options.case == "landslide" and options.particles:
        parser.error("landslide has a size of its own; leave --particles out")
    if options.peer and options.case != "dam_break":
        parser.error("a peer runs the dam break only")
    options.particles = sorted(options.particles or SIZES[options.case])  # so that the peak of memory is the last's
    options.repeat = options.repeat or (3 if options.peer else 1)
    if options.diffusion:
        options.set.append(f"density_diffusion.model={options.diffusion}")
    if options.device != "cpu":
        options.threads = [1]
    return options


def main(arguments: list[str] | None = None) -> int:
    """Run what the command line asks for."""
    options = parse(arguments)
    plan = Plan(
        device=options.device,
        threads=options.threads,
        steps=options.steps,
        repeat=options.repeat,
        developed=not options.lattice_only,
        peer=options.peer,
        peer_python=options.peer_python,
    )
    if (load := os.getloadavg()[0]) > 0.5:
        print(f"note: {load:.1f} processes were busy here in the last minute; what else runs spoils the figures")
    results = []
    try:
        small = dam_break(400, options.set if options.case == "dam_break" else ())
        ready(small.scene, plan.device, 1, None)  # loads Warp and kernels
        own_memory = peak_memory()
        for particles in options.particles:
            for result in bench(CASES[options.case](particles, options.set), plan, own_memory):
                results.append(result)
                show(result)
    except (SceneError, DeviceError, BlowUpError, PeerError) as error:
        print(f"bench: {error}", file=sys.stderr)
        return 1
    if options.json:
        options.json.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
