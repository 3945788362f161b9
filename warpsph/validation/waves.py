"""Waves made by paddles: their height over the stroke, their reflection, and solitary waves that keep their height."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpsph.output.analysis import analysis
from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.theory.waves import paddle_ratio, wavenumber
from warpsph.validation.result import Result, against, at_most

DEAN = "Dean & Dalrymple (1991) eq 6.25"
RAYLEIGH = "Rayleigh (1876)"
# kd, period [s], height [m] and end of the flume [m], in water 0.3 m deep: a wavelength of sponge, and waves of 2 % of
# their length, lower in shallow water.
_KD = ((0.3, 3.7169, 0.012, 9.0), (0.6, 1.9356, 0.035, 5.2), (1.0, 1.2591, 0.037, 4.9), (1.5, 0.9430, 0.025, 3.7))
WAVE_MAKER = tuple(
    (
        f"wave_maker.period={period}",
        f"wave_maker.height={height}",
        f"walls[0].path=[[-0.4, 0.6], [-0.4, 0.0], [{end}, 0.0], [{end}, 0.6]]",
        f"fluids[0].fill.between=[0.0, {end}]",
        f"damping_zones[0].end={end}",
        f"run.end_time={2.0 + 7.0 * period:.2f}",
    )
    for _, period, height, end in _KD
)
SOLITARY = tuple((f"wave_maker.height={height}",) for height in (0.04, 0.06))


def measure_wave_maker(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: height over stroke three depths from the piston 5 %, reflection by the sponge 5 %."""
    results = []
    for (kd, *_), run in zip(_KD, runs, strict=True):
        maker, found = run.scene.wave_maker, analysis(run.scene, run.folder)["wave train"]
        k = float(wavenumber(2.0 * math.pi / maker.period, depth=maker.depth, gravity=run.scene.gravity))
        theory = float(paddle_ratio(k, depth=maker.depth))
        ratio = theory * found["gauges"]["near"]["first harmonic / asked for"]
        results.append(against(f"H / S, kd = {kd:g}", "", ratio, theory, 0.05, DEAN))
        results.append(
            at_most(f"reflection by the sponge, kd = {kd:g}", "", found["reflection"]["coefficient"], 0.05, "none")
        )
    return results


def measure_solitary(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: height lost over ten depths 3 %, celerity 1 %."""
    results = []
    for run in runs:
        maker = run.scene.wave_maker
        found = analysis(run.scene, run.folder)["wave train"]["gauges"]
        crests = [gauge["height [m]"] for gauge in found.values()]
        name = f"H / d = {maker.height / maker.depth:.2g}"
        results.append(at_most(f"height lost in ten depths, {name}", "", 1.0 - crests[-1] / crests[0], 0.03, "none"))
        near, far = run.scene.gauges[0], run.scene.gauges[-1]
        records = [tuple(read_record(run.folder / "gauges" / f"{g.name}.csv").values()) for g in (near, far)]
        passed = [_middle(*record) for record in records]
        speed = (far.x - near.x) / (passed[1] - passed[0])
        theory = math.sqrt(run.scene.gravity * (maker.depth + 0.5 * (crests[0] + crests[-1])))
        results.append(against(f"celerity, {name}", "m/s", speed, theory, 0.01, RAYLEIGH))
        results.append(
            Result(f"height ten depths from the piston over that asked for, {name}", "", crests[0] / maker.height, 1.0)
        )
    return results


def _middle(time: np.ndarray, level: np.ndarray) -> float:
    """When a wave passes [s]: the middle of where it stands above three quarters of its crest, which is less rough."""
    above = np.flatnonzero(level - level[0] >= 0.75 * (level.max() - level[0]))
    return 0.5 * float(time[above[0]] + time[above[-1]])
