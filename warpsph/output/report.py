"""The report of a run: one HTML page that holds its film, pictures, plots and numbers, and needs nothing else.

The page is report.html.jinja beside this file; what fills it comes from the files of the run folder alone. Which
records are plotted stands in `plots.RECORDS`.
"""

from __future__ import annotations

import json
import math
import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.output.analysis import instrument_plots
from warpsph.output.claim import write_whole
from warpsph.output.colors import fluid_colors
from warpsph.output.gauge_waves import describe_gauge, off_observed, read_observed
from warpsph.output.pages import embedded, plot, render
from warpsph.output.plots import RECORDS, TIME, Curves, gauge_figure, small_plot
from warpsph.scene.fields import Part
from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError

PICTURES = 6  # frames shown, from the first to the last
MOST_EMBEDDED = 24e6  # A film of more bytes stays a file beside the page, which would load too slowly.


class ReportError(ValueError):
    """There is no finished run to report on; the text is one line for the user."""


@dataclass(frozen=True)
class Group:
    """A small table: what it is called, and its rows of name and value."""

    name: str
    rows: list[tuple[str, Any]]
    color: str = ""


@dataclass(frozen=True)
class Chapter:
    """The plots of one kind of records."""

    heading: str
    words: str
    plots: list[tuple[str, str]]
    links: list[tuple[str, str]]


@dataclass(frozen=True)
class Film:
    """The animation."""

    source: str
    caption: str
    is_video: bool


def write_report(run_dir: Path) -> Path:
    """Write report.html into a run folder, from the files in it; parts whose files are missing are left out.

    Args:
        run_dir: A run folder, as scenes/README.md describes it.

    Returns:
        Path of the page.

    Raises:
        ReportError: run.json is missing or cannot be read.
    """
    run_dir = Path(run_dir)
    facts = _read_facts(run_dir)
    scene = _scene_of(run_dir)
    page = run_dir / "report.html"
    text = render(
        "report.html.jinja",
        title=str(facts.get("title", run_dir.name)),
        source=str(facts.get("source") or ""),
        outcome=" ".join(filter(None, (str(facts.get("outcome") or ""), str(facts.get("why") or "")))),
        warnings=[str(warning) for warning in facts.get("warnings") or ()],
        film=_film(run_dir, scene),
        gauges=list(_gauges(run_dir, scene)),
        sections=[*_sections(run_dir, scene), *_compared(run_dir, scene)],
        frames=list(_frames(run_dir, scene)),
        setup=list(_setup(run_dir, scene)) if scene else [],
        command=_command(run_dir, facts) if scene else "",
        facts=list(_facts(facts)),
        links=_links(run_dir),
    )
    write_whole(page, text)
    return page


def _read_facts(run_dir: Path) -> dict[str, Any]:
    path = run_dir / "run.json"
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ReportError(f"{path}: missing; a run writes it when it ends") from None
    except (OSError, ValueError) as error:
        raise ReportError(f"{path}: cannot be read: {error}") from None
    if not isinstance(facts, dict):
        raise ReportError(f"{path}: does not hold the facts of a run")
    return facts


def _scene_of(run_dir: Path) -> Scene | None:
    """The run's own scene; None where there is none that this version can read."""
    try:
        return load_scene(run_dir / "scene.yaml")
    except SceneError:
        return None


# ------------------------------------------------------------------------------------------------ sections of the page


def _film(run_dir: Path, scene: Scene | None) -> Film | None:
    """The animation, in the page itself unless it is too large for one."""
    found = [path for path in (run_dir / "preview/animation.mp4", run_dir / "preview/animation.gif") if path.exists()]
    if not found:
        return None
    path = found[0]
    caption = "The lighter, the faster."
    if scene is not None:
        shown, made = scene.output.shown_per_second, scene.output.frames_per_second
        if not math.isclose(shown, made):
            how = f"{shown / made:.3g} times as fast" if shown > made else f"{made / shown:.3g} times as slow"
            caption = f"Shown {how} as it happens. {caption}"
    is_video = path.suffix == ".mp4"
    if path.stat().st_size > MOST_EMBEDDED:
        source = path.relative_to(run_dir).as_posix()
    else:
        source = embedded(path.read_bytes(), "video/mp4" if is_video else "image/gif")
    return Film(source, caption, is_video)


