"""The report of a run: one HTML page that holds its pictures, plots and numbers, and needs nothing else."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterator, Mapping
from html import escape
from io import BytesIO
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure

from warpsph.output.analysis import instrument_plots
from warpsph.output.frames import INK, LINE_PALETTE, fluid_colors, gauge_picture, new_plots
from warpsph.output.records import read_record

PICTURES = 6  # frames shown, from the first to the last

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>
body {{ margin: 0 auto; max-width: 60rem; padding: 2rem 1.5rem 4rem; color: #2b2f33; background: #fff;
       font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }}
h1 {{ margin: 0; font-size: 1.7rem; line-height: 1.25; }}
h2 {{ margin: 2.5rem 0 .75rem; padding-bottom: .25rem; border-bottom: 1px solid #d5d9dd; font-size: 1.2rem; }}
h3 {{ margin: 1.25rem 0 .25rem; font-size: 1rem; }}
p {{ margin: .25rem 0; }}
.quiet {{ color: #646b72; }}
.warning {{ padding: .4rem .8rem; border-left: 4px solid #c98a1b; background: #fdf6e7; }}
img {{ display: block; width: 100%; height: auto; margin: .75rem 0; }}
.facts {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(24rem, 1fr)); gap: 0 2.5rem; }}
table {{ width: 100%; border-collapse: collapse; font-size: .95rem; }}
td, th {{ padding: .25rem .75rem .25rem 0; border-bottom: 1px solid #eceef0; text-align: left; vertical-align: top; }}
th {{ color: #646b72; font-weight: 600; }}
.number {{ text-align: right; font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }}
</style>
</head>
<body>
<h1>{title}</h1>
{body}
</body>
</html>
"""


class ReportError(ValueError):
    """There is no finished run to report on; the text is one line for the user."""


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
    body = "\n".join(
        part
        for section in (
            *(_summary(facts), _gauges(run_dir, facts), _instruments(run_dir), _pictures(run_dir), _plots(run_dir)),
            _facts(facts),
        )
        for part in section
    )
    page = run_dir / "report.html"
    page.write_text(PAGE.format(title=escape(str(facts.get("title", run_dir.name))), body=body), encoding="utf-8")
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


# ------------------------------------------------------------------------------------------------ sections of the page


def _summary(facts: Mapping[str, Any]) -> Iterator[str]:
    """Where the case comes from, how the run ended, and what to be wary of."""
    if facts.get("source"):
        yield f'<p class="quiet">{escape(str(facts["source"]))}</p>'
    if facts.get("outcome"):
        yield f"<p>Outcome: {escape(' '.join(filter(None, (str(facts['outcome']), str(facts.get('why') or '')))))}</p>"
    for warning in facts.get("warnings") or ():
        yield f'<p class="warning">{escape(str(warning))}</p>'


def _gauges(run_dir: Path, facts: Mapping[str, Any]) -> Iterator[str]:
    """The crest at each gauge, and the record of all."""
    crests = facts.get("gauges")
    records = sorted(path for path in run_dir.glob("gauges/*.csv") if _has_rows(path))
    if crests or records:
        yield "<h2>Wave gauges</h2>"
    if crests:
        headings = list(dict.fromkeys(heading for crest in crests.values() for heading in crest))
        cells = "".join(f'<th class="number">{escape(heading)}</th>' for heading in headings)
        yield f"<table><tr><th>gauge</th>{cells}</tr>"
        for name, crest in crests.items():
            cells = "".join(f'<td class="number">{_text(crest.get(heading))}</td>' for heading in headings)
            yield f"<tr><td>{escape(name)}</td>{cells}</tr>"
        yield "</table>"
    if records:
        drawn = run_dir / "preview" / "gauges.png"
        if not drawn.exists() or drawn.stat().st_mtime < max(path.stat().st_mtime for path in records):
            drawn = BytesIO()
            gauge_picture(records, drawn)
        picture = drawn.getvalue() if isinstance(drawn, BytesIO) else drawn.read_bytes()
        yield _image(picture, "Level above that at rest over time, at each gauge")


def _instruments(run_dir: Path) -> Iterator[str]:
    """The records of probes, forces, run-up and overtopping, and what was observed."""
    last = ""
    for heading, caption, figure in instrument_plots(run_dir):
        if heading != last:
            yield f"<h2>{escape(heading)}</h2>"
        last = heading
        yield _plot(figure, caption)


def _pictures(run_dir: Path) -> Iterator[str]:
    """A few frames, evenly spread over the run."""
    frames = sorted(run_dir.glob("preview/frame.*.png"))
    if frames:
        yield "<h2>Pictures</h2>"
    shown = dict.fromkeys(np.linspace(0, len(frames) - 1, PICTURES).round().astype(int).tolist()) if frames else ()
    for index in shown:
        yield _image(frames[index].read_bytes(), f"Frame {index}")


