"""Compares the laws of reactive walls on water at rest: `python tools/bench/wall_laws.py`, some minutes on two cores.

Runs scenes/still_water.yaml with each law, with any `--set path=value` on top, and prints the table of
kernels/README.md, a row as soon as a law is done. Its columns:

    speed      largest in the last second, over sqrt(g H)
    inside     noise of the pressure out of reach of walls and surface, as bench.py measures it, over rho g H
    at walls   root mean square of p - rho g (H - z) within 3 dx of a wall and 3 dx below the surface, over rho g H
    first row  mean height of the lowest row above the floor as drawn; half a spacing is meant
    level      gauged, above the level that was filled
    behind     particles on the far side of a wall
"""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np
from noise import neighbours, pressure_noise

from warpsph.measure.leaks import behind_walls
from warpsph.scene.boundaries import WallModel
from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError
from warpsph.simulation import BlowUpError, Simulation

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "still_water.yaml"
LAWS = get_args(WallModel.model_fields["force"].annotation)
# What walls that push were made for: a support of 1.5 dx, no correction of tension, and seconds to settle in.
SETTLED = ("smoothing={kernel: wendland_c2, ratio: 1.5}", "tensile_correction=false")
SETTLED += ("warm_up.duration=8", "warm_up.damping=5", "warm_up.settling=4")
HEADER = """\
| law | `set_back` | speed | inside | at walls | first row | level | behind |
|---|---|---|---|---|---|---|---|"""


def row(scene: Scene) -> str:
    """One row of the table: `scene` run to its end."""
    dx, depth, material = scene.spacing, scene.fluids[0].fill.level, scene.materials[scene.fluids[0].material]
    simulation = Simulation(scene)
    end, fastest = scene.run.end_time, 0.0
    last = end - min(1.0, 0.5 * end)
    for time in np.linspace(last, end, 51):
        simulation.reach(time)
        fastest = max(fastest, float(np.linalg.norm(simulation.state.velocity.numpy(), axis=1).max()))
    snapshot, walls = simulation.state.snapshot(), simulation.model.wall_position.numpy()
    x, p, weight = snapshot.position, snapshot.pressure, material.density * scene.gravity
    inside = pressure_noise(x, p, walls, dx, weight * depth)
    beside = (neighbours(x, walls, 3.0 * dx) > 0) & (x[:, 2] < depth - 3.0 * dx)
    at_walls = np.sqrt(np.mean((p - weight * (depth - x[:, 2]))[beside] ** 2)) / (weight * depth)
    ends = x[:, 0].min() + 4.0 * dx, x[:, 0].max() - 4.0 * dx
    first = x[(x[:, 2] < x[:, 2].min() + 0.6 * dx) & (x[:, 0] > ends[0]) & (x[:, 0] < ends[1]), 2]
    level = simulation.gauges.levels()[0] - depth
    behind = int(behind_walls(simulation.model, x).sum())
    return (
        f"| `{scene.wall_model.force}` | {scene.wall_model.set_back:g} "
        f"| {fastest / math.sqrt(scene.gravity * depth):.2g} | {inside:.2%} | {at_walls:.2%} "
        f"| {first.mean() / dx:.2f} dx | {level / dx:+.2f} dx | {behind} |"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the table; 1 when a law did not get to the end."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", action="append", default=[], metavar="PATH=VALUE", help="change a field of the scene")
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=LAWS, help="which laws, all by default")
    options = parser.parse_args(arguments)
    failed = False
    print(HEADER)
    for law in options.laws:
        try:
            settings = [f"wall_model.force={law}", *SETTLED, *options.set]
            print(row(load_scene(SCENE, settings)), flush=True)
        except (BlowUpError, SceneError) as error:
            failed = True
            print(f"{law}: {error}", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