def _gauges(run_dir: Path, scene: Scene | None) -> Iterator[Group]:
    """What the wave at each gauge comes to."""
    observed = _observed(scene)
    places = {gauge.name: gauge for gauge in scene.gauges} if scene else {}
    for name, record in RECORDS[0].read(run_dir).items():
        time, level = record[TIME], record["level [m]"]
        where = places.get(name)
        rows: list[tuple[str, Any]] = [("x [m]", where.x)] if where else []
        if where and where.y is not None:
            rows.append(("y [m]", where.y))
        rows += describe_gauge(time, level).items()
        if name in observed:
            rows += off_observed(time, level, observed[name]).items()
        yield Group(name, rows)


def _observed(scene: Scene | None) -> dict[str, dict[str, np.ndarray]]:
    try:
        return read_observed(scene) if scene else {}
    except SceneError:  # the run has read it; where the folder has been moved to, it may be missing
        return {}


def _sections(run_dir: Path, scene: Scene | None) -> Iterator[Chapter]:
    """The plots of all records there are."""
    sheet, _ = small_plot()
    for kind in RECORDS:
        curves = kind.read(run_dir)
        if not curves:
            continue
        if kind.heading == "Wave gauges":
            gauge_figure(curves, _observed(scene), sheet)
            plots = [("Level above rest over time, at each gauge", plot(sheet))]
        else:
            drawn = kind.plots(curves, _colors(scene, curves), sheet)
            plots = [(title, plot(figure)) for title, figure in drawn]  # each before the next is drawn
        paths = sorted(run_dir.glob(kind.files))
        links = [(path.name, path.relative_to(run_dir).as_posix()) for path in paths]
        yield Chapter(kind.heading, kind.words, plots, links)


def _compared(run_dir: Path, scene: Scene | None) -> Iterator[Chapter]:
    """What probes observed elsewhere, and the spectra of made waves."""
    plots = [(caption, plot(figure)) for caption, figure in instrument_plots(run_dir, scene)] if scene else []
    if plots:
        yield Chapter("Held against", "What was observed, or asked for.", plots, [])


def _colors(scene: Scene | None, curves: Curves) -> dict[str, str]:
    """The colours that fluids have in the pictures; none where two have the same, which a plot would not tell apart."""
    if scene is None:
        return {}
    colors = {name: color for name, color in fluid_colors(scene).items() if name in curves}
    return colors if len(set(colors.values())) == len(colors) else {}


def _frames(run_dir: Path, scene: Scene | None) -> Iterator[tuple[str, str]]:
    """A few frames, evenly spread over the run, by their time."""
    frames = sorted(run_dir.glob("preview/frame.*.png"))
    shown = dict.fromkeys(np.linspace(0, len(frames) - 1, PICTURES).round().astype(int).tolist()) if frames else ()
    for index in shown:
        number = int(frames[index].name.split(".")[1])
        caption = f"t = {number / scene.output.frames_per_second:.4g} s" if scene else f"Frame {number}"
        yield caption, embedded(frames[index].read_bytes(), "image/png")


