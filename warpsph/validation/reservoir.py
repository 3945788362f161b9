"""A reservoir that empties through a slot: Torricelli's law with the coefficient of discharge that is measured."""

from __future__ import annotations

import math

import numpy as np

from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.validation.result import Result, against, at_most

KIRCHHOFF = math.pi / (math.pi + 2.0)  # contraction of a jet from a slot, without friction: 0.611, Kirchhoff (1869)
BEGIN = 0.2  # the jet has formed by then [s]


def measure_reservoir(run: Run) -> list[Result]:
    """Bars: coefficient of discharge 0.60 +- 0.02, level 2 % of the first one off Torricelli's with it, mass exact.

    Of a slot A_o in a tank of width A_r, d sqrt(h) / dt = - C_d A_o / A_r sqrt(g / 2): C_d by the mean slope over
    all of the record, so that it is one number for all levels.
    """
    scene = run.scene
    gate, body = scene.overtopping[0], scene.fluids[0].shape.box
    slot, width, first = abs(gate.end[0] - gate.start[0]), body.max[0] - body.min[0], body.max[1] - body.min[1]
    time, level = read_record(run.folder / "gauges" / "level.csv").values()
    # What splashes out of the basin flies past the gauge, higher than the tank was ever filled.
    kept = (time >= BEGIN) & (level < first)
    t, root = time[kept], np.sqrt(level[kept])
    slope, _ = np.polyfit(t, root, 1)
    coefficient = -slope * width / slot / math.sqrt(0.5 * scene.gravity)
    law = (root[0] + slope * (t - t[0])) ** 2
    worst = float(np.abs(level[kept] - law).max() / first)
    passed = read_record(run.folder / "overtopping" / "slot.csv")["volume [m3/m]"]
    lost = float(np.abs(passed - (first - level) * width)[kept].max() / (first * width))
    share = run.simulation.model.parameters.mass.numpy()[0] * len(read_record(run.folder / "left.csv")["fluid"])
    mass = run.simulation.energy.measure()[1][0].mass + float(share)
    return [
        at_most("coefficient of discharge less 0.60", "", abs(coefficient - 0.60), 0.02, "potential flow"),
        Result("coefficient of discharge", "", coefficient, KIRCHHOFF, source="Kirchhoff (1869)"),
        at_most("level off Torricelli's with it, over the first level", "", worst, 0.02, "Torricelli"),
        at_most("what has passed the slot less what is missing, over all", "", lost, 0.02, "continuity"),
        against("mass, with what splashed over the basin", "", mass, 1000.0 * first * width, 1e-6, "as drawn"),
    ]