def _plots(run_dir: Path) -> Iterator[str]:
    """The energy budget, and each fluid as a whole."""
    energy = run_dir / "energy.csv"
    if _has_rows(energy):
        yield "<h2>Energy</h2>"
        yield "<p>Change of each part of the energy budget since the release. The total should stay at zero.</p>"
        yield _plot(_draw_energy(read_record(energy)), "Change of the parts of the energy budget over time")
    fluids = {path.stem: read_record(path) for path in sorted(run_dir.glob("fluids/*.csv")) if _has_rows(path)}
    if fluids:
        yield "<h2>Fluids</h2>"
        colors = _fluid_colors(run_dir) or dict(zip(fluids, cycle(LINE_PALETTE), strict=False))
        yield _plot(_draw_fluids(fluids, colors), "Centre of gravity and front of each fluid over time")


def _facts(facts: Mapping[str, Any]) -> Iterator[str]:
    """Whatever else run.json holds: counts, speed, conservation, provenance."""
    yield "<h2>The run</h2>"
    told = ("title", "source", "outcome", "why", "warnings", "gauges")
    groups = {name: value for name, value in facts.items() if name not in told and isinstance(value, Mapping)}
    single = {name: value for name, value in facts.items() if name not in (*told, *groups)}
    yield '<div class="facts">'
    for name, group in {**({"result": single} if single else {}), **groups}.items():
        rows = "".join(
            f'<tr><td>{escape(key)}</td><td class="number">{_text(value)}</td></tr>' for key, value in group.items()
        )
        yield f"<div><h3>{escape(name.capitalize())}</h3><table>{rows}</table></div>"
    yield "</div>"


# --------------------------------------------------------------------------------------------------------------- plots


def _draw_energy(record: Mapping[str, np.ndarray]) -> Figure:
    (time_heading, time), *parts = record.items()
    figure, (axes,) = new_plots(1)
    for (heading, energy), color in zip(parts, cycle(LINE_PALETTE), strict=False):
        name, _, unit = heading.partition(" [")
        is_total = name == "total"
        style = {"color": INK, "linewidth": 2.0, "linestyle": "--"} if is_total else {"color": color, "linewidth": 1.4}
        axes.plot(time, energy - energy[0], label=name, **style)
        axes.set_ylabel(f"energy − energy at the release [{unit}")
    axes.set_xlabel(time_heading)
    axes.margins(x=0.0)
    figure.legend(frameon=False, loc="outside right upper", fontsize=10, labelcolor=INK)
    return figure


def _draw_fluids(fluids: Mapping[str, Mapping[str, np.ndarray]], colors: Mapping[str, str]) -> Figure:
    plots = {"x [m]": "centre of gravity, x [m]", "z [m]": "centre of gravity, z [m]", "front [m]": "front, x [m]"}
    figure, panels = new_plots(len(plots))
    for axes, (heading, label) in zip(panels, plots.items(), strict=True):
        for name, record in fluids.items():
            if heading in record:
                axes.plot(record["time [s]"], record[heading], color=colors.get(name, INK), linewidth=1.6, label=name)
        axes.set(xlabel="time [s]", ylabel=label)
        axes.margins(x=0.0)
    panels[0].legend(frameon=False, fontsize=10, labelcolor=INK)
    return figure


def _fluid_colors(run_dir: Path) -> dict[str, str]:
    """The colours of the pictures, from the run's own scene; nothing where there is none that can be read."""
    try:
        scene = yaml.safe_load((run_dir / "scene.yaml").read_text(encoding="utf-8"))
        materials = {name: material.get("color") for name, material in scene["materials"].items()}
        return fluid_colors({fluid["name"]: fluid["material"] for fluid in scene["fluids"]}, materials)
    except (OSError, yaml.YAMLError, LookupError, TypeError, AttributeError):
        return {}


def _has_rows(path: Path) -> bool:
    """Whether a record is there and holds more than its heading."""
    if not path.exists():
        return False
    with path.open(encoding="utf-8") as file:
        return len([line for line, _ in zip(file, range(2), strict=False)]) == 2


def _plot(figure: Figure, caption: str) -> str:
    picture = BytesIO()
    figure.savefig(picture, format="png")
    return _image(picture.getvalue(), caption)


def _image(png: bytes, caption: str) -> str:
    return f'<img alt="{escape(caption)}" src="data:image/png;base64,{b64encode(png).decode()}">'


def _text(value: Any) -> str:
    """A fact as it is read: digits in groups of three, numbers to five figures."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")  # a narrow space that does not break
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, Mapping):
        return "<br>".join(f"{escape(str(key))}: {_text(part)}" for key, part in value.items())
    if isinstance(value, (list, tuple)):
        return "<br>".join(_text(part) for part in value)
    return "–" if value is None else escape(str(value))
