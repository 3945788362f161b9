"""Case studies run again and held against theory and experiment: `python -m warpsph validate`."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from warpsph.output.run_folder import DONE
from warpsph.run import Run
from warpsph.scene.loading import load_scene
from warpsph.validation import braga
from warpsph.validation.blocks import (
    measure_block_maciel,
    measure_block_mki,
    measure_maciel_series,
    measure_mki_series,
)
from warpsph.validation.bodies import measure_floating_box, measure_sinking_disc
from warpsph.validation.dam_break import DAM_BREAKS as COLUMNS
from warpsph.validation.dam_break import measure_dam_break
from warpsph.validation.landslide import measure_landslide
from warpsph.validation.misses import as_expected
from warpsph.validation.reservoir import measure_reservoir
from warpsph.validation.result import Result
from warpsph.validation.still_water import measure_still_water
from warpsph.validation.submarine import measure_submarine_slide
from warpsph.validation.viscous import (
    COUETTE_TIMES,
    DAM_BREAKS,
    FREE_SURFACE,
    HERSCHEL_BULKLEY,
    PATCH,
    PLANE_TIMES,
    SHEAR,
    measure_arrest,
    measure_bingham_plane,
    measure_couette,
    measure_dam_breaks,
    measure_free_surface,
    measure_herschel_bulkley,
    measure_interpolation,
    measure_periodic_shear,
    measure_plane_poiseuille,
    until,
)
from warpsph.validation.waves import SOLITARY, WAVE_MAKER, measure_solitary, measure_wave_maker
from warpsph.validation.wedge_entry import measure_wedge_entry

# A series leaves out what nobody looks at.
_BARE = ("output.pictures=false", "output.usd=false")


@dataclass(frozen=True)
class Case:
    """One case study: a scene that ships, and the measures of its finished run."""

    title: str
    measure: Callable[[Run], list[Result]]


@dataclass(frozen=True)
class Series:
    """A scene that ships at several settings (overrides of its fields), and the measures of the finished runs.

    Pictures and the point cache are left out. What is drawn of the series goes to its folder, beside the runs.
    """

    title: str
    scene: str
    settings: tuple[tuple[str, ...], ...]
    measure: Callable[[Sequence[Run], Path], list[Result]]


def _releases(speeds: Sequence[float], slope: float, spacing: float) -> tuple[tuple[str, ...], ...]:
    """Settings by which the first body starts down a ramp of `slope` [degrees] with each of `speeds` [m/s].

    A tenth of the depth is the `spacing` [m]: a third of the work of the scene's own.
    """
    along, down = math.cos(math.radians(slope)), -math.sin(math.radians(slope))
    return tuple(
        (f"bodies[0].velocity=[{speed * along:.6f}, {speed * down:.6f}]", f"spacing={spacing}") for speed in speeds
    )


CASES: Mapping[str, Case | Series] = {
    "still_water": Case("a tank at rest between radial walls", measure_still_water),
    "still_water_3d": Case("the same in a box, in 3-D", measure_still_water),
    "landslide": Case("fragmented slide into 0.15 m of water (calibrated here)", measure_landslide),
    "landslide_0175": Case("the same slide into 0.175 m of water (predicted)", measure_landslide),
    "landslide_0200": Case("the same slide into 0.20 m of water (predicted)", measure_landslide),
    "sinking_disc": Case("a disc sinks: momentum of fluid and body", measure_sinking_disc),
    "floating_box": Case("a box floats: Archimedes, and the heave", measure_floating_box),
    "floating_box_3d": Case("the same in 3-D", measure_floating_box),
    "wedge_entry": Case("a wedge enters calm water at a constant speed", measure_wedge_entry),
    "block_maciel": Case("a block slides into 0.20 m of water", measure_block_maciel),
    "block_mki": Case("a block slides down 10 degrees into 0.21 m of water", measure_block_mki),
    "block_maciel_series": Series(
        "the first block at five speeds: amplitude against Froude number",
        "block_maciel",
        _releases((1.0, 1.5, 2.0, 2.5, 3.0), 30.0, 0.02),
        measure_maciel_series,
    ),
    "block_mki_series": Series(
        "the second block at five speeds: reflected amplitude against Froude number",
        "block_mki",
        _releases((1.2, 1.5, 1.8, 2.1, 2.4), 10.0, 0.021),
        measure_mki_series,
    ),
    "dam_break": Series("columns of water collapse", "dam_break", COLUMNS, measure_dam_break),
    "reservoir": Case("a reservoir empties through a slot", measure_reservoir),
    "submarine_slide": Case("a rigid slide runs down a slope under water", measure_submarine_slide),
    "wave_maker": Series("a piston makes regular waves", "wave_maker", WAVE_MAKER, measure_wave_maker),
    "solitary": Series("a piston makes solitary waves", "solitary", SOLITARY, measure_solitary),
    "interpolation": Series("f = x + z on a patch of particles", "interpolation", PATCH, measure_interpolation),
    "periodic_shear": Series("a shear wave decays", "periodic_shear", SHEAR, measure_periodic_shear),
    "poiseuille_free_surface": Series(
        "a layer on a slope, resolutions and wall rules", "poiseuille_free_surface", FREE_SURFACE, measure_free_surface
    ),
    "poiseuille_plane": Series(
        "flow between plates, from rest", "poiseuille_plane", until(PLANE_TIMES), measure_plane_poiseuille
    ),
    "couette": Series("flow below a moving plate, from rest", "couette", until(COUETTE_TIMES), measure_couette),
    "viscous_dam_break": Series("syrups let go", "viscous_dam_break", DAM_BREAKS, measure_dam_breaks),
    "herschel_bulkley": Series(
        "muds on a slope flow steadily", "herschel_bulkley", HERSCHEL_BULKLEY, measure_herschel_bulkley
    ),
    "bingham_plane": Case("a Bingham mud between plates flows steadily", measure_bingham_plane),
    "viscoplastic_dam_break": Case("a mud let go stops", measure_arrest),
    **{
        f"braga_{name}": Series(study.title, f"braga_{name}", study.settings(), braga.measure(name))
        for name, study in braga.STUDIES.items()
    },
    **{
        f"braga_{name}_ours": Series(
            f"{study.title}, by our scheme", f"braga_{name}", (study.ours(),), braga.measure_ours(name)
        )
        for name, study in braga.STUDIES.items()
    },
}


def run_case(name: str, scenes: Path, out: Path, *, device: str, threads: int | None) -> list[Result]:
    """Run the scene of a case into `out`/NAME, or the scenes of a series into `out`/NAME/1 and on, and measure them."""
    began = time.perf_counter()
    case = CASES[name]
    settings: list[tuple[str, ...]] = [()]
    if isinstance(case, Case):
        folders, scene = [out / name], name
    else:
        folders = [out / name / str(i) for i, _ in enumerate(case.settings, 1)]
        scene, settings = case.scene, [(*setting, *_BARE) for setting in case.settings]
    runs = []
    for folder, overrides in zip(folders, settings, strict=True):
        loaded = load_scene(scenes / f"{scene}.yaml", overrides)
        run = Run(loaded, folder, device=device, threads=threads, overwrite=True)
        if run.execute()["outcome"] != DONE:
            ended = Result("the run comes to its end", "", run.simulation.time, loaded.run.end_time, passed=False)
            return [replace(ended, case=name, seconds=round(time.perf_counter() - began, 1))]
        runs.append(run)
    results = case.measure(runs[0]) if isinstance(case, Case) else case.measure(runs, out / name)
    seconds = time.perf_counter() - began
    return [replace(as_expected(name, result), case=name, seconds=round(seconds, 1)) for result in results]


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
