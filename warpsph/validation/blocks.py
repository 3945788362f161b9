"""Blocks that slide into water and the waves that they make (Vasco 2014, 7.2.5.1 and 7.2.5.2), one and in series."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from warpsph.measure.waves import Impact, Wave, celerity, find_impact, find_wave
from warpsph.output.plots import LINE_PALETTE, new_plots
from warpsph.output.records import find_crest, read_record
from warpsph.run import Run
from warpsph.theory.analytic import impulse_product, impulse_wave, solitary_celerity, solitary_energy
from warpsph.validation.result import Result, against, at_most

MACIEL = "Maciel & Nascimento (2002) in Vasco (2014) 7.2.5.2"
MKI = "Monaghan, Kos & Issa (2003) in Vasco (2014) 7.2.5.1"
NO_WAVE = Result("blocks that sank and made a wave at both gauges", "", 0, 1, passed=False, source="it must")
NASCIMENTO = "between 1 and 14 %: Nascimento (2001)"
HELLER = "Heller & Hager (2010), granular slides"
# Of the slopes on which those experiments were made [degrees].
LEAST_SLOPE = 30.0


@dataclass(frozen=True)
class BlockImpact:
    """What came of one block.

    Attributes:
        impact: On the water.
        waves: As they passed the last two gauges.
        amplitude: Of the crest at the last gauge [m].
        reflected: Amplitude of the highest crest that came back to it from the end of the flume [m]; nan if none did.
        celerity, expected: Of the crest between the gauges, and of a solitary wave as high as that [m/s].
        share: Energy of the wave at the last gauge over the kinetic energy of the block as its centre sinks through the
            still level, the impact.
        share_of_arrival: The same over its kinetic energy as it first touches the water.
        share_of_fall: The same over its kinetic energy at the impact and what gravity gives it from then on.
        share_of_all: The same over all the energy that the block lost, to water and to friction, since its release.
        by_law, share_by_law: The amplitude [m] at the last gauge by `impulse_wave`, and the `share` of a solitary wave
            as high; nan on a ramp that is too gentle for it.
        inside: Particles in the block.
        gap: From the centre of the block to the nearest point of a wall [m].
    """

    impact: Impact
    waves: tuple[Wave, Wave]
    amplitude: float
    reflected: float
    celerity: float
    expected: float
    share: float
    share_of_arrival: float
    share_of_fall: float
    share_of_all: float
    by_law: float
    share_by_law: float
    inside: int
    gap: float


def slide_of(run: Run) -> BlockImpact | None:
    """From the records of a finished run, and its last state; None if no block sank, or no wave passed both gauges."""
    scene, simulation = run.scene, run.simulation
    fill = next(fluid for fluid in scene.fluids if fluid.fill)
    depth, density = fill.fill.level, scene.materials[fill.material].density
    body, about = simulation.bodies.set.bodies[0], {"depth": depth, "gravity": scene.gravity}
    record = read_record(run.folder / "bodies" / f"{body.name}.csv")
    mass = {"mass": body.mass.mass, "inertia": float(body.mass.inertia[1, 1])}
    corners = body.outline.polygon() - body.mass.centre[[0, 2]]
    impact = find_impact(record, corners, level=depth, **about, **mass)
    near, far = scene.gauges[-2:]
    records = [tuple(read_record(run.folder / "gauges" / f"{gauge.name}.csv").values()) for gauge in (near, far)]
    first, last = (find_wave(time, level - level[0], **about, density=density) for time, level in records)
    if impact is None or first is None or last is None:
        return None
    c = solitary_celerity(
        depth=depth, amplitude=0.5 * (first.fit.amplitude + last.fit.amplitude), gravity=scene.gravity
    )
    walls = simulation.model.wall_position.numpy()
    centre = simulation.bodies.set.position.numpy()[1]
    energy = read_record(run.folder / "energy.csv")
    of_block = energy["bodies kinetic [J/m]"] + energy["bodies potential [J/m]"]
    time, level = records[1]
    # The crest comes back after twice the way to the end of the flume: look from half of that time on.
    back = time > last.fit.crest + (walls[:, 0].max() - far.x) / c
    wave = last.kinetic + last.potential
    # The block lies on the ramp, which goes down along x to a foot at x = 0.
    slide = {"mass": body.mass.mass, "slope": -scene.bodies[0].angle, "density": density}
    by_law = amplitude_by_law(impact.froude, corners, depth=depth, gauge=far.x, **slide)
    reflected = find_crest(time[back], np.append(level[0], level[back][1:]))[0] if back.sum() > 5 else np.nan
    return BlockImpact(
        impact,
        (first, last),
        find_crest(time, level)[0],
        reflected,
        celerity(first, last, far.x - near.x),
        c,
        wave / impact.energy,
        wave / impact.arrival,
        wave / (impact.energy + impact.fall),
        wave / float(of_block[0] - of_block[-1]),
        by_law,
        solitary_energy(**about, amplitude=by_law, density=density) / impact.energy,
        int(simulation.bodies.holds(simulation.state.snapshot().position).sum()),
        float(np.linalg.norm(walls - centre, axis=1).min()),
    )


def amplitude_by_law(
    froude: float, corners: np.ndarray, *, mass: float, slope: float, density: float, depth: float, gauge: float
) -> float:
    """`impulse_wave` [m] at x = `gauge` [m] of a block with `corners` [m], shape [n, 2], on a ramp with its foot at 0.

    nan on a `slope` [degrees] that is too gentle for the law. Distances count from where the ramp meets still water.
    """
    if slope < LEAST_SLOPE:
        return np.nan
    ramp = np.radians(slope)
    thickness = float(np.ptp(corners @ [np.sin(ramp), np.cos(ramp)]))
    product = impulse_product(froude=froude, thickness=thickness, mass=mass, depth=depth, slope=slope, density=density)
    return impulse_wave(product, depth=depth, distance=gauge + depth / np.tan(ramp))


def measure_block_maciel(run: Run) -> list[Result]:
    """Bars: likeness to a solitary wave R2 above 0.98, celerity 3 %, amplitude in the experiment's 0.03 to 0.05 m and
    within 30 % of other experiments."""
    slide, far = slide_of(run), run.scene.gauges[-1].name
    if slide is None:
        return [NO_WAVE]
    amplitude, r2 = slide.amplitude, slide.waves[1].fit.r2
    source = f"between 0.03 and 0.05 m: {MACIEL}"
    return [
        Result("Froude number of the impact", "", slide.impact.froude, None, source="computed"),
        Result(f"crest amplitude at {far}", "m", amplitude, None, passed=0.03 <= amplitude <= 0.05, source=source),
        against("the same", "m", amplitude, slide.by_law, 0.3, HELLER),
        against("celerity of the crest", "m/s", slide.celerity, slide.expected, 0.03, "sqrt(g (d + a))"),
        Result(
            f"likeness to a solitary wave at {far}, R2",
            "",
            r2,
            None,
            bar=0.98,
            passed=r2 > 0.98,
            source="Boussinesq (1872)",
        ),
        *_sound(slide),
        Result("energy of a solitary wave over that at the impact", "", slide.share_by_law, None, source=HELLER),
    ]


def measure_block_mki(run: Run) -> list[Result]:
    """Bars: energy of the wave 1 to 14 % of the block's; see the series for how the wave grows with the speed."""
    slide, far = slide_of(run), run.scene.gauges[-1].name
    if slide is None:
        return [NO_WAVE]
    return [
        Result("Froude number of the impact", "", slide.impact.froude, None, source="computed"),
        Result(f"crest amplitude at {far}", "m", slide.amplitude, None, source="computed"),
        Result(f"amplitude at {far} of the reflected crest", "m", slide.reflected, None, source="computed"),
        # No bar: the crest breaks up to the first gauge and is no solitary wave before the second.
        Result("celerity of the crest", "m/s", slide.celerity, slide.expected, source="sqrt(g (d + a))"),
        *_sound(slide),
    ]


