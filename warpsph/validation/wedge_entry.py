"""A wedge that enters calm water at a constant speed: its early force, and its peak (Wagner 1932, Korobkin 2004)."""

import math

import numpy as np

from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.theory.analytic import logvinovich_force, wagner_force, wagner_half_width
from warpsph.validation.result import Result, against, at_most

KOROBKIN = "Korobkin (2004)"


def measure_wedge_entry(run: Run) -> list[Result]:
    """Bars: the peak of the force 10 %, its rate of growth before that 10 %, no particle in the wedge.

    Force grows evenly in time until the root of the spray, c = `wagner_half_width`, is at the chine; that is the peak
    of the theory. The record is smoothed over a twentieth of that time.
    """
    scene, body = run.scene, run.simulation.bodies.set.bodies[0]
    corners = body.outline.polygon()
    apex = corners[np.argmin(corners[:, 1])]
    half = float(np.abs(corners[:, 0] - apex[0]).max())
    chine = corners[np.abs(corners[:, 0] - apex[0]) > half * (1.0 - 1e-9)][:, 1].min()
    fill = next(fluid for fluid in scene.fluids if fluid.fill)
    wedge = {"speed": -float(scene.bodies[0].motion.shift[-1]), "deadrise": math.atan2(chine - apex[1], half)}
    rest = scene.materials[fill.material].density
    full = half / float(wagner_half_width(1.0, **wedge))  # when the root is at the chine

    record = read_record(run.folder / "bodies" / f"{body.name}.csv")
    time = record["time [s]"] - (float(apex[1]) - fill.fill.level) / wedge["speed"]
    width = max(1, round(0.05 * full * scene.output.samples_per_second))
    force = np.convolve(record["force z [N/m]"], np.ones(width) / width, mode="same")
    peak, when = float(force.max()), float(time[force.argmax()]) / full
    early = (time > 0.25 * full) & (time < 0.85 * full)
    growth = float(np.polyfit(time[early], force[early], 1)[0])
    theory = float(logvinovich_force(full, **wedge, density=rest))
    position = run.simulation.state.snapshot().position
    return [
        against("peak force", "N/m", peak, theory, 0.10, f"{KOROBKIN}, at the chine"),
        against("growth of the force", "N/m/s", growth, theory / full, 0.10, KOROBKIN),
        Result("time of the peak over that of the theory", "", when, 1.0, source=KOROBKIN),
        Result(
            "growth of the force over that of small angles",
            "",
            growth * full / float(wagner_force(full, **wedge, density=rest)),
            None,
            source=f"Wagner (1932); {theory / float(wagner_force(full, **wedge, density=rest)):.3f} by {KOROBKIN}",
        ),
        at_most("particles in the wedge", "", int(run.simulation.bodies.holds(position).sum()), 0, "no leak"),
    ]
