"""Compares walls on the same tanks, all from t = 0 without a warm-up: `python tools/bench/tanks.py [--laws ...]`.

Prints the tables of kernels/README.md, a row as soon as a tank is done; some minutes on two cores.

    still water    largest speed ever and after 2 s over sqrt(g H), p on the lowest row less rho g (H - z) over
                   rho g H, level less what was filled
    dam break      deepest place of a particle behind a wall, drift of the energy over what was converted
    column         in the first 5 ms: pressure in the rear half less that at rest over rho g H, highest particle over H
    piston waves   first harmonic of the records of three gauges over the height of linear theory (Dean & Dalrymple
                   1991, 6.3)
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import get_args

import numpy as np

from warpsph.scene.boundaries import WallModel
from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.simulation import BlowUpError, Simulation

G = 9.81
LAWS = get_args(WallModel.model_fields["force"].annotation)

HEAD = """
title: A tank
spacing: {spacing}
materials: {{water: {{density: 1000.0, sound_speed: {c}, alpha: {alpha}}}}}
density_diffusion: {{model: fourtakas, delta: 0.1}}
xsph: 0.0
wall_model: {{force: {law}}}
"""
TANKS = {  # path, level, rows
    "2 rows": ("[[0.0, 0.3], [0.0, 0.0], [0.5, 0.0], [0.5, 0.3]]", 0.1, 2),
    "5 rows": ("[[0.0, 0.3], [0.0, 0.0], [0.5, 0.0], [0.5, 0.3]]", 0.1, 5),
    "10 rows": ("[[0.0, 0.3], [0.0, 0.0], [0.5, 0.0], [0.5, 0.3]]", 0.1, 10),
    "20 rows": ("[[0.0, 0.3], [0.0, 0.0], [0.5, 0.0], [0.5, 0.3]]", 0.1, 20),
    "step, 20 and 10 rows": ("[[0.0, 0.3], [0.0, 0.1], [0.3, 0.1], [0.3, 0.0], [0.6, 0.0], [0.6, 0.3]]", 0.2, 20),
    "V, 20 and 8 rows": ("[[0.0, 0.3], [0.0, 0.12], [0.3, 0.0], [0.6, 0.12], [0.6, 0.3]]", 0.2, 20),
}


def scene(text: str, **numbers: float | str) -> Scene:
    """The scene of a text with numbers in it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tank.yaml"
        path.write_text((HEAD + text).format(**numbers), encoding="utf-8")
        return load_scene(path)


def speed(simulation: Simulation) -> float:
    """The highest of a particle [m/s]."""
    return float(np.linalg.norm(simulation.state.velocity.numpy(), axis=1).max())


def still_water(law: str) -> Iterator[str]:
    """Rows of the table of still water."""
    yield "| still water | ever | after 2 s | pressure | level |\n|---|---|---|---|---|"
    for name, (path, level, rows) in TANKS.items():
        spacing = level / rows
        text = f"walls: [{{{{name: tank, path: {path}}}}}]\n" + (
            f"fluids: [{{{{name: water, material: water, fill: {{{{level: {level}, above: tank}}}}}}}}]\n"
            "gauges: [{{name: middle, x: 0.22}}]\nrun: {{end_time: 3.0}}\n"
        )
        made = scene(text, spacing=spacing, c=20.0, alpha=0.025, law=law)
        simulation, speeds = Simulation(made), []
        for time in np.linspace(0.0, 3.0, 61)[1:]:
            simulation.reach(time)
            speeds.append(speed(simulation) / math.sqrt(G * level))
        snapshot = simulation.state.snapshot()
        z, p = snapshot.position[:, 2], snapshot.pressure
        low = z < z.min() + 0.6 * spacing
        error = (p - 1000.0 * G * (level - z))[low].mean() / (1000.0 * G * level)
        rise = (simulation.gauges.levels()[0] - level) / spacing
        yield f"| {name} | {max(speeds):.1e} | {max(speeds[40:]):.1e} | {error:+.1%} | {rise:+.2f} dx |"


def dam_break(law: str) -> Iterator[str]:
    """The row of a column 1.2 m x 0.6 m that runs onto a wall 2 m away."""
    text = """
walls: [{{name: tank, path: [[0.0, 2.0], [0.0, 0.0], [3.22, 0.0], [3.22, 2.0]]}}]
fluids: [{{name: water, material: water, shape: {{box: {{min: [0.0, 0.0], max: [1.2, 0.6]}}}}}}]
run: {{end_time: 2.5}}
"""
    simulation = Simulation(scene(text, spacing=0.02, c=44.3, alpha=0.025, law=law))
    start, deepest, converted = simulation.energy.measure()[0], 0.0, 0.0
    for time in np.linspace(0.0, 2.5, 126)[1:]:
        simulation.reach(time)
        x = simulation.state.position.numpy()
        deepest = max(deepest, float(np.max([-x[:, 0], x[:, 0] - 3.22, -x[:, 2]])) / 0.02)
        budget = simulation.energy.measure()[0]
        converted = max(converted, start.potential - budget.potential)
    yield f"dam break, 30 rows: deepest {deepest:.2f} dx, energy {abs(budget.total - start.total) / converted:.2%}"