def _sound(slide: BlockImpact) -> list[Result]:
    """What must hold for every block."""
    return [
        _within("energy of the wave over the kinetic energy of the block at the impact", slide.share),
        _within("the same over its kinetic energy at the first contact", slide.share_of_arrival),
        # No bar: the accounts do not say which energy of the block is meant, and speak of the incident, kinetic one.
        Result("the same, with what it falls from the impact on", "", slide.share_of_fall, None, source="computed"),
        Result("the same over all that the block lost", "", slide.share_of_all, None, source="computed"),
        at_most("particles in the block", "", slide.inside, 0, "no leak"),
        Result("block from the wall", "m", slide.gap, None, passed=slide.gap < 0.2, source="it stays in the flume"),
    ]


def _within(quantity: str, share: float) -> Result:
    """A share of the energy of the block, and whether it is one that was found in experiments."""
    return Result(quantity, "", share, None, passed=0.01 <= share <= 0.14, source=NASCIMENTO)


def measure_maciel_series(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bar: the crest at the last gauge grows with the Froude number."""
    return _measure_series(runs, folder, "crest amplitude", lambda slide: slide.amplitude, MACIEL)


def measure_mki_series(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bar: the crest that comes back from the end of the flume grows with the Froude number."""
    return _measure_series(runs, folder, "amplitude of the reflected crest", lambda slide: slide.reflected, MKI)


def _measure_series(
    runs: Sequence[Run], folder: Path, name: str, amplitude: Callable[[BlockImpact], float], source: str
) -> list[Result]:
    """One line for each speed, and whether amplitudes grow with the Froude number; the curve goes to `folder`."""
    found = [slide for slide in map(slide_of, runs) if slide is not None]
    if len(found) < len(runs):
        return [NO_WAVE]
    slides = sorted(found, key=lambda slide: slide.impact.froude)
    froude, heights = [s.impact.froude for s in slides], [amplitude(s) for s in slides]
    depth = next(fluid.fill.level for fluid in runs[0].scene.fluids if fluid.fill)
    by_law = np.array([slide.by_law for slide in slides]) / depth
    draw_series(froude, np.array(heights) / depth, by_law, f"{name} / depth", folder / "amplitude.png")
    least = float(np.diff(heights).min())
    results = []
    for slide, height in zip(slides, heights, strict=True):
        quantity = f"{name}, Froude number {slide.impact.froude:.2f}"
        if np.isnan(slide.by_law):
            results.append(Result(quantity, "m", height, None, source="computed"))
        else:
            results.append(against(quantity, "m", height, slide.by_law, 0.3, HELLER))
    for slide in slides:
        fr = slide.impact.froude
        quantity = "energy of the wave over the kinetic energy of the block at the"
        results.append(_within(f"{quantity} impact, Froude number {fr:.2f}", slide.share))
        results.append(_within(f"{quantity} first contact, Froude number {fr:.2f}", slide.share_of_arrival))
    of_all = max(slide.share_of_all for slide in slides)
    return [
        *results,
        Result("the same over all that the block lost, at most", "", of_all, None, source="computed"),
        Result("least growth from one speed to the next", "m", least, None, passed=least > 0.0, source=source),
        at_most("particles in a block", "", sum(slide.inside for slide in slides), 0, "no leak"),
        Result(
            "block from the wall, farthest",
            "m",
            max(s.gap for s in slides),
            None,
            passed=max(s.gap for s in slides) < 0.2,
            source="it stays in the flume",
        ),
    ]


def draw_series(froude: Sequence[float], amplitudes: np.ndarray, by_law: np.ndarray, label: str, out: Path) -> None:
    """Plot amplitudes, and the amplitudes of a law where they are not nan, over Froude numbers to the PNG `out`."""
    figure, (axes,) = new_plots(1)
    axes.plot(froude, amplitudes, "o-", color=LINE_PALETTE[0], linewidth=1.4, label="computed")
    if not np.isnan(by_law).any():
        axes.plot(froude, by_law, "--", color=LINE_PALETTE[1], linewidth=1.4, label=HELLER)
        axes.legend(frameon=False)
    axes.set(xlabel="Froude number of the impact", ylabel=label)
    axes.set_ylim(bottom=0.0)
    figure.savefig(out, format="png")
