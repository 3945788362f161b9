"""What a machine with one CUDA GPU should be asked first: does everything run, is it right, how fast is it?

    python tools/gpu_check.py --json gpu.json                  all of it on cuda:0, at most 8 minutes
    python tools/gpu_check.py --only compile agreement rates   some of it
    python tools/gpu_check.py --device cpu --small             the same list at sizes that two cores do in a few minutes

Its sections come in the order of what they are worth, each in a process of its own, so that one that fails, hangs or
runs out of time takes nothing along:

    compile     every scene that ships takes a few steps, in as many processes as there are cores: all kernels compile
    agreement   200 steps on the CPU and on the device: particles end where another order of summation would put them
    landslide   `scene landslide.yaml` with all output, in seconds
    small_steps steps of scenes of a few thousand particles
    rates       whole steps and pair sweeps: the dam break, the column in space; stages, bandwidth, waits; lists, cells
    resume      a run that goes on from a checkpoint has the bits of one that was never interrupted
    interrupt   Ctrl-C in the middle of a run, and a scene that does not fit into memory: one line each
    tests       those that take a device
    largest     as many particles as fit

A machine without a network needs what pyproject.toml asks for, carried along as wheels that are laid out here:

    python -m pip install --target site '.[test]'              here; then there, where the driver is all that is needed
    PYTHONPATH=site python tools/gpu_check.py --json gpu.json

Exit code: 0 when all sections that were reached are as they should be, 1 when one is not.
"""

import argparse
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tools" / "bench")]

import bandwidth  # noqa: E402
import bench  # noqa: E402
import cases  # noqa: E402
import stages  # noqa: E402

from warpsph.output.checkpoint import read_checkpoint, write_checkpoint  # noqa: E402
from warpsph.scene.loading import load_scene  # noqa: E402
from warpsph.simulation import Simulation  # noqa: E402

SCENES = ROOT / "scenes"
# Walls that push and dummy particles, in the plane and in space, images, bodies and a paddle made of either.
AGREEING: dict[str, tuple[str, ...]] = {
    "landslide": (),
    "dam_break": (),
    "still_water_3d": (),
    "floating_box_3d": (),
    "couette": (),
    "column_3d": (),
    "wave_maker": (),
}
AGREEMENT_STEPS = 200
SMALL_SCENES = ("landslide", "wave_maker", "block_maciel", "floating_box_3d", "couette", "herschel_bulkley")
# What a case of `rates` is other than the benchmark's: it has walls that push, the default is dummy particles.
VARIANTS = {
    "lists": ["neighbours=lists"],
    "cells": ["neighbours=cells"],
    "auto": [],
    "dummies": ["wall_model={force: dummy_particles}", "smoothing.ratio=1.4"],
}
# Differences that rounding the start makes are this many times smaller than what is allowed between two devices: these
# round at every step, not only once.
MORE_ROUNDING = 100.0
DEADLINE = 480.0  # [s]


@dataclass(frozen=True)
class Sizes:
    """How large to make things: for a GPU, or for trying this out on a CPU."""

    plane: tuple[int, ...]
    space: tuple[int, ...]
    steps: int
    largest: tuple[int, ...]
    until: float  # end time of the landslide [s]; inf: its own
    patience: float  # how many times as long anything may take


FULL = Sizes((1_000_000, 4_000_000), (1_000_000, 4_000_000, 16_000_000), 100, (30_000_000,), math.inf, 1.0)
SMALL = Sizes((10_000,), (8_000,), 10, (20_000,), 0.01, 8.0)


def show(text: str) -> None:
    """Print a line at once."""
    print(f"    {text}", flush=True)


