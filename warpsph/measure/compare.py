"""A computed record held against one that was observed: bias, scatter, skill, lag and the error of the peak."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpsph.scene.instruments import Observed
from warpsph.scene.source import nearest, read_table_text

# What a unit in the heading of an observed column is in units of our records.
UNITS = {
    **{"s": 1.0, "ms": 1e-3, "min": 60.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3},
    **{"Pa": 1.0, "kPa": 1e3, "hPa": 1e2, "mbar": 1e2, "bar": 1e5, "m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
}
# The lag is looked for in steps of this share of the time that both records have.
LAG_STEPS, MOST_LAG = 1000, 0.25


@dataclass(frozen=True)
class Comparison:
    """How a computed record y compares with an observed one o, at the times of the latter.

    Attributes:
        count: Samples that both have.
        bias: Mean of y - o, in the unit of the record.
        rms: Root mean square of y - o.
        skill: 1 - sum (y - o)^2 / sum (|y - mean o| + |o - mean o|)^2: 1 for a perfect likeness, Willmott (1981).
        lag: By how much y is late, where the two are most alike [s].
        peak_error: Greatest y less greatest o, over the rise of o; not a number where o does not rise.
    """

    count: int
    bias: float
    rms: float
    skill: float
    lag: float
    peak_error: float

    def facts(self, unit: str) -> dict[str, float]:
        """As run.json tells them."""
        named = {"samples": self.count, f"bias [{unit}]": self.bias, f"rms [{unit}]": self.rms}
        named |= {"skill": self.skill, "lag [s]": self.lag, "peak error": self.peak_error}
        return {name: value for name, value in named.items() if math.isfinite(value)}


def read_observed(observed: Observed) -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and observed values, in the units of our records, each of shape [n].

    Lines that begin with # are passed over, and rows that lack either number.

    Raises:
        ValueError: with the file, which is no such table.
    """
    path = Path(observed.file)
    lines = [line for line in read_table_text(path).splitlines() if line.strip() and not line.startswith("#")]
    try:
        header, *rows = list(csv.reader(lines)) or [[]]
    except csv.Error as error:
        raise ValueError(f"{path}: not a table: {error}") from None
    if not header:
        raise ValueError(f"{path}: the table is empty")
    headings = [cell.strip() for cell in header]
    places, factors = [], []
    for wanted in observed.columns:
        found = [i for i, cell in enumerate(headings) if wanted.strip() in (cell, cell.partition("[")[0].strip())]
        if not found:
            raise ValueError(f"{path}: no column is named '{wanted}'{nearest(wanted, headings)}")
        unit = headings[found[0]].partition("[")[2].rstrip("] ")
        if unit and unit not in UNITS:
            raise ValueError(f"{path}: {wanted} is in {unit[:20]}, which is not known; it can be {', '.join(UNITS)}")
        places.append(found[0])
        factors.append(UNITS[unit] if unit else 1.0)
    values = []
    for row in rows:
        try:
            pair = [float(row[place]) * factor for place, factor in zip(places, factors, strict=True)]
        except (ValueError, IndexError):
            continue
        if all(map(math.isfinite, pair)):
            values.append(pair)
    if len(values) < 2:
        raise ValueError(f"{path}: fewer than two rows have numbers in {' and '.join(observed.columns)}")
    time, value = np.array(values).T
    if np.any(np.diff(time) <= 0.0):
        raise ValueError(f"{path}: its time does not rise everywhere")
    return time + observed.shift, value + observed.offset


def compared(time: np.ndarray, value: np.ndarray, seen_time: np.ndarray, seen: np.ndarray) -> Comparison | None:
    """A computed record held against an observed one; None where they share less than three samples.

    All arrays are of shape [n] of their own record; not-a-numbers of ours are passed over.
    """
    is_number = np.isfinite(value)
    time, value = time[is_number], value[is_number]
    if len(time) < 2:
        return None
    both = (seen_time >= time[0]) & (seen_time <= time[-1])
    at, o = seen_time[both], seen[both]
    if len(at) < 3:
        return None
    y = np.interp(at, time, value)
    spread = np.sum((np.abs(y - o.mean()) + np.abs(o - o.mean())) ** 2)
    rise = float(o.max() - o[0])
    return Comparison(
        count=len(at),
        bias=float(np.mean(y - o)),
        rms=float(np.sqrt(np.mean((y - o) ** 2))),
        skill=float(1.0 - np.sum((y - o) ** 2) / spread) if spread > 0.0 else math.nan,
        lag=_lag(at, o, time, value),
        peak_error=float((y.max() - o.max()) / rise) if rise > 0.0 else math.nan,
    )


def _lag(at: np.ndarray, o: np.ndarray, time: np.ndarray, value: np.ndarray) -> float:
    """By how much `value` is later than `o` [s], where their covariance, each about its mean, is greatest."""
    most = MOST_LAG * (at[-1] - at[0])
    shifts = np.linspace(-most, most, LAG_STEPS + 1)
    best, found = -math.inf, 0.0
    for shift in shifts[np.argsort(np.abs(shifts), kind="stable")]:
        inside = (at + shift >= time[0]) & (at + shift <= time[-1])
        if inside.sum() < max(3, len(at) // 2):
            continue
        y, x = np.interp(at[inside] + shift, time, value), o[inside]
        spread = float(np.std(y) * np.std(x))
        likeness = float(np.mean((y - y.mean()) * (x - x.mean()))) / spread if spread > 0.0 else -math.inf
        if likeness > best + 1e-12:
            best, found = likeness, float(shift)
    return found
