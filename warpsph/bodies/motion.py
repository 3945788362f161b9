"""Prescribed motions of bodies: constant, ramp, sine, and a table from a CSV file."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from warpsph.shapes.points import Array

COLUMNS = ("time", "x", "y", "z", "angle")


@dataclass(frozen=True)
class Table:
    """Rows of a prescribed motion.

    Attributes:
        time: After the beginning [s], rising, shape [n].
        shift: From the starting place [m], shape [n, 3].
        angle: Through which the body has turned [rad], shape [n].
    """

    time: Array
    shift: Array
    angle: Array

    def rates(self) -> tuple[Array, Array]:
        """Rates of shift [m/s] and angle [rad/s] at the rows: of the parabola through each and its neighbours."""
        order = 2 if len(self.time) > 2 else 1
        return (
            np.gradient(self.shift, self.time, axis=0, edge_order=order),
            np.gradient(self.angle, self.time, edge_order=order),
        )


@dataclass(frozen=True)
class Motion:
    """A prescribed motion: a shift `direction` s(t) and a turn by the angle `turn` s(t) about an axis.

    constant  s = t [s]; `direction` is a velocity [m/s] and `turn` a rate [rad/s]
    ramp      s = t^2 / (2 T) up to T = `period`, then t - T / 2: they are reached evenly in that time
    sine      s = sin(2 pi t / T + phase) - sin(phase); `direction` [m] and `turn` [rad] are amplitudes
    table     shift and angle are cubic between the rows of `table`, which is at rest outside of them
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
    table: Table | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"no motion named '{self.kind}'; it can be {', '.join(KINDS)}")
        if not self.period > 0.0:
            raise ValueError(f"a period of {self.period:g} s is not above 0")
        if np.linalg.norm(self.axis) == 0.0:
            raise ValueError("an axis needs a direction")
        if (self.kind == "table") != (self.table is not None):
            raise ValueError("a motion has rows when it is a table, and only then")


# Numbers as in kernels/bodies.py, where FREE is 0.
KINDS: Mapping[str, int] = {"fixed": 1, "constant": 2, "ramp": 3, "sine": 4, "table": 5}


def read_table(path: Path | str) -> Table:
    """A motion from a CSV file with a header of `time [s]` and any of `x [m]`, `y [m]`, `z [m]`, `angle [rad]`.

    Units in the header may be left out; angles may be in degrees, `angle [deg]`. Shifts and angles count from the
    starting place of the body, time from the beginning of the motion.

    Raises ValueError, with the file and its line, for what is no such table, and for time that goes back.
    """
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from None
    if not lines:
        raise ValueError(f"{path}: the table is empty")
    (top, header), rows = lines[0], lines[1:]
    names, factors = [], []
    for cell in header:
        name, _, unit = cell.strip().partition("[")
        name, unit = name.strip().lower(), unit.rstrip("] ")
        if name not in COLUMNS:
            raise ValueError(f"{path}:{top}: no column is named '{name}'; it can be {', '.join(COLUMNS)}")
        if name in names:
            raise ValueError(f"{path}:{top}: there are two columns named '{name}'")
        wanted = {"time": "s", "angle": "rad"}.get(name, "m")
        if unit not in ("", wanted) and (name, unit) != ("angle", "deg"):
            raise ValueError(f"{path}:{top}: {name} must be in {wanted}, not in {unit}")
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
            try:
                values[i, place] = factor * float(cell)
            except ValueError:
                raise ValueError(f"{path}:{line}: {name} is not a number: '{cell.strip()}'") from None
        if not np.isfinite(values[i]).all():
            raise ValueError(f"{path}:{line}: not a finite number")
        if i > 0 and values[i, 0] <= values[i - 1, 0]:
            word = "stands still" if values[i, 0] == values[i - 1, 0] else "goes back"
            raise ValueError(f"{path}:{line}: time {word}, from {values[i - 1, 0]:g} s to {values[i, 0]:g} s")
    return Table(values[:, 0], values[:, 1:4], values[:, 4])
