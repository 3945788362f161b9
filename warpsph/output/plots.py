"""Plots of records, and the list of those that the report shows.

A record is a CSV file of a run: its name is the name of the file, its columns are headed "name [unit]". `RECORDS` says
which records there are and which columns are drawn; a new kind is one line there.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib import colormaps, rcParams
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from warpsph.output.records import TIME, find_crest, read_record, read_records

LINE_PALETTE = (
    *("#1f5f99", "#c2512f", "#2e7d5b", "#8a4f9e", "#a67c00", "#4a5560"),
    *("#d0679d", "#3aa6b9", "#7a4a2a", "#8fae3a"),
)
INK = "#2b2f33"
GREY = "#9aa0a6"
LINE_OF_LEGEND = 0.19  # [inch]
# A plot that is as narrow as a phone is read there too. What surrounds its axes is fixed, as shares of the figure:
# finding the least room for labels takes Matplotlib longer than drawing them.
SIZE = (5.4, 3.3)  # [inch]
AROUND = {"left": 0.165, "right": 0.955, "bottom": 0.155, "top": 0.86}

Curves = Mapping[str, Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class Panel:
    """One plot of records.

    Attributes:
        columns: Names of the columns drawn, without their units.
        label: What the axis is called, without the unit; the name of the column when absent.
        against: Name of the column along the axis.
        since_start: Whether to draw the change since the first row.
    """

    columns: tuple[str, ...]
    label: str = ""
    against: str = "time"
    since_start: bool = False


@dataclass(frozen=True)
class Records:
    """Records of one kind, as the report shows them.

    Attributes:
        heading: What they are called on the page.
        files: Where they lie in a run folder, as a pattern of paths.
        words: A sentence below the heading.
        panels: What is drawn; a panel for each unit, with all of its columns, when absent.
    """

    heading: str
    files: str
    words: str = ""
    panels: tuple[Panel, ...] = ()

    def read(self, run_dir: Path) -> dict[str, dict[str, np.ndarray]]:
        """The records of this kind that hold a row, by name."""
        return read_records(run_dir.glob(self.files))

    def plots(
        self, curves: Curves, colors: Mapping[str, str] | None = None, onto: Figure | None = None
    ) -> Iterator[tuple[str, Figure]]:
        """What each plot is called, and the plot, of records by name; `colors` by name where these are given.

        All are drawn `onto` one figure where it is given, which must be printed before the next is asked for.
        """
        for panel in self.panels or _by_unit(curves):
            lines = list(_lines(panel, curves, colors or {}))
            if lines:
                yield _title(panel), _draw(panel, lines, onto)


# What a report plots, in this order.
RECORDS = (
    Records(
        "Wave gauges",
        "gauges/*.csv",
        panels=(Panel(("level",), "level − still level", since_start=True),),
    ),
    Records(
        "Probes",
        "probes/*.csv",
        panels=(Panel(("pressure",)), Panel(("u",)), Panel(("w",))),
    ),
    Records(
        "Forces on walls",
        "forces/*.csv",
        "The pressure on walls, its torque, and how high it attacks.",
        (Panel(("force x",)), Panel(("force z",)), Panel(("torque", "torque y"), "torque"), Panel(("z",), "attack, z")),
    ),
    Records(
        "Run-up",
        "run_up/*.csv",
        "The highest wet point along each wall.",
        (Panel(("z",), "highest wet point, z"), Panel(("length",), "the same, along the wall")),
    ),
    Records(
        "Overtopping",
        "overtopping/*.csv",
        "What has passed each line.",
        (Panel(("volume",)), Panel(("discharge",))),
    ),
    Records(
        "Bodies",
        "bodies/*.csv",
        "Where the centre of each body goes, and the force of the fluid on it.",
        (Panel(("z",), "path: z", against="x"), Panel(("z",)), Panel(("force x",)), Panel(("force z",))),
    ),
    Records(
        "Energy",
        "energy.csv",
        "Change of each part of the energy budget since the release. The total should stay at zero.",
        (
            Panel(
                (
                    *("kinetic", "potential", "internal", "dissipated", "wall work", "damped"),
                    *("bodies kinetic", "bodies potential", "total"),
                ),
                "change of energy",
                since_start=True,
            ),
        ),
    ),
    Records(
        "Fluids",
        "fluids/*.csv",
        "The centre of gravity of each fluid, its front and its fastest particle.",
        (Panel(("x",), "centre, x"), Panel(("z",), "centre, z"), Panel(("front",), "front, x"), Panel(("top speed",))),
    ),
)


def line_colors(count: int) -> list[str]:
    """Different colours for `count` lines."""
    if count <= len(LINE_PALETTE):
        return list(LINE_PALETTE[:count])
    return [to_hex(color) for color in colormaps["turbo"](np.linspace(0.03, 0.97, count))]


def new_plots(count: int, size: tuple[float, float] = (9.0, 4.2)) -> tuple[Figure, Sequence[Axes]]:
    """A figure of plots side by side in the style of all plots of records: two spines, a light grid, quiet ticks."""
    figure = Figure(figsize=size, dpi=150)
    is_small = count == 1 and size == SIZE
    if is_small:
        figure.subplots_adjust(**AROUND)
    else:
        figure.set_layout_engine("constrained", w_pad=0.12, h_pad=0.12)
    plots: list[Axes] = list(np.atleast_1d(figure.subplots(1, count)))
    if is_small:  # labels at the edges of the figure, which need not be looked for
        plots[0].xaxis.set_label_coords(0.5 * (AROUND["left"] + AROUND["right"]), 0.05, figure.transFigure)
        plots[0].yaxis.set_label_coords(0.035, 0.5 * (AROUND["bottom"] + AROUND["top"]), figure.transFigure)
    for axes in plots:
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(GREY)
        axes.grid(color="#e4e7ea", linewidth=0.7)
        axes.set_axisbelow(True)
        style_labels(axes)
    return figure, plots


def small_plot(onto: Figure | None = None) -> tuple[Figure, Axes]:
    """A figure of one plot as small as `SIZE`: a new one, or `onto` emptied, as axes and ticks take long to make."""
    if onto is None:
        figure, (axes,) = new_plots(1, SIZE)
        return figure, axes
    (axes,) = onto.axes
    for artist in (*axes.lines, *axes.texts, *onto.legends):
        artist.remove()
    axes.margins(x=rcParams["axes.xmargin"], y=rcParams["axes.ymargin"])
    axes.relim()
    axes.autoscale()
    onto.set_size_inches(SIZE)
    onto.subplots_adjust(**AROUND)
    return onto, axes


def style_labels(axes: Axes) -> None:
    """Ticks and labels as all pictures have them."""
    axes.tick_params(color=GREY, labelcolor=INK, labelsize=10)
    axes.xaxis.label.set(color=INK, fontsize=11)
    axes.yaxis.label.set(color=INK, fontsize=11)


def name_lines(figure: Figure, axes: Axes) -> None:
    """A legend that lies on no curve: above the plot."""
    handles, names = axes.get_legend_handles_labels()
    if not names:
        return
    is_free = figure.get_layout_engine() is None
    # As wide as the figure, in letters and what stands for a line.
    columns = max(1, min(len(names), int(48 / (5 + max(map(len, names))))))
    rows = math.ceil(len(names) / columns)
    if is_free:  # the legend takes its room from above, and the figure grows with it
        width, height = figure.get_size_inches()
        taller = max(0.0, rows - 2) * LINE_OF_LEGEND
        figure.set_size_inches(width, height + taller)
        edges = {name: AROUND[name] * height / (height + taller) for name in ("bottom", "top")}
        figure.subplots_adjust(**edges)
    figure.legend(
        handles,
        names,
        frameon=False,
        loc="upper center" if is_free else "outside upper center",
        ncols=columns,
        fontsize=9,
        labelcolor=INK,
        handlelength=1.4,
        columnspacing=1.0,
        borderaxespad=0.2,
        labelspacing=0.3,
    )


# More curves than this in one panel cannot be told apart, and their names leave it no room.
MOST_CURVES = 24


def gauge_figure(levels: Curves, observed: Curves | None = None, onto: Figure | None = None) -> tuple[Figure, Axes]:
    """The levels of gauges above rest, each named with the amplitude of its crest.

    Args:
        levels: Records of gauges by name; the first level is the level of the water at rest.
        observed: Measured records by the name of their gauge, with levels above rest.
        onto: A figure that is drawn upon anew, of those that this or `Records.plots` made.
    """
    figure, axes = small_plot(onto)
    levels = dict(list(levels.items())[:MOST_CURVES])
    for (name, record), color in zip(levels.items(), line_colors(len(levels)), strict=True):
        time, level = record[TIME], record["level [m]"]
        amplitude, at = find_crest(time, level)
        label = f"{name}, crest {amplitude:.3g} m" if amplitude > 0.0 else name
        axes.plot(time, level - level[0], color=color, linewidth=1.4, label=label)
        if amplitude > 0.0:
            axes.plot(at, amplitude, "o", color=color, markersize=6, markeredgecolor="white", markeredgewidth=0.8)
        if observed and name in observed:
            time, level = observed[name].values()
            axes.plot(time, level, ".", color=color, markersize=3.5, label=f"{name}, observed")
    axes.axhline(0.0, color=GREY, linewidth=0.8, zorder=0)
    axes.set(xlabel=TIME, ylabel="level − still level [m]")
    axes.margins(x=0.0, y=0.14)
    name_lines(figure, axes)
    return figure, axes


def gauge_picture(csvs: Sequence[Path], out: Path | BinaryIO) -> None:
    """Draw the gauge records `csvs` in one panel, as `gauge_figure` does, into the PNG `out`."""
    records = {path.stem: read_record(path) for path in csvs}
    figure, _ = gauge_figure({name: record for name, record in records.items() if len(record[TIME])})
    figure.savefig(out, format="png")


def split_heading(heading: str) -> tuple[str, str]:
    """Name and unit of a column; the unit is "" where there is none."""
    found = re.fullmatch(r"(.*?)(?: \[(.*)\])?", heading)
    return (found[1], found[2] or "") if found else (heading, "")


def _by_unit(curves: Curves) -> list[Panel]:
    """A panel for each unit in the records, with all of its columns."""
    headings = dict.fromkeys(heading for record in curves.values() for heading in record if heading != TIME)
    named = sorted((split_heading(heading)[::-1] for heading in headings), key=lambda pair: pair[0])
    panels = (tuple(name for _, name in group) for _, group in groupby(named, key=lambda pair: pair[0]))
    return [Panel(names, ", ".join(names) if len(names) < 4 else "") for names in panels]


def _title(panel: Panel) -> str:
    what = panel.label or ", ".join(panel.columns)
    return f"{what} over {panel.against}"


@dataclass(frozen=True)
class _Line:
    label: str
    color: str
    x: np.ndarray
    y: np.ndarray
    headings: tuple[str, str]
    is_total: bool


def _lines(panel: Panel, curves: Curves, colors: Mapping[str, str]) -> Iterator[_Line]:
    found = [
        (name, heading, record)
        for name, record in curves.items()
        for heading in record
        if split_heading(heading)[0] in panel.columns
    ]
    several = len(panel.columns) > 1
    palette = line_colors(len(found))
    for (name, heading, record), color in zip(found, palette, strict=True):
        along = next(other for other in record if split_heading(other)[0] == panel.against)
        column = split_heading(heading)[0]
        label = (column if len(curves) == 1 else f"{name}, {column}") if several else name
        y = record[heading] - record[heading][0] if panel.since_start else record[heading]
        color = color if several else colors.get(name, color)
        yield _Line(label, color, record[along], y, (along, heading), column == "total")


def _draw(panel: Panel, lines: Sequence[_Line], onto: Figure | None) -> Figure:
    figure, axes = small_plot(onto)
    is_named = len(lines) > 1 or lines[0].label not in panel.columns
    for line in lines:
        style = {"color": INK, "linewidth": 2.0, "linestyle": "--"} if line.is_total else {"color": line.color}
        axes.plot(line.x, line.y, **{"linewidth": 1.4} | style, label=line.label)
    name, unit = split_heading(lines[0].headings[1])
    label = panel.label or (name if len(panel.columns) == 1 else "")
    axes.set(xlabel=lines[0].headings[0], ylabel=f"{label} [{unit}]" if unit else label)
    if panel.against == "time":
        axes.margins(x=0.0)
    if is_named:
        name_lines(figure, axes)
    return figure
