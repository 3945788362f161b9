"""Runs laid over each other: their gauges in one plot, and how far each is off the first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from warpsph.output.gauge_waves import describe_gauge
from warpsph.output.pages import write_table
from warpsph.output.plots import TIME, line_colors, name_lines, small_plot
from warpsph.output.records import read_records

WAVE = ("still level [m]", "arrival [s]", "crest [m]", "crest time [s]", "trough [m]", "period [s]")
HEADINGS = ("run, gauge", *WAVE, "crest / first's", "off the first, rms [m]", "off the first, most [m]")


class CompareError(ValueError):
    """The runs cannot be compared; the text is one line for the user."""


@dataclass(frozen=True)
class Overlay:
    """Runs laid over each other.

    Attributes:
        rows: The table, its columns as `HEADINGS`.
        figures: What each plot is called, and the plot.
        links: The report of each run, by the first column.
    """

    rows: list[list[str | float | None]]
    figures: list[tuple[str, Figure]]
    links: dict[str, str]


def compare(folders: Sequence[Path]) -> Overlay:
    """Compare the gauges of runs, which are matched by their names, with the gauges of the first run.

    Raises:
        CompareError: a folder is no run, or no gauge is in the first and in another one.
    """
    records = {folder: _gauges(folder) for folder in folders}
    names = _names(folders)
    first = folders[0]
    rows: list[list[str | float | None]] = []
    figures, links = [], {}
    for gauge in records[first]:
        those = [folder for folder in folders if gauge in records[folder]]
        if len(those) < 2:
            continue
        curves = {names[folder]: records[folder][gauge] for folder in those}
        figures += [(f"{gauge}: level above rest", _overlay(curves)), (f"{gauge}: difference", _apart(curves))]
        time, level = curves[names[first]].values()
        crest = describe_gauge(time, level).get("crest [m]")
        for folder in those:
            record = curves[names[folder]]
            wave = describe_gauge(*record.values())
            label = f"{names[folder]}, {gauge}"
            row: list[str | float | None] = [label, *(wave.get(heading) for heading in WAVE)]
            links[label] = str(folder / "report.html")
            if folder == first:
                rows.append([*row, None, None, None])
                continue
            _, apart = _difference(curves[names[first]], record)
            ratio = wave["crest [m]"] / crest if crest and "crest [m]" in wave else None
            rows.append([*row, ratio, float(np.sqrt(np.mean(apart**2))), float(np.abs(apart).max())])
    if not rows:
        raise CompareError(f"{first}: no other run has a gauge of the same name with a record of the same time")
    return Overlay(rows, figures, links)


def write_comparison(folders: Sequence[Path], page: Path) -> Overlay:
    """Compare runs, and write the page. Raises CompareError, and PageError where the page is not ours."""
    found = compare(folders)
    words = [f"{len(folders)} runs; differences are from {folders[0]}, at the instants of its record."]
    write_table(
        page,
        title="Runs laid over each other",
        words=words,
        headings=HEADINGS,
        rows=found.rows,
        links=found.links,
        figures=found.figures,
    )
    return found


def _gauges(folder: Path) -> dict[str, dict[str, np.ndarray]]:
    if not (folder / "scene.yaml").exists():
        raise CompareError(f"{folder}: not a run folder (it has no scene.yaml)")
    found = read_records(folder.glob("gauges/*.csv"), "level [m]")
    found = {name: record for name, record in found.items() if len(record[TIME]) > 1}
    if not found:
        raise CompareError(f"{folder}: has no record of a gauge")
    return found


def _names(folders: Sequence[Path]) -> dict[Path, str]:
    """The name of each folder, with those above it where two would be called the same."""
    short = {folder: folder.resolve().name for folder in folders}
    if len(set(short.values())) == len(folders):
        return short
    return {folder: str(folder) for folder in folders}


def _rise(record: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    time, level = record.values()
    return time, level - level[0]


def _difference(first: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Times of the first that are in the other too [s], and how much higher the other stands then [m]."""
    (time, rise), (other_time, other_rise) = _rise(first), _rise(other)
    inside = (time >= other_time[0]) & (time <= other_time[-1])
    if not inside.any():
        raise CompareError("two records of a gauge have no time in common")
    return time[inside], np.interp(time[inside], other_time, other_rise) - rise[inside]


def _overlay(curves: dict[str, dict[str, np.ndarray]]) -> Figure:
    figure, axes = small_plot()
    for (name, record), color in zip(curves.items(), line_colors(len(curves)), strict=True):
        axes.plot(*_rise(record), color=color, linewidth=1.4, label=name)
    axes.set(xlabel=TIME, ylabel="level − still level [m]")
    axes.margins(x=0.0)
    name_lines(figure, axes)
    return figure


def _apart(curves: dict[str, dict[str, np.ndarray]]) -> Figure:
    figure, axes = small_plot()
    (first_name, first), *others = curves.items()
    for (name, record), color in zip(others, line_colors(len(curves))[1:], strict=True):
        axes.plot(*_difference(first, record), color=color, linewidth=1.4, label=name)
    axes.set(xlabel=TIME, ylabel=f"level less the level of {first_name} [m]")
    axes.margins(x=0.0)
    name_lines(figure, axes)
    return figure
