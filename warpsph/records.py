"""Records: the CSV files of a run, flushed line by line, cut back to the checkpoint on a resume."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np


class Record:
    """One CSV file whose first column is time [s]."""

    def __init__(self, path: Path, columns: Sequence[str], resume_at: float | None = None) -> None:
        """Start the file, or go on with it: rows at or after `resume_at` [s] are dropped, they will come again."""
        rows: list[list[str]] = []
        if resume_at is not None and path.exists():
            with path.open(newline="") as file:
                rows = [row for row in list(csv.reader(file))[1:] if row and float(row[0]) < resume_at - 1e-9]
        self._file = path.open("w", newline="", buffering=1)
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._writer.writerows([["time [s]", *columns], *rows])

    def write(self, time: float, values: Sequence[float]) -> None:
        """Add one row."""
        self._writer.writerow([f"{time:.6f}", *(f"{value:.9g}" for value in values)])

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_record(path: Path) -> dict[str, np.ndarray]:
    """Columns of a record by their heading, each of shape [row_count]."""
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    values = np.array(rows, dtype=float).reshape(len(rows), len(header))
    return dict(zip(header, values.T, strict=True))


def find_crest(time: np.ndarray, level: np.ndarray) -> tuple[float, float]:
    """Amplitude of the highest crest above the first level [m], and when it passes [s], by a parabola through its top.

    `time` [s] and `level` [m] are a gauge's record, shape [sample_count].
    """
    k = int(np.argmax(level))
    if not 0 < k < len(level) - 1:
        return float(level[k] - level[0]), float(time[k])
    a, b, c = level[k - 1 : k + 2]
    bend = a - 2.0 * b + c
    offset = 0.5 * (a - c) / bend if bend else 0.0
    return float(b - 0.25 * (a - c) * offset - level[0]), float(time[k] + offset * (time[k + 1] - time[k]))