def _setup(run_dir: Path, scene: Scene) -> Iterator[Group]:
    """What was run: resolution, numerics and materials."""
    rows = {name: height / scene.spacing for name, height in _heights(scene).items()}
    yield Group(
        "Resolution",
        [
            ("dimensions", scene.dimensions),
            ("spacing [m]", scene.spacing),
            *((f"rows of {name}", round(count, 1)) for name, count in rows.items()),
            ("smoothing length / spacing", scene.smoothing.ratio),
            ("end [s]", scene.run.end_time),
            *([("warm-up [s]", scene.warm_up.duration)] if scene.warm_up else []),
        ],
    )
    density = scene.density_diffusion
    yield Group(
        "Numerics",
        [
            ("smoothing kernel", scene.smoothing.kernel),
            ("integrator", scene.run.integrator),
            ("Courant number", scene.run.courant),
            ("walls", scene.wall_model.force),
            ("artificial viscosity", scene.artificial_viscosity),
            ("density diffusion", f"{density.model}, {density.delta:g}"),
            ("gravity [m/s2]", scene.gravity),
        ],
    )
    fastest: dict[str, float] = {}
    colors = fluid_colors(scene)
    for fluid in scene.fluids:
        path = run_dir / "fluids" / f"{fluid.name}.csv"
        record = RECORDS[-1].read(run_dir).get(fluid.name) if path.exists() else None
        if record and "top speed [m/s]" in record:
            fastest[fluid.material] = max(fastest.get(fluid.material, 0.0), float(record["top speed [m/s]"].max()))
    shown = {fluid.material: colors[fluid.name] for fluid in scene.fluids}
    for name, material in scene.materials.items():
        if name not in shown:
            continue
        numbers = [
            (_with_unit(type(material), key), value)
            for key, value in material.model_dump(exclude_none=True).items()
            if key != "color"
        ]
        if fastest.get(name):
            numbers.append(("sound speed / fastest particle", material.sound_speed / fastest[name]))
        yield Group(f"Material {name}", numbers, color=shown[name])


def _with_unit(model: type[Part], key: str) -> str:
    """A field in words, with the unit that its description tells."""
    unit = re.search(r" \[([^\]]+)\]", model.model_fields[key].description or "")
    words = key.replace("_", " ")
    return f"{words} [{unit[1]}]" if unit and unit[1] != "-" else words


def _heights(scene: Scene) -> dict[str, float]:
    """How high each fluid stands as it is drawn [m]: a fill above the lowest point of its wall."""
    up = 1 if scene.dimensions == 2 else 2
    walls = {wall.name: wall for wall in scene.walls}
    found = {}
    for fluid in scene.fluids:
        if fluid.fill:
            bottom = _extent(walls[fluid.fill.above], up)
            if bottom:
                found[fluid.name] = fluid.fill.level - bottom[0]
        elif fluid.shape and (extent := _extent(fluid.shape, up)):
            found[fluid.name] = extent[1] - extent[0]
    return found


def _extent(shape: Any, up: int) -> tuple[float, float] | None:
    """The lowest and the highest point drawn in a scene [m]; None where the file does not simply hold them."""
    round_one = getattr(shape, "disc", None) or getattr(shape, "sphere", None)
    if round_one:
        return round_one.center[-1] - round_one.radius, round_one.center[-1] + round_one.radius
    if shape.box:
        return shape.box.min[up], shape.box.max[up]
    corners = getattr(shape, "polygon", None) or getattr(shape, "path", None)
    if not corners:
        return None
    heights = [point[-1] for point in (getattr(corner, "at", corner) for corner in corners)]
    return min(heights), max(heights)


def _command(run_dir: Path, facts: Mapping[str, Any]) -> str:
    """What repeats the run, from the folder that holds the run folder."""
    provenance = facts.get("provenance") or {}
    device = str(provenance.get("device", "CPU"))
    name = run_dir.resolve().name
    on = "" if device.upper() == "CPU" else " --device cuda"
    version = f"# warpsph {provenance['warpsph']}, where {name} lies\n" if "warpsph" in provenance else ""
    scene, out = shlex.quote(f"{name}/scene.yaml"), shlex.quote(f"{name}_again")
    return f"{version}python -m warpsph scene {scene}{on} --out {out}"


def _facts(facts: Mapping[str, Any]) -> Iterator[Group]:
    """Whatever else run.json holds: counts, speed, conservation, provenance."""
    elsewhere = ("title", "source", "outcome", "why", "warnings", "gauges", "sessions")
    groups = {name: value for name, value in facts.items() if name not in elsewhere and isinstance(value, Mapping)}
    single = {name: value for name, value in facts.items() if name not in (*elsewhere, *groups)}
    for name, group in {**({"result": single} if single else {}), **groups}.items():
        if group:
            yield Group(name.capitalize(), list(group.items()))


def _links(run_dir: Path) -> list[tuple[str, str]]:
    """The other files of the run folder."""
    names = ("scene.yaml", "run.json", "log.txt", "usd/scene.usda", "preview/animation.mp4", "preview/animation.gif")
    return [(name, name) for name in names if (run_dir / name).exists()]
