"""The landslide: crest amplitude, celerity, energy sum and leaks (Vasco 2014, 7.2.5.3; Souza 2007)."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from warpsph.measure.energy import drift_and_converted
from warpsph.measure.leaks import behind_walls
from warpsph.output.records import find_crest, find_front, read_record
from warpsph.run import Run
from warpsph.scene.scene import Scene
from warpsph.theory.impulse import Slide, far_channel
from warpsph.validation.result import Result, against, at_most

DATA = Path(__file__).parent / "data" / "landslide.csv"
VAW = "Evers et al. (2019), VAW 254"
SOURCE = "Souza (2007) in Vasco (2014) 7.2.5.3"


def measure_landslide(run: Run) -> list[Result]:
    """Bars: the thesis's own errors on the amplitude, 3 % on the celerity, 1 % on the energy sum, no leak."""
    scene, simulation = run.scene, run.simulation
    near, far = scene.gauges[-2:]
    depth = next(fluid.fill.level for fluid in scene.fluids if fluid.fill)
    records = [tuple(read_record(run.folder / "gauges" / f"{gauge.name}.csv").values()) for gauge in (near, far)]
    first, amplitude = (find_crest(*record)[0] for record in records)
    # The crest is flat: its very top wanders within a tenth of a second. The steep front is timed to a sample.
    passed_near, passed_far = (find_front(*record) for record in records)
    celerity = (far.x - near.x) / (passed_far - passed_near)
    expected = math.sqrt(scene.gravity * (depth + 0.5 * (first + amplitude)))

    drift, converted = drift_and_converted(read_record(run.folder / "energy.csv"))
    position = simulation.state.snapshot().position
    return [
        _amplitude(depth, amplitude),
        against("celerity of the wave, at half height", "m/s", celerity, expected, 0.03, "sqrt(g (d + a))"),
        at_most("drift of the energy sum over converted", "", drift / converted, 0.01, "conservation"),
        at_most("particles behind a wall", "", int(behind_walls(simulation.model, position).sum()), 0, "no leak"),
        *by_hand(scene, read_record(run.folder / "fluids" / "slide.csv"), far.x),
    ]


def by_hand(scene: Scene, record: Mapping[str, np.ndarray], gauge: float) -> list[Result]:
    """What the formulae of VAW-Mitteilungen 254 say of a slide, of the `record` of its fluid, at a `gauge` [m].

    The slide is a rectangle that lies on a ramp, which goes down along x to a foot at x = 0; it has the speed of its
    centre where that sinks through the still level. None where it does not.
    """
    fill = next(fluid.fill for fluid in scene.fluids if fluid.fill)
    water = next(scene.materials[fluid.material] for fluid in scene.fluids if fluid.fill)
    slide = next(fluid for fluid in scene.fluids if fluid.name == "slide")
    below = np.flatnonzero(record["z [m]"] < fill.level)
    if not len(below) or below[0] == 0:
        return []
    corners, slope = np.array(slide.shape.polygon), -slide.lattice.angle
    sides = np.linalg.norm(np.diff(corners, axis=0), axis=1)[:2]
    found = Slide(
        speed=float(np.hypot(record["u [m/s]"], record["w [m/s]"])[below[0]]),
        thickness=float(sides.min()),
        volume=float(sides.prod()),
        density=scene.materials[slide.material].density,
        slope=slope,
        width=1.0,
        depth=fill.level,
        water=water.density,
        gravity=scene.gravity,
    )
    wave = far_channel(found, gauge + fill.level / math.tan(math.radians(slope)))
    numbers = {
        "impulse product parameter": ("", found.product),
        "amplitude by hand formula": ("m", wave.amplitude),
        "height by hand formula": ("m", wave.height),
        "period by hand formula": ("s", wave.period),
    }
    return [Result(name, unit, value, None, source=VAW) for name, (unit, value) in numbers.items()]


def _amplitude(depth: float, measured: float) -> Result:
    with DATA.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    row = next(row for row in rows if math.isclose(float(row["depth [m]"]), depth))
    quantity = f"crest amplitude, d = {depth:g} m"
    if row["amplitude [m]"]:
        thesis, bar = float(row["thesis error"]), float(row["bar"])
        return against(quantity, "m", measured, float(row["amplitude [m]"]), bar, SOURCE, thesis)
    low, high = float(row["lowest [m]"]), float(row["highest [m]"])
    source = f"between {low:g} and {high:g} m: {SOURCE}"
    return Result(quantity, "m", measured, None, passed=low <= measured <= high, source=source)
