"""Still water: hydrostatic pressure, the balance of forces, and how still it stays (Vasco 2014, 7.2.5, fig 36)."""

import math

import numpy as np

from warpsph.measure.leaks import behind_walls
from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.validation.result import Result, against, at_most

SOURCE = "Vasco (2014) fig 36"


def measure_still_water(run: Run) -> list[Result]:
    """Bars: pressure at the bottom 1 %, its gradient against g 2 %, level dx / 10; speed 1e-2 sqrt(g H) from the first
    step, and 1e-3 sqrt(g H) after 2 s."""
    scene, simulation = run.scene, run.simulation
    depth, g, h = scene.fluids[0].fill.level, scene.gravity, scene.smoothing_length
    state, order = simulation.state, np.argsort(simulation.state.id.numpy())
    snapshot = state.snapshot()
    z = snapshot.position[:, 2]
    # Where no kernel reaches a wall or the surface.
    away = (z > 2 * h) & (z < depth - 2 * h)
    for axis in (0, 1)[: scene.dimensions - 1]:
        low, high = (end(simulation.model.wall_position.numpy()[:, axis]) for end in (np.min, np.max))
        across = snapshot.position[:, axis]
        away &= (across > low + 4 * h) & (across < high - 4 * h)
    slope, bottom = np.polyfit(z[away], snapshot.pressure[away], 1)
    by_pressure = state.pressure_acceleration.numpy()[order][away, 2]
    rest = scene.materials[scene.fluids[0].material].density
    level = read_record(run.folder / "gauges" / f"{scene.gauges[0].name}.csv")["level [m]"]
    water = read_record(run.folder / "fluids" / f"{scene.fluids[0].name}.csv")
    speed = water["top speed [m/s]"] / math.sqrt(g * depth)
    behind = int(behind_walls(simulation.model, snapshot.position).sum())
    return [
        against("pressure at the bottom", "Pa", bottom, rest * g * depth, 0.01, SOURCE),
        against("pressure gradient", "Pa/m", -slope, rest * g, 0.01, SOURCE),
        against("acceleration by pressure, mean", "m/s2", by_pressure.mean(), g, 0.02, SOURCE),
        at_most("its largest error, over g", "", float(np.abs(by_pressure - g).max() / g), 0.02, SOURCE),
        at_most("largest speed ever over sqrt(g H)", "", float(speed.max()), 1e-2, "at rest"),
        at_most(
            "largest speed after 2 s over sqrt(g H)",
            "",
            float(speed[water["time [s]"] > 2.0].max(initial=0.0)),
            1e-3,
            "at rest",
        ),
        at_most(
            "drift of the level over dx", "", float(np.abs(level - level[0]).max() / scene.spacing), 0.1, "at rest"
        ),
        at_most("particles behind a wall", "", behind, 0, "no leak"),
    ]