def column(law: str) -> Iterator[str]:
    """The row of a cube of water in 3-D, 20 rows high."""
    text = """
dimensions: 3
walls: [{{name: tank, box: {{min: [0.0, 0.0, 0.0], max: [1.5, 0.5, 0.75], open: [top]}}}}]
fluids:
  - {{name: water, material: water, shape: {{box: {{min: [0.0, 0.0, 0.0], max: [0.5, 0.5, 0.5]}}}}}}
run: {{end_time: 1.0}}
"""
    simulation = Simulation(scene(text, spacing=0.025, c=31.3, alpha=0.05, law=law))
    worst, top = 0.0, 0.0
    for time in (0.001, 0.002, 0.003, 0.004, 0.005):
        simulation.reach(time)
        snapshot = simulation.state.snapshot()
        x, p = snapshot.position, snapshot.pressure
        rear = x[:, 0] < 0.25
        worst = max(worst, float(np.abs(p - 1000.0 * G * (0.5 - x[:, 2]))[rear].max()) / (1000.0 * G * 0.5))
    simulation.reach(0.1)
    top = float(simulation.state.position.numpy()[:, 2].max()) / 0.5
    yield f"column in 3-D: pressure {worst:.1%}, highest particle {top:.2f} H after 0.1 s"


def piston(law: str) -> Iterator[str]:
    """The rows of regular waves, T = 1 s, d = 0.2 m, ten and twenty rows per depth."""
    depth, period, stroke = 0.2, 1.0, 0.025
    omega = 2.0 * math.pi / period
    k = omega**2 / G
    for _ in range(100):
        k = omega**2 / G / math.tanh(k * depth)
    theory = stroke * 2.0 * (math.cosh(2 * k * depth) - 1.0) / (math.sinh(2 * k * depth) + 2 * k * depth)
    group = 0.5 * omega / k * (1.0 + 2 * k * depth / math.sinh(2 * k * depth))
    places = [share * 2.0 * math.pi / k for share in (0.66, 1.15, 2.1)]
    gauges = ", ".join(f"{{{{name: g{i}, x: {x:.4f}}}}}" for i, x in enumerate(places))
    text = f"""
walls: [{{{{name: flume, path: [[-0.4, 0.5], [-0.4, 0.0], [6.0, 0.0], [9.0, 0.5]]}}}}]
fluids: [{{{{name: water, material: water, fill: {{{{level: {depth}, above: flume, between: [0.0, 7.3]}}}}}}}}]
bodies:
  - name: paddle
    shape: {{{{box: {{{{min: [-0.2, 0.0], max: [0.0, 0.4]}}}}}}}}
    density: 1000.0
    motion: {{{{kind: sine, shift: [{stroke / 2}, 0.0], period: {period}}}}}
gauges: [{gauges}]
run: {{{{end_time: 8.0}}}}
"""
    for rows, alpha in ((10, 0.01), (10, 0.025)):
        simulation = Simulation(scene(text, spacing=depth / rows, c=20.0, alpha=alpha, law=law))
        times = np.arange(1, 401) * 0.02
        record = []
        for time in times:
            simulation.reach(time)
            record.append(simulation.gauges.levels())
        heights = []
        for levels, x in zip(np.array(record).T, places, strict=True):
            end = (
                math.floor((x / group + 4.5 * period) / period) * period
            )  # the front has passed, the beach not answered
            chosen = (times > end - 2 * period + 1e-9) & (times < end + 1e-9)
            wave = (levels[chosen] - levels[chosen].mean()) * np.exp(-1j * omega * times[chosen])
            heights.append(4.0 * float(np.abs(wave.mean())) / theory)
        shares = " / ".join(f"{height:.2f}" for height in heights)
        yield f"piston waves, {rows} rows, alpha {alpha:g}, 0.66 / 1.15 / 2.1 L: {shares}"


CASES: dict[str, Callable[[str], Iterator[str]]] = {f.__name__: f for f in (still_water, dam_break, column, piston)}


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the tables; 1 when a tank did not get to its end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=["dummy_particles", "radial"])
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    options = parser.parse_args(arguments)
    failed = False
    for law in options.laws:
        print(f"\n{law}\n", flush=True)
        for name in options.cases:
            try:
                for line in CASES[name](law):
                    print(line, flush=True)
            except (BlowUpError, SceneError) as error:
                failed = True
                print(f"{name}: {error}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
