"""Case studies run again and held against theory and experiment: `python -m warpsph validate`."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from warpsph.run import DONE, Run
from warpsph.scene import load_scene
from warpsph.validation.bodies import (
    measure_block,
    measure_floating_box,
    measure_floating_box_3d,
    measure_sinking_disc,
)
from warpsph.validation.landslide import measure_landslide
from warpsph.validation.result import Result
from warpsph.validation.still_water import measure_still_water


@dataclass(frozen=True)
class Case:
    """One case study: a scene that ships, and what is measured on its finished run."""

    title: str
    measure: Callable[[Run], list[Result]]


CASES: Mapping[str, Case] = {
    "still_water": Case("a tank at rest between radial walls", measure_still_water),
    "still_water_3d": Case("the same in a box, in 3-D", measure_still_water),
    "landslide": Case("fragmented slide into 0.15 m of water (calibrated here)", measure_landslide),
    "landslide_0175": Case("the same slide into 0.175 m of water (predicted)", measure_landslide),
    "landslide_0200": Case("the same slide into 0.20 m of water (predicted)", measure_landslide),
    "sinking_disc": Case("a disc sinks: momentum of fluid and body", measure_sinking_disc),
    "floating_box": Case("a box floats: Archimedes, and the heave", measure_floating_box),
    "floating_box_3d": Case("the same in 3-D", measure_floating_box_3d),
    "block_maciel": Case("a block slides into 0.20 m of water", measure_block),
}


def run_case(name: str, scenes: Path, out: Path, *, device: str, threads: int | None) -> list[Result]:
    """Run the scene of a case into `out`/NAME, replacing what is there, and measure it."""
    began = time.perf_counter()
    run = Run(load_scene(scenes / f"{name}.yaml"), out / name, device=device, threads=threads, overwrite=True)
    facts = run.execute()
    if facts["outcome"] == DONE:
        results = CASES[name].measure(run)
    else:
        results = [Result("the run comes to its end", "", run.simulation.time, run.scene.run.end_time, passed=False)]
    seconds = time.perf_counter() - began
    return [replace(result, case=name, seconds=round(seconds, 1)) for result in results]


def print_table(results: Sequence[Result]) -> None:
    """Print one line for each result."""
    heading = ("case", "quantity", "unit", "measured", "reference", "error", "thesis", "bar", "", "source")
    rows = [heading, *(result.cells() for result in results)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(heading))]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def as_dicts(results: Sequence[Result]) -> list[dict[str, Any]]:
    """The results as plain values, for JSON."""
    return [asdict(result) for result in results]
