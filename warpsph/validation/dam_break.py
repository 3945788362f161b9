"""Columns of water that collapse: front and height against Martin & Moyce (1952), Vasco (2014) 5.1."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.validation.result import Result, at_most

DATA = Path(__file__).parent / "data"
SOURCE = "Martin & Moyce (1952)"
# Height over base, base [m], and the series of the front.
SETS = (
    (1, 0.05715, "n2eq1", "A"),
    (2, 0.05715, "n2eq2", "MM52_table2"),
    (1, 0.028575, "n2eq1", "A"),
    (2, 0.028575, "n2eq2", "MM52_fig3_digitised_a1.125in"),
)
COLUMNS = 24  # of particles over the base
DAM_BREAKS = tuple(
    (
        f"spacing={base / COLUMNS}",
        f"fluids[0].shape.box.max=[{base}, {n2 * base}]",
        f"walls[0].path=[[0.0, {4 * base}], [0.0, 0.0], [{7 * base}, 0.0], [{7 * base}, {4 * base}]]",
        f"run.end_time={3.7 * math.sqrt(base / 9.81 / n2):.3f}",
    )
    for n2, base, *_ in SETS
)
MOST_SHIFT, FARTHEST = 0.3, 4.0  # of T, since nobody knows when the gate was open; of Z


def measure_dam_break(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: relative rms of Z 5 % with one shift of time, height 0.05, front not beyond Ritter's 1 + 2 T.

    Z = front / a against T = t sqrt(g n2 / a), H = height / (n2 a) against t sqrt(g / a), a the base.
    """
    results = []
    for (n2, base, name, series), run in zip(SETS, runs, strict=True):
        g, what = run.scene.gravity, f"n2 = {n2}, a = {1e3 * base:.3g} mm"
        water = read_record(run.folder / "fluids" / "water.csv")
        T, Z = water["time [s]"] * math.sqrt(g * n2 / base), water["front [m]"] / base
        best, shifted, raw = front_error(T, Z, name, series, FARTHEST)
        results.append(at_most(f"front, rms of Z, {what}, T shifted by {best:+.2f}", "", shifted, 0.05, SOURCE))
        results.append(Result(f"the same without a shift, {what}", "", raw, None, source=SOURCE))
        # A particle stands half a spacing behind the front that it is, and its lattice cell is a spacing wide.
        beyond = float((Z - 1.0 - 2.0 * T).max()) * COLUMNS
        results.append(at_most(f"front beyond 1 + 2 T, over dx, {what}", "", max(beyond, 0.0), 0.5, "Ritter (1892)"))
        heights = _table("martin_moyce_1952_height.csv", str(n2))
        level = read_record(run.folder / "gauges" / "back.csv")
        tau, H = level["time [s]"] * math.sqrt(g / base), level["level [m]"] / (n2 * base)
        heights = heights[heights[:, 0] <= tau[-1]]
        worst = np.abs(np.interp(heights[:, 0], tau, H) - heights[:, 1]).max()
        results.append(at_most(f"height at the back wall, largest error, {what}", "", float(worst), 0.05, SOURCE))
    return results


def front_error(T: np.ndarray, Z: np.ndarray, name: str, series: str, farthest: float) -> tuple[float, float, float]:
    """The shift of T that suits a front best, the relative rms of Z with it, and that without; up to Z = `farthest`."""
    seen = _table(f"martin_moyce_1952_front_{name}.csv", series)
    seen = seen[(seen[:, 1] <= farthest) & (seen[:, 0] + MOST_SHIFT <= T[-1])]

    def rms(shift: float) -> float:
        return float(np.sqrt(np.mean((np.interp(seen[:, 0] + shift, T, Z) / seen[:, 1] - 1.0) ** 2)))

    best = float(min(np.linspace(-MOST_SHIFT, MOST_SHIFT, 121), key=rms))
    return best, rms(best), rms(0.0)


def _table(name: str, series: str) -> np.ndarray:
    """The last two columns of the rows of a series, which the first column names, shape [n, 2]."""
    with (DATA / name).open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    return np.array([[float(cell) for cell in row[1:]] for row in rows[1:] if row[0] == series])
