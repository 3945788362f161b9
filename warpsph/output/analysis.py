"""What instruments and gauges come to at the end of a run: extremes, trains of waves, and what was observed elsewhere.

For run.json, and as plots for the report.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from warpsph.measure.compare import compared, read_observed
from warpsph.measure.wave_train import find_train, harmonic, phase_speed, reflected, reflected_sea, spectrum
from warpsph.output.plots import INK, LINE_PALETTE, name_lines, small_plot
from warpsph.output.records import find_crest, read_record
from warpsph.scene.instruments import Observed
from warpsph.scene.scene import Scene
from warpsph.scene.waves import WaveMaker
from warpsph.scene.whole import INSTRUMENTS
from warpsph.theory.waves import (
    HIGHEST,
    LOWEST,
    group_celerity,
    paddle_ratio,
    spectral_density,
    wavelength,
    wavenumber,
)

log = logging.getLogger("warpsph")

# Waves that have passed a gauge before its record counts, and how many there must be then.
SETTLING, LEAST = 2.0, 3.0


def analysis(scene: Scene, folder: Path) -> dict[str, Any]:
    """The extremes of each instrument, the waves that were made, and how records compare with observations."""
    facts = {"instruments": _extremes(scene, folder), "wave train": _train(scene, folder)}
    return {name: value for name, value in (facts | {"observed": _observed(scene, folder)}).items() if value}


def _columns(path: Path) -> dict[str, np.ndarray]:
    return read_record(path) if path.exists() else {}


def _extremes(scene: Scene, folder: Path) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for kind in (one for one in INSTRUMENTS if one != "gauges"):
        for part in getattr(scene, kind):
            record = _columns(folder / kind / f"{part.name}.csv")
            if not len(record.get("time [s]", ())):
                continue
            time = record.pop("time [s]")
            mine: dict[str, Any] = {}
            for heading, values in record.items():
                some = np.flatnonzero(np.isfinite(values))
                if len(some):
                    low, high = some[values[some].argmin()], some[values[some].argmax()]
                    ends = {"least": float(values[low]), "least at [s]": float(time[low])}
                    mine[heading] = ends | {"greatest": float(values[high]), "greatest at [s]": float(time[high])}
            if kind == "run_up" and np.isfinite(record["z [m]"]).any():
                z, length = record["z [m]"], record["length [m]"]
                wet = np.flatnonzero(np.isfinite(z))
                first, top = wet[0], wet[z[wet].argmax()]
                mine["run-up [m]"] = float(z[top] - z[first])
                if math.isfinite(length[top]):
                    mine["run-up along the wall [m]"] = float(abs(length[top] - length[first]))
            found[f"{kind}/{part.name}"] = mine
    return found


# ------------------------------------------------------------------------------------------------------- made waves


def _train(scene: Scene, folder: Path) -> dict[str, Any]:
    """What the waves of a wave maker are at each gauge, against what was asked for."""
    maker = scene.wave_maker
    if maker is None or maker.waves not in ("regular", "irregular", "solitary") or not scene.gauges:
        return {}
    if maker.waves == "solitary":
        return _solitary(scene, maker, folder)
    height, period = _size(maker)
    about = {"depth": maker.depth, "gravity": scene.gravity}
    omega, length = 2.0 * math.pi / period, wavelength(period, **about)
    target = {"height [m]": height, "period [s]": period}
    target |= {"wavelength [m]": length, "celerity [m/s]": length / period}
    hinge = None if maker.hinge is None else maker.hinge - maker.bed
    if maker.waves == "regular":
        k = float(wavenumber(omega, **about))
        target["stroke of first order [m]"] = height / float(paddle_ratio(k, depth=maker.depth, hinge=hinge))
    else:
        target["seed"] = 1 if maker.seed is None else maker.seed
    facts: dict[str, Any] = {"asked for": target}
    ramp = period if maker.ramp is None else maker.ramp
    far = max(gauge.x - maker.x for gauge in scene.gauges)
    # The slowest of a sea that matters goes at the celerity of its peak's group.
    begin = maker.begin + ramp + far / group_celerity(period, **about) + SETTLING * period
    records = {}
    for gauge in scene.gauges:
        record = _columns(folder / "gauges" / f"{gauge.name}.csv")
        time, level = record.get("time [s]", np.empty(0)), record.get("level [m]", np.empty(0))
        kept = time >= begin
        if kept.sum() < 8 or time[-1] - begin < LEAST * period:
            return facts | {"gauges": f"too short a record: waves have come to all gauges at t = {begin:.3g} s"}
        records[gauge.name] = gauge.x, time[kept], level[kept]
    trains: dict[str, dict[str, float]] = {}
    for name, (x, time, level) in records.items():
        train = find_train(time, level)
        if train is None:
            continue
        trains[name] = {
            "x [m]": x,
            "waves": train.count,
            "height [m]": train.height,
            "period [s]": train.period,
            "significant height [m]": train.significant,
            "significant height, spectrum [m]": train.spectral,
            "peak period [s]": train.peak_period,
            "height / asked for": (train.height if maker.waves == "regular" else train.spectral) / height,
        }
        if maker.waves == "regular":
            trains[name]["first harmonic / asked for"] = 2.0 * abs(harmonic(time, level, omega)) / height
    facts["gauges"] = trains
    if maker.waves == "regular":
        between = {}
        for (a, (xa, time, one)), (b, (xb, _, other)) in pairwise(records.items()):
            if xb <= xa:
                continue
            speed = phase_speed(
                harmonic(time, one, omega), harmonic(time, other, omega), xb - xa, omega, maker.depth, scene.gravity
            )
            if math.isfinite(speed):
                between[f"{a} to {b}"] = {"celerity [m/s]": speed, "wavelength [m]": speed * period}
        facts["between gauges"] = between
    facts |= _reflection(scene, maker, records)
    return facts


def _size(maker: WaveMaker) -> tuple[float, float]:
    """Height [m] and period [s] of waves that have both."""
    assert maker.height is not None and maker.period is not None, "the scene asks for both"
    return maker.height, maker.period


def _reflection(
    scene: Scene, maker: WaveMaker, records: dict[str, tuple[float, np.ndarray, np.ndarray]]
) -> dict[str, Any]:
    """Reflection by the three gauges in a row that stand closest to each other: Mansard & Funke (1980)."""
    _, period = _size(maker)
    ordered = sorted(records, key=lambda name: records[name][0])
    if len(ordered) < 3 or maker.depth <= 0.0:
        return {}
    threes = [ordered[i : i + 3] for i in range(len(ordered) - 2)]
    chosen = min(threes, key=lambda names: records[names[2]][0] - records[names[0]][0])
    places = np.array([records[name][0] for name in chosen])
    levels = np.array([records[name][2] for name in chosen])
    time = records[chosen[0]][1]
    if maker.waves == "regular":
        onward, back = reflected(places, levels, time, 2.0 * math.pi / period, maker.depth, scene.gravity)
    else:
        ends = LOWEST / period, HIGHEST / period
        onward, back = reflected_sea(places, levels, time, maker.depth, scene.gravity, *ends)
    facts = {"gauges": ", ".join(chosen), "incident height [m]": onward, "reflected height [m]": back}
    return {"reflection": facts | {"coefficient": back / onward if onward > 0.0 else math.nan}}


def _solitary(scene: Scene, maker: WaveMaker, folder: Path) -> dict[str, Any]:
    """The crest of a solitary wave at each gauge, and its celerity from one to the next."""
    asked = maker.height
    assert asked is not None, "the scene asks for it"
    celerity = math.sqrt(scene.gravity * (maker.depth + asked))
    facts: dict[str, Any] = {"asked for": {"height [m]": asked, "celerity [m/s]": celerity}}
    crests = {}
    for gauge in scene.gauges:
        record = _columns(folder / "gauges" / f"{gauge.name}.csv")
        if len(record.get("time [s]", ())):
            crests[gauge.name] = gauge.x, *find_crest(record["time [s]"], record["level [m]"])
    facts["gauges"] = {
        name: {"x [m]": x, "height [m]": height, "height / asked for": height / asked}
        for name, (x, height, _) in crests.items()
    }
    facts["between gauges"] = {
        f"{a} to {b}": {
            "celerity [m/s]": (xb - xa) / (tb - ta),
            "celerity / sqrt(g (d + H))": (xb - xa)
            / (tb - ta)
            / math.sqrt(scene.gravity * (maker.depth + 0.5 * (ha + hb))),
        }
        for (a, (xa, ha, ta)), (b, (xb, hb, tb)) in pairwise(crests.items())
        if tb > ta and xb > xa
    }
    return facts


# ------------------------------------------------------------------------------------------------------- observed


def _observed(scene: Scene, folder: Path) -> dict[str, dict[str, float]]:
    """How each record compares with observations; a file that cannot be read is told, not raised."""
    found = {}
    for name, observed, heading in _held_against(scene):
        record = _columns(folder / f"{name}.csv")
        if heading not in record:
            continue
        try:
            # A level was observed above rest.
            rest = record[heading][0] if name.startswith("gauges/") else 0.0
            result = compared(record["time [s]"], record[heading] - rest, *read_observed(observed))
        except ValueError as error:
            log.warning("%s", error)
            continue
        if result is None:
            log.warning("%s: shares less than three samples with %s", observed.file, name)
            continue
        found[name] = result.facts(heading.partition("[")[2].rstrip("]"))
    return found


def _held_against(scene: Scene) -> Iterator[tuple[str, Observed, str]]:
    """Record, what was observed, and the heading of the column that it is held against."""
    for kind, usual in (("gauges", "level"), ("probes", "pressure")):
        for part in getattr(scene, kind):
            if part.observed:
                quantity = part.observed.quantity or usual
                unit = {"level": "m", "pressure": "Pa"}.get(quantity, "m/s")
                yield f"{kind}/{part.name}", part.observed, f"{quantity} [{unit}]"


# --------------------------------------------------------------------------------------------------------- plots


def instrument_plots(run_dir: Path, scene: Scene) -> Iterator[tuple[str, Figure]]:
    """Caption and figure of observed probes, and of the spectra of a sea, for the report."""
    for name, observed, heading in _held_against(scene):
        record = _columns(run_dir / f"{name}.csv")
        if name.startswith("gauges/") or heading not in record or len(record["time [s]"]) < 2:
            continue  # the report draws what gauges observed over their records
        try:
            seen = read_observed(observed)
        except ValueError:
            continue
        yield f"{name.partition('/')[2]}, computed and observed", _draw_observed(record, heading, seen)
    if scene.wave_maker and scene.wave_maker.waves == "irregular":
        figure = _draw_spectra(scene, scene.wave_maker, run_dir)
        if figure is not None:
            yield "Spectra at the gauges and that asked for", figure


def _draw_observed(record: dict[str, np.ndarray], heading: str, seen: tuple[np.ndarray, np.ndarray]) -> Figure:
    figure, axes = small_plot()
    time, (at, value) = record["time [s]"], seen
    axes.plot(at, value, color=INK, linewidth=1.0, marker=".", markersize=3, label="observed")
    axes.plot(time, record[heading], color=LINE_PALETTE[0], linewidth=1.4, label="computed")
    axes.set(xlabel="time [s]", ylabel=heading, xlim=(time[0], time[-1]))
    name_lines(figure, axes)
    return figure


def _draw_spectra(scene: Scene, maker: WaveMaker, run_dir: Path) -> Figure | None:
    """Spectra of all gauges, bands of eight frequencies, over the one asked for; None where records are too short."""
    height, period = _size(maker)
    figure, axes = small_plot()
    drawn = False
    for gauge, color in zip(scene.gauges, cycle(LINE_PALETTE), strict=False):
        record = _columns(run_dir / "gauges" / f"{gauge.name}.csv")
        time = record.get("time [s]", np.empty(0))
        kept = time >= maker.begin + 2.0 * period
        if kept.sum() < 64:
            continue
        f, density = spectrum(time[kept], record["level [m]"][kept], bands=8)
        axes.plot(f, density, color=color, linewidth=1.2, label=gauge.name)
        drawn = True
    f = np.linspace(LOWEST, HIGHEST, 300) / period
    name, peak = maker.spectrum or "jonswap", maker.peak_enhancement or 3.3
    asked = spectral_density(f, height=height, period=period, spectrum=name, peak=peak)
    axes.plot(f, asked, color=INK, linewidth=1.6, linestyle="--", label="asked for")
    axes.set(xlabel="frequency [Hz]", ylabel="S [m2 s]", xlim=(0.0, 1.2 * HIGHEST / period))
    name_lines(figure, axes)
    return figure if drawn else None
