"""Prescribed motions of bodies: constant, ramp, sine, and a table from a CSV file."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from warpsph.scene.source import read_table_text
from warpsph.shapes.points import Array

COLUMNS = ("time", "x", "y", "z", "angle")
# No record of a motion is longer, and no number of one is larger [m, s].
FARTHEST = 1e8


@dataclass(frozen=True)
class MotionTable:
    """Rows of a prescribed motion.

    Attributes:
        time: After the beginning [s], rising, shape [n].
        shift: From the starting place [m], shape [n, 3].
        angle: Through which the body has turned [rad], shape [n].
        line: Of the file, for words about a row, shape [n]; empty where there is no file.
        first: What the first row of the file said, from which shift and angle are counted: x, y, z [m], angle [rad].
    """

    time: Array
    shift: Array
    angle: Array
    line: tuple[int, ...] = ()
    first: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def rates(self) -> tuple[Array, Array]:
        """Rates of shift [m/s] and angle [rad/s] at the rows, with which the cubics between never leave their rows."""
        return _monotone_rates(self.time, self.shift), _monotone_rates(self.time, self.angle)

    def steps(self) -> tuple[Array, Array]:
        """Distance [m] and turn [rad] from each row to the next over their time [m/s, rad/s], each of shape [n - 1]."""
        span = np.diff(self.time)
        return np.linalg.norm(np.diff(self.shift, axis=0), axis=1) / span, np.abs(np.diff(self.angle)) / span


def _monotone_rates(time: Array, value: Array) -> Array:
    """Rates at `time` [n] of the monotone cubics through `value` [n, ...], as Fritsch & Butland (1984) choose them.

    Between two rows such a cubic stays between their values: the rate at a row is the weighted harmonic mean of the
    slopes on both sides, and 0 where these differ in sign. At an end it is the slope of the parabola through three
    rows, not against the first slope and not more than three times that.
    """
    step = np.diff(time).reshape(-1, *[1] * (value.ndim - 1))
    slope = np.diff(value, axis=0) / step
    if len(slope) == 1:
        return np.concatenate([slope, slope])
    before, after = 2.0 * step[1:] + step[:-1], step[1:] + 2.0 * step[:-1]
    low, high = slope[:-1], slope[1:]
    goes_on = low * high > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(goes_on, (before + after) / (before / low + after / high), 0.0)

    def end(h: Array, near: Array, next_h: Array, far: Array) -> Array:
        rate = ((2.0 * h + next_h) * near - h * far) / (h + next_h)
        rate = np.where(rate * near <= 0.0, 0.0, rate)
        return np.where((near * far <= 0.0) & (np.abs(rate) > 3.0 * np.abs(near)), 3.0 * near, rate)

    first = end(step[0], slope[0], step[1], slope[1])
    last = end(step[-1], slope[-1], step[-2], slope[-2])
    return np.concatenate([first[None], inner, last[None]])


@dataclass(frozen=True)
class Motion:
    """A prescribed motion: a shift `direction` s(t) and a turn by the angle `turn` s(t) about an axis.

    constant  s = t [s]; `direction` is a velocity [m/s] and `turn` a rate [rad/s]
    ramp      s = t^2 / (2 T) up to T = `period`, then t - T / 2: they are reached evenly in that time
    sine      s = sin(2 pi t / T + phase) - sin(phase); `direction` [m] and `turn` [rad] are amplitudes
    table     shift and angle are monotone cubics between the rows of `table`, which is at rest outside of them
    fixed     s = 0

    t counts from `begin` [s]. The turn is about an axis through `pivot` [m], the centre of the body by default, which
    shifts with the body; it is positive from z to x about y.
    """

    kind: str
    direction: ArrayLike = (0.0, 0.0, 0.0)
    turn: float = 0.0
    axis: ArrayLike = (0.0, 1.0, 0.0)
    pivot: ArrayLike | None = None
    begin: float = 0.0
    period: float = 1.0
    phase: float = 0.0
    table: MotionTable | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"no motion named '{self.kind}'; it can be {', '.join(KINDS)}")
        if not self.period > 0.0:
            raise ValueError(f"a period of {self.period:g} s is not above 0")
        if np.linalg.norm(self.axis) == 0.0:
            raise ValueError("an axis needs a direction")
        if (self.kind == "table") != (self.table is not None):
            raise ValueError("a motion has rows when it is a table, and only then")

    def top_speed(self, reach: float) -> tuple[float, int]:
        """The greatest speed of a point `reach` [m] from the pivot [m/s], and before which row it has that, or 0."""
        shift, turn = float(np.linalg.norm(self.direction)), abs(self.turn)
        if self.table is not None:
            along, about = self.table.steps()
            speeds = along + reach * about
            row = int(speeds.argmax())
            return float(speeds[row]), row + 1
        times = 2.0 * math.pi / self.period if self.kind == "sine" else 1.0
        return 0.0 if self.kind == "fixed" else times * (shift + reach * turn), 0


# Numbers as in kernels/bodies.py, where FREE is 0.
KINDS: Mapping[str, int] = {"fixed": 1, "constant": 2, "ramp": 3, "sine": 4, "table": 5}


def read_table(path: Path | str) -> MotionTable:
    """A motion from a CSV file with a header of `time [s]` and any of `x [m]`, `y [m]`, `z [m]`, `angle [rad]`.

    Units in the header may be left out; angles may be in degrees, `angle [deg]`. Cells may be parted by ',', by ';' or
    by tabs, and numbers have a decimal comma where ',' parts no cells. Time counts from the beginning of the motion;
    shifts and angles from the first row, where the body is as it is drawn.

    Raises ValueError, with the file and its line, for a file that is no such table, and for time that goes back.
    """
    text = read_table_text(path)
    top_row = next((line for line in text.splitlines() if line.strip()), "")
    parted_by = max(",;\t", key=top_row.count)
    try:
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=parted_by)
        lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise ValueError(f"{path}: not a table: {error}") from None
    if not lines:
        raise ValueError(f"{path}: the table is empty")
    (top, header), rows = lines[0], lines[1:]
    names, factors = [], []
    for cell in header:
        name, _, unit = cell.strip().partition("[")
        name, unit = name.strip().lower(), unit.rstrip("] ")
        if name not in COLUMNS:
            raise ValueError(f"{path}:{top}: no column is named '{name[:40]}'; it can be {', '.join(COLUMNS)}")
        if name in names:
            raise ValueError(f"{path}:{top}: there are two columns named '{name}'")
        wanted = {"time": "s", "angle": "rad"}.get(name, "m")
        if unit not in ("", wanted) and (name, unit) != ("angle", "deg"):
            raise ValueError(f"{path}:{top}: {name} must be in {wanted}, not in {unit[:40]}")
        names.append(name)
        factors.append(math.radians(1.0) if unit == "deg" else 1.0)
    if "time" not in names:
        raise ValueError(f"{path}:{top}: there is no column named 'time'")
    if len(rows) < 2:
        raise ValueError(f"{path}: a motion needs two rows at least")

    values = np.zeros((len(rows), len(COLUMNS)))
    places = [COLUMNS.index(name) for name in names]
    for i, (line, row) in enumerate(rows):
        if len(row) != len(names):
            raise ValueError(f"{path}:{line}: {len(row)} cells in a table of {len(names)} columns")
        for place, factor, name, cell in zip(places, factors, names, row, strict=True):
            word = cell if parted_by == "," or "." in cell else cell.replace(",", ".")
            try:
                values[i, place] = factor * float(word)
            except ValueError:
                raise ValueError(f"{path}:{line}: {name} is not a number: '{cell.strip()[:40]}'") from None
        if not (np.abs(values[i]) < FARTHEST).all():
            raise ValueError(f"{path}:{line}: a number must be less than {FARTHEST:g}")
        if i > 0 and values[i, 0] <= values[i - 1, 0]:
            word = "stands still" if values[i, 0] == values[i - 1, 0] else "goes back"
            raise ValueError(f"{path}:{line}: time {word}, from {values[i - 1, 0]:g} s to {values[i, 0]:g} s")
    first = values[0, 1:].copy()
    values[:, 1:] -= first
    return MotionTable(values[:, 0], values[:, 1:4], values[:, 4], tuple(line for line, _ in rows), tuple(first))