def simulate(scene: str, device: str, overrides: tuple[str, ...] = ()) -> Any:
    """A simulation of a scene that ships."""
    threads = max(1, (os.cpu_count() or 1) // 4) if device == "cpu" else None  # others run beside it
    return Simulation(load_scene(SCENES / f"{scene}.yaml", overrides), device, threads)


def run_steps(simulation: Any, steps: int) -> None:
    """Take so many steps of the first phase."""
    simulation.step.aim_at(simulation.scene.run.end_time)
    simulation.step.run(steps)


# -------------------------------------------------------------------------------------------------------- the sections


def first_steps(scene: str, device: str) -> dict[str, Any]:
    """A few steps of one scene: `compile` runs this for each in a process of its own."""
    began = time.perf_counter()
    simulation = simulate(scene, device)
    run_steps(simulation, 5)
    simulation.gauges.levels()
    simulation.energy.measure()
    simulation.state.snapshot()
    fault = int(simulation.state.fault.numpy()[0])
    return {"seconds": time.perf_counter() - began, "steps": simulation.step_count, "fault": fault}


def compile_all(device: str, sizes: Sizes) -> dict[str, Any]:
    """All scenes take a few steps, in parallel; seconds until all kernels are compiled."""
    names = sorted(path.stem for path in SCENES.glob("*.yaml"))
    names = names[:3] if sizes is SMALL else names
    began = time.perf_counter()
    with ThreadPoolExecutor(max(2, min(len(names), (os.cpu_count() or 2) - 1))) as pool:
        results = list(pool.map(lambda name: in_process(f"first_steps:{name}", device, sizes, 300.0), names))
    for name, result in zip(names, results, strict=True):
        show(f"{name:<28} {result.get('error') or '{seconds:6.1f} s, fault {fault}'.format(**result)}")
    seconds = time.perf_counter() - began
    show(f"all in {seconds:.1f} s")
    return {
        "seconds": seconds,
        "scenes": dict(zip(names, results, strict=True)),
        "ok": all("error" not in result and result["fault"] == 0 for result in results),
    }


def agreement(device: str, sizes: Sizes) -> dict[str, Any]:
    """How far particles are from where the CPU has them, against what rounding the start does to the CPU's own."""
    found, ok = {}, True
    for scene in list(AGREEING)[:2] if sizes is SMALL else AGREEING:
        steps = 20 if sizes is SMALL else AGREEMENT_STEPS
        one, other, rounded = (simulate(scene, where, AGREEING[scene]) for where in ("cpu", device, "cpu"))
        position = rounded.state.position
        position.assign(position.numpy().astype(np.float32).astype(float))
        for simulation in (one, other, rounded):
            run_steps(simulation, steps)
        reference = one.state.snapshot()
        spacing = one.scene.spacing

        def distance(simulation: Any, reference: Any = reference, spacing: float = spacing) -> tuple[float, float]:
            apart = np.linalg.norm(simulation.state.snapshot().position - reference.position, axis=1) / spacing
            return float(apart.max()), float(np.sqrt((apart**2).mean()))

        (worst, mean), (worst_rounded, mean_rounded) = distance(other), distance(rounded)
        fits = mean <= MORE_ROUNDING * max(mean_rounded, 1e-8)
        ok &= fits
        found[scene] = {"worst": worst, "rms": mean, "rounded worst": worst_rounded, "rounded rms": mean_rounded}
        show(
            f"{scene:<20} {steps} steps: rms {mean:.1e} dx, worst {worst:.1e}; "
            f"start rounded: {mean_rounded:.1e}, {worst_rounded:.1e}{'' if fits else '   TOO FAR APART'}"
        )
    return found | {"ok": ok}


def landslide(device: str, sizes: Sizes) -> dict[str, Any]:
    """The whole command, twice: the first time compiles what is not yet compiled."""
    seconds, outcome = [], {}
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(2):
            out = Path(folder) / str(turn)
            command = ["scene", str(SCENES / "landslide.yaml"), "--device", device, "--out", str(out)]
            command += ["--until", str(sizes.until)] if math.isfinite(sizes.until) else []
            began = time.perf_counter()
            done = warpsph(*command)
            seconds.append(time.perf_counter() - began)
            if done.returncode:
                return {"error": done.stderr[-800:] + done.stdout[-800:], "ok": False}
            outcome = json.loads((out / "run.json").read_text(encoding="utf-8"))
    speed = outcome["speed"]
    show(f"{seconds[0]:.2f} s, then {seconds[1]:.2f} s; {speed}")
    gauges = outcome.get("gauges")
    show(f"gauges: {gauges}")
    return {"seconds": seconds, "speed": speed, "gauges": gauges, "ok": True}


def rates(device: str, sizes: Sizes) -> dict[str, Any]:
    """Whole-step rates by the benchmark, sizes ascending; lists against cells and dummies at the first of each."""
    found = []
    wanted = [("dam_break", n, "lists") for n in sizes.plane] + [("column_3d", n, "lists") for n in sizes.space[:2]]
    for variant in ("dummies", "cells"):
        wanted += [("dam_break", sizes.plane[0], variant), ("column_3d", sizes.space[0], variant)]
    wanted += [("column_3d", n, "lists") for n in sizes.space[2:]]
    for case, particles, variant in wanted:
        result = in_process(f"rate:{case}:{particles}:{variant}", device, sizes, 150.0)
        found.append({"case": case, "particles": particles, "variant": variant} | result)
        if "error" in result:
            show(f"{case} {particles} {variant}: {result['error'][-600:]}")
    return {"cases": found, "ok": all("error" not in result for result in found)}


def rate(case: str, particles: str, variant: str, device: str, sizes: Sizes) -> dict[str, Any]:
    """One entry of `rates`."""
    began = time.perf_counter()
    chosen = cases.CASES[case](int(particles), VARIANTS[variant])
    with bandwidth.recorded_launches() as recorded:
        simulation = bench.ready(chosen.scene, device, None, None)
        set_up = time.perf_counter() - began
        timing = bench.time_steps(simulation, sizes.steps)
        listed = simulation.step.neighbours.rebuilds
        table = stages.stage_times(simulation.step, min(sizes.steps, 30))
    count, sweeps = simulation.model.particle_count, simulation.step.sweeps
    slow = {name: ms for name, ms in table.items() if name.startswith("pair loop")}
    result = {
        "particles placed": count,
        "set up": set_up,
        "updates per second": timing.updates_per_second,
        "sweeps per second": {name: count / (1e-3 * ms) for name, ms in slow.items()},
        "neighbours": timing.neighbours_listed,
        "steps per list": timing.steps_per_list,
        "stages": table,
        "bytes per particle": stages.bytes_per_particle(simulation),
        "lists": listed,
    }
    show(
        f"{case} {count:,} {variant}: {timing.updates_per_second / 1e6:.1f} M updates/s; {sweeps} sweeps, "
        + ", ".join(f"{n / 1e6:.0f} M/s" for n in result["sweeps per second"].values())
        + f"; {timing.neighbours_listed:.1f} listed, lists every {timing.steps_per_list:.1f} steps; "
        f"{result['bytes per particle']:.0f} bytes a particle; set up in {set_up:.1f} s"
    )
    if simulation.launcher.device.is_cuda:
        copied = bandwidth.copy_bandwidth(device)
        moved = bandwidth.step_bytes(simulation, recorded)
        result["bandwidth"] = {"copied": copied, "share": moved * timing.updates_per_second / count / copied}
        show(f"    {result['bandwidth']['share']:.0%} of {copied / 1e9:.0f} GB/s")
    show("    " + ", ".join(f"{name} {ms:.3f}" for name, ms in table.items()) + " ms")
    return result


def small_steps(device: str, sizes: Sizes) -> dict[str, Any]:
    """Steps of scenes that ship, where what counts is how long a launch and a loop in one thread take."""
    found = {}
    for scene in SMALL_SCENES[:1] if sizes is SMALL else SMALL_SCENES:
        simulation = simulate(scene, device)
        simulation.step.aim_at(1e9)
        simulation.step.run(sizes.steps)
        timing = bench.time_steps(simulation, 5 * sizes.steps)
        table = stages.stage_times(simulation.step, sizes.steps)
        count = simulation.model.particle_count
        step = 1e3 * count / timing.updates_per_second
        found[scene] = {"particles": count, "milliseconds a step": step, "stages": table}
        show(f"{scene} {count:,}: {step:.3f} ms a step, lists every {timing.steps_per_list:.1f}")
        show("    " + ", ".join(f"{name} {ms:.3f}" for name, ms in table.items()) + " ms")
    return found | {"ok": True}


def resume(device: str, sizes: Sizes) -> dict[str, Any]:
    """Bits after a checkpoint in the middle against those of a run without."""
    found, ok = {}, True
    for scene in ("landslide",) if sizes is SMALL else ("landslide", "floating_box_3d", "couette"):
        whole, parts, again = (simulate(scene, device) for _ in range(3))
        start, dt = whole.time, float(whole.state.dt_limit.numpy()[0])
        half, end = (start + steps * dt for steps in ((5, 10) if sizes is SMALL else (60, 120)))

        def bits(simulation: Simulation) -> dict[str, bytes]:
            return {name: array.numpy().tobytes() for name, array in simulation.kept().items()}

        whole.reach(half)
        whole.reach(end)
        parts.reach(half)
        with tempfile.TemporaryDirectory() as folder:
            write_checkpoint(Path(folder), parts)
            read_checkpoint(Path(folder), again)
        again.enter_phase()
        again.step.resume()
        again.reach(end)
        expected, got = bits(whole), bits(again)
        different = [name for name in expected if expected[name] != got[name]]
        found[scene], ok = different, ok and not different
        show(f"{scene:<20} {'same bits' if not different else 'DIFFERENT: ' + ', '.join(different)}")
    return {"different": found, "ok": ok}


def interrupt(device: str, sizes: Sizes) -> dict[str, Any]:
    """One line and an exit code for Ctrl-C and for too large a scene."""
    found, ok = {}, True
    with tempfile.TemporaryDirectory() as folder:
        stopped = Path(folder) / "stopped"
        command = ["scene", str(SCENES / "still_water.yaml"), "--device", device, "--out", str(stopped)]
        with subprocess.Popen(
            [sys.executable, "-m", "warpsph", *command],
            cwd=ROOT,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        ) as process:
            until = time.perf_counter() + 60.0 * sizes.patience
            while not (stopped / "energy.csv").exists() and time.perf_counter() < until:
                time.sleep(0.1)
            time.sleep(1.0)
            process.send_signal(signal.SIGINT)
            try:
                text, _ = process.communicate(timeout=60.0 * sizes.patience)
            except subprocess.TimeoutExpired:
                process.kill()
                text, _ = process.communicate()
        found["Ctrl-C"] = {"exit": process.returncode, "text": text[-500:]}
        ok &= "Traceback" not in text and process.returncode is not None and process.returncode >= 0
        show(f"Ctrl-C: exit {process.returncode}, {text.strip().splitlines()[-1] if text.strip() else ''}")
        # A cube of 0.5 m: more particles than any memory holds, asked for on purpose.
        large = ["scene", str(SCENES / "column_3d.yaml"), "--set", "spacing=0.0003", "--device", device]
        try:
            done = warpsph(*large, "--out", str(Path(folder) / "large"), timeout=90.0 * sizes.patience)
            text, code = done.stderr + done.stdout, done.returncode
        except subprocess.TimeoutExpired:
            text, code = "did not end", -1
        found["memory"] = {"exit": code, "text": text[-500:]}
        ok &= "Traceback" not in text and code in (2, 4)
        show(f"too large: exit {code}, {text.strip().splitlines()[-1] if text.strip() else ''}")
    return found | {"ok": ok}


def tests(device: str, sizes: Sizes) -> dict[str, Any]:
    """The tests that take a device, on this one."""
    name = "cpu" if device == "cpu" else "cuda"
    chosen = ["tests/step/test_neighbours.py"] if sizes is SMALL else ["tests"]
    command = [sys.executable, "-m", "pytest", "-q", "-k", f"{name} and not codegen", *chosen, "--maxfail=40"]
    parallel = subprocess.run([sys.executable, "-c", "import xdist"], capture_output=True).returncode == 0
    command += ["-n", str(min(12, os.cpu_count() or 1))] if parallel else []
    done = subprocess.run(command, cwd=ROOT, text=True, capture_output=True)
    lines = done.stdout.strip().splitlines()
    for line in [line for line in lines if line.startswith(("FAILED", "ERROR"))][:40] + lines[-1:]:
        show(line[:300])
    return {"summary": lines[-1] if lines else "", "output": done.stdout[-20000:], "ok": done.returncode == 0}


def largest(device: str, sizes: Sizes) -> dict[str, Any]:
    """The column in space with as many particles as one card should hold, and more, a few steps."""
    found = [in_process(f"rate:column_3d:{particles}:auto", device, sizes, 300.0) for particles in sizes.largest]
    for result in found:
        if "error" in result:
            show(result["error"][-600:])
    return {"cases": found, "ok": all("error" not in result for result in found)}


SECTIONS: dict[str, tuple[Callable[[str, Sizes], dict[str, Any]], float]] = {  # with the longest that each may take [s]
    "compile": (compile_all, 300.0),
    "agreement": (agreement, 120.0),
    "landslide": (landslide, 90.0),
    "small_steps": (small_steps, 90.0),
    "rates": (rates, 300.0),
    "resume": (resume, 60.0),
    "interrupt": (interrupt, 180.0),
    "tests": (tests, 240.0),
    "largest": (largest, 240.0),
}
PARTS: dict[str, Callable[..., dict[str, Any]]] = {"first_steps": lambda *a: first_steps(*a[:2]), "rate": rate}


# ---------------------------------------------------------------------------------------------------------- processes


def warpsph(*words: str, timeout: float | None = None) -> subprocess.CompletedProcess[str]:
    """Run the program as a user would."""
    command = [sys.executable, "-m", "warpsph", *words]
    return subprocess.run(command, cwd=ROOT, text=True, capture_output=True, timeout=timeout)


def in_process(name: str, device: str, sizes: Sizes, limit: float) -> dict[str, Any]:
    """Run a section or a part of one in a process of its own; {"error": ...} if that fails or takes too long."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, __file__, "--device", device, "--part", name, "--json", str(answer)]
        command += ["--small"] if sizes is SMALL else []
        try:
            done = subprocess.run(command, cwd=ROOT, timeout=sizes.patience * limit, stderr=subprocess.PIPE, text=True)
        except subprocess.TimeoutExpired:
            return {"error": f"did not end within {sizes.patience * limit:.0f} s", "ok": False}
        if not answer.exists():
            return {"error": done.stderr[-3000:] or f"exit code {done.returncode}", "ok": False}
        return json.loads(answer.read_text(encoding="utf-8"))


def run_part(name: str, device: str, sizes: Sizes) -> dict[str, Any]:
    """What `in_process` runs on the other side."""
    wp.config.log_level = wp.LOG_WARNING
    head, *words = name.split(":")
    try:
        return PARTS[head](*words, device, sizes) if head in PARTS else SECTIONS[head][0](device, sizes)
    except Exception:
        return {"error": traceback.format_exc(), "ok": False}


def main() -> int:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--only", nargs="+", choices=SECTIONS, default=list(SECTIONS), metavar="SECTION")
    parser.add_argument("--small", action="store_true", help="sizes for two cores")
    parser.add_argument("--deadline", type=float, default=DEADLINE, help=f"seconds for all of it ({DEADLINE:.0f})")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument("--part", help=argparse.SUPPRESS)
    options = parser.parse_args()
    sizes = SMALL if options.small else FULL
    if options.part:
        options.json.write_text(json.dumps(run_part(options.part, options.device, sizes)), encoding="utf-8")
        return 0

    began, found = time.perf_counter(), {}
    for name in options.only:
        left = options.deadline - (time.perf_counter() - began)
        if left < 10.0:
            print(f"{name}: not reached", flush=True)
            continue
        print(f"{name}:", flush=True)
        start = time.perf_counter()
        found[name] = in_process(name, options.device, sizes, min(left / sizes.patience, SECTIONS[name][1]))
        if "error" in found[name]:
            show(found[name]["error"][-1500:])
        print(f"    [{'ok' if found[name]['ok'] else 'NOT OK'}, {time.perf_counter() - start:.1f} s]", flush=True)
        if options.json:  # after each, for what comes next may take the machine with it
            options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    fine = ", ".join(name for name, result in found.items() if result["ok"])
    print(f"done in {time.perf_counter() - began:.0f} s: {fine} as it should be")
    return 0 if all(result["ok"] for result in found.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
