"""Records: the CSV files of a run, flushed line by line, cut back to the checkpoint on a resume."""

import csv
import io
import logging
import math
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from warpsph.output.claim import beside

log = logging.getLogger("warpsph")

TIME = "time [s]"  # the first column of each record
TIME_ROUNDING = 1e-6  # Times are written with six digits behind the point. [s]


class RecordError(ValueError):
    """A file is no record; the text is one line for the user."""


class Record:
    """One CSV file whose first column is time [s]."""

    def __init__(
        self,
        path: Path,
        columns: Sequence[str],
        resume_at: float | None = None,
        origin: Sequence[float] | None = None,
    ) -> None:
        """Start the file, or go on with it: rows after `resume_at` [s] are dropped, they will come again.

        `origin` is added to each column, in its unit: the origin of the scene where a column holds places, else 0.
        """
        self._origin = origin or [0.0] * len(columns)
        rows: list[list[str]] = []
        if resume_at is not None and path.exists():
            rows = [row for row in _whole_rows(path) if float(row[0]) < resume_at + TIME_ROUNDING]
        # Beside its place first: a disk that fills up here takes no row that had been written.
        unfinished = beside(path)
        with unfinished.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([[TIME, *columns], *rows])
        os.replace(unfinished, path)
        self._path, self._file = path, path.open("a", newline="", buffering=1)
        self._writer = csv.writer(self._file, lineterminator="\n")

    def write(self, time: float, values: Sequence[float]) -> None:
        """Add one row."""
        cells = (
            f"{value + more:.7f}" if more else f"{value:.9g}" for value, more in zip(values, self._origin, strict=True)
        )
        self._writer.writerow([f"{time:.6f}", *cells])

    def confirm(self) -> None:
        """Raise FileNotFoundError if the file was taken away: rows would go nowhere then, without a word."""
        self._path.stat()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def last_time(path: Path) -> float:
    """The last time of a record [s]; minus infinity where there is no row."""
    rows = _whole_rows(path, tell=False) if path.exists() else []
    return float(rows[-1][0]) if rows else -math.inf


def _whole_rows(path: Path, tell: bool = True) -> list[list[str]]:
    """The rows of a record below its heading; one that a kill or a full disk has cut is dropped, and told."""
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        text = file.read()
    heading, *rows = list(csv.reader(io.StringIO(text))) or [[]]
    kept = []
    for i, row in enumerate(rows):
        is_cut = i == len(rows) - 1 and not text.endswith("\n")
        if not is_cut and len(row) == len(heading) and all(map(_is_number, row)):
            kept.append(row)
        elif row and tell:
            log.warning("%s: row %d is cut or damaged, and is dropped", path, i + 2)
    return kept


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_record(path: Path) -> dict[str, np.ndarray]:
    """Columns of a record by their heading, each of shape [row_count]; rows that are cut or damaged are left out.

    Raises RecordError, of one line, where the file is no record.
    """
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    if header[:1] != [TIME]:
        raise RecordError(f"{path}: is no record of ours (its first column is not '{TIME}')")
    try:
        values = np.array(rows, dtype=float).reshape(len(rows), len(header))
    except ValueError:
        rows = _whole_rows(path)
        values = np.array(rows, dtype=float).reshape(len(rows), len(header))
    return dict(zip(header, values.T, strict=True))


def read_records(paths: Iterable[Path], *columns: str) -> dict[str, dict[str, np.ndarray]]:
    """The records among `paths` that hold a row and all of `columns`, by name; the log tells of the others."""
    found = {}
    for path in sorted(paths):
        try:
            record = read_record(path)
        except RecordError as error:
            log.warning("%s; it is left out", error)
            continue
        if missing := [column for column in columns if column not in record]:
            log.warning("%s: has no column '%s'; it is left out", path, missing[0])
        elif len(record[TIME]):
            found[path.stem] = record
    return found


def find_front(time: np.ndarray, level: np.ndarray) -> float:
    """When the level first stands half as high above its first value as at its highest [s].

    `time` [s] and `level` [m] are a gauge's record, shape [sample_count].
    """
    half = 0.5 * (level[0] + level.max())
    k = int(np.argmax(level >= half))
    if k == 0:
        return float(time[0])
    return float(np.interp(half, level[k - 1 : k + 1], time[k - 1 : k + 1]))


def find_crest(time: np.ndarray, level: np.ndarray) -> tuple[float, float]:
    """Amplitude of the highest crest above the first level [m], and when it passes [s].

    `time` [s] and `level` [m] are a gauge's record, shape [sample_count]. The crest is the top of the parabola that
    fits the samples around the highest best, as far as the level stays above 90 % of its rise: single particles that
    ride on the surface make the record rough by a fraction of a spacing, and its highest sample one of the roughest.
    """
    top = int(np.argmax(level))
    low = np.flatnonzero(level < level[0] + 0.9 * (level[top] - level[0]))
    first = low[low < top].max(initial=-1) + 1
    last = low[low > top].min(initial=len(level)) - 1
    if last - first < 4 or not 0 < top < len(level) - 1:
        return float(level[top] - level[0]), float(time[top])
    # Counted from the highest sample, which keeps the fit well conditioned.
    a, b, c = np.polyfit(time[first : last + 1] - time[top], level[first : last + 1], 2)
    if a >= 0.0:
        return float(level[top] - level[0]), float(time[top])
    at = float(time[top] - b / (2.0 * a))
    if not time[first] <= at <= time[last]:  # a level that rises still at the end has not had its crest
        return float(level[top] - level[0]), float(time[top])
    return float(c - b * b / (4.0 * a) - level[0]), at


def is_rising(time: np.ndarray, level: np.ndarray) -> bool:
    """Whether the record ends before its highest crest does: in the last tenth of a rise, and not yet falling.

    `time` [s] and `level` [m] are a gauge's record, shape [sample_count]; a level that never rises is not rising.
    """
    rise = float(level.max() - level[0])
    if not rise > 0.0 or level[-1] < level[0] + 0.9 * rise:
        return False
    # From where it came within the last tenth: rough by a fraction of a spacing, so that a slope is fitted.
    low = np.flatnonzero(level < level[0] + 0.9 * rise)
    first = min(int(low.max(initial=-1)) + 1, len(level) - 2)
    slope = np.polyfit(time[first:] - time[first], level[first:], 1)[0]
    return bool(slope > 0.0)
