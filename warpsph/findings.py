"""What run.json says that a run came to: provenance, counts, conservation, crests, impacts and the waves they made."""

import platform
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

import warpsph
from warpsph.measure.energy import drift_and_converted
from warpsph.measure.leaks import behind_walls
from warpsph.measure.waves import celerity, find_impact, find_wave
from warpsph.output.analysis import analysis
from warpsph.output.records import find_crest, is_rising, read_record
from warpsph.scene.scene import Scene
from warpsph.simulation import Simulation


def findings(simulation: Simulation, scene: Scene, folder: Path, outcome: str, why: str) -> dict[str, Any]:
    """Provenance, counts, conservation and crests of a run that has come to an end, as run.json holds them."""
    model = simulation.model
    device = simulation.launcher.device
    behind, fluid = behind_walls(model, simulation.state.position), simulation.state.fluid.numpy()
    return {
        "title": scene.title,
        "source": scene.source,
        "outcome": outcome,
        "why": why,
        "time [s]": simulation.time,
        "provenance": {
            "warpsph": warpsph.__version__,
            "warp": wp.config.version,
            "python": platform.python_version(),
            "machine": platform.platform(),
            "device": device.name,
            "threads": simulation.launcher.threads,
            "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        },
        "counts": {
            "particles": model.particle_count,
            "wall points": simulation.start.wall_count,
            **({"body points": simulation.bodies.set.point_count} if simulation.bodies else {}),
            **dict(zip(model.fluid_names, simulation.start.counts, strict=True)),
        },
        "particles behind walls": int(np.count_nonzero(behind & (fluid < len(model.fluid_names)))),
        **_left(simulation, scene, folder),
        **({"origin [m]": list(simulation.scene.origin)} if any(simulation.scene.origin) else {}),
        "conservation": _conservation(simulation, scene, folder),
        "gauges": _crests(scene, folder),
        **_impacts(simulation, scene, folder),
        **analysis(scene, folder),
        "warnings": list(simulation.start.warnings),
    }


def _left(simulation: Simulation, scene: Scene, folder: Path) -> dict[str, Any]:
    """What has left, of a run in which something has."""
    record = read_record(folder / "left.csv")
    if not len(record["time [s]"]):
        return {}
    model, fluid = simulation.model, record["fluid"].astype(int)
    volume = model.parameters.mass.numpy() / model.parameters.rest_density.numpy()
    unit = "m2" if scene.dimensions == 2 else "m3"
    facts = {
        "particles": len(fluid),
        "dropped as absurd": int(record["dropped"].sum()),
        f"volume [{unit}]": float(volume[fluid].sum()),
        "share of all particles": len(fluid) / model.particle_count,
        "first [s]": float(record["time [s]"][0]),
        "last [s]": float(record["time [s]"][-1]),
        "from [m]": [float(record[f"{axis} [m]"].min()) for axis in "xyz"],
        "to [m]": [float(record[f"{axis} [m]"].max()) for axis in "xyz"],
    }
    return {"left": facts}


def _conservation(simulation: Simulation, scene: Scene, folder: Path) -> dict[str, float]:
    """Mass now and mass that has left over mass at the start, and how far the energy sum strayed, over the energy
    converted."""
    _, motions = simulation.energy.measure()
    model = simulation.model
    mass = model.parameters.mass.numpy()[: len(model.fluid_names)].astype(float)
    placed = float(mass @ simulation.start.counts)
    gone = read_record(folder / "left.csv")["fluid"].astype(int)
    # What water of this weight has to lose on its way to the ground, on the average.
    start = simulation.start
    height = float(start.fluid_box[1][2]) - start.ground
    at_stake = 0.5 * placed * scene.gravity * height
    drift, converted = drift_and_converted(read_record(folder / "energy.csv"), at_stake)
    here = sum(motion.mass for motion in motions)
    facts = {"mass / mass placed": (here + float(mass[gone].sum())) / placed}
    if converted:
        facts["energy converted"] = converted
        facts["energy drift / converted"] = drift / converted
    return facts


def _impacts(simulation: Simulation, scene: Scene, folder: Path) -> dict[str, Any]:
    """How bodies of a 2-D scene came into its water, and the waves that passed its gauges."""
    bodies = simulation.bodies
    level, material = next(((one.fill.level, one.material) for one in scene.fluids if one.fill), (None, ""))
    if bodies is None or level is None or scene.dimensions == 3:
        return {}
    ground = simulation.model.ground + simulation.scene.origin[2]
    about = {"depth": level - ground, "gravity": scene.gravity}
    impacts = {}
    for body in bodies.set.bodies:
        record = read_record(folder / "bodies" / f"{body.name}.csv")
        mass = {"mass": body.mass.mass, "inertia": float(body.mass.inertia[1, 1])}
        assert body.outline is not None, "of a scene in the plane"
        corners = body.outline.polygon() - body.mass.centre[[0, 2]]
        found = find_impact(record, corners, level=level, **about, **mass)
        if found:
            impacts[body.name] = {
                "time [s]": found.time,
                "speed [m/s]": found.speed,
                "Froude number": found.froude,
                "kinetic energy [J/m]": found.energy,
                "kinetic energy at the first contact [J/m]": found.arrival,
            }
    if not impacts:
        return {}
    total = sum(impact["kinetic energy [J/m]"] for impact in impacts.values())
    density = scene.materials[material].density
    return {"impacts": impacts, "waves": _waves(scene, folder, total, density=density, **about)}


def _waves(scene: Scene, folder: Path, impact: float, **about: float) -> dict[str, dict[str, float]]:
    """The waves that passed the gauges after an impact of that kinetic energy [J/m]; `about` as `find_wave` has it."""
    waves: dict[str, dict[str, float]] = {}
    passed = []
    for gauge in scene.gauges:
        time, height = read_record(folder / "gauges" / f"{gauge.name}.csv").values()
        wave = find_wave(time, height - height[0], **about) if len(time) else None
        if wave is None:
            continue
        passed.append((gauge.name, gauge.x, wave))
        waves[gauge.name] = {
            "crest amplitude [m]": find_crest(time, height)[0],
            "solitary amplitude [m]": wave.fit.amplitude,
            "likeness to a solitary wave, R2": wave.fit.r2,
            "period [s]": wave.period,
            "kinetic energy [J/m]": wave.kinetic,
            "potential energy [J/m]": wave.potential,
            "energy / kinetic energy of the impact": (wave.kinetic + wave.potential) / impact,
        }
    # Of the crest from the gauge before; at the first, which has none before it, on to the next.
    for (name, x, near), (next_name, next_x, far) in pairwise(passed):
        if far.fit.crest > near.fit.crest:
            waves[next_name]["celerity [m/s]"] = celerity(near, far, next_x - x)
            waves[name].setdefault("celerity [m/s]", waves[next_name]["celerity [m/s]"])
    return waves


def _crests(scene: Scene, folder: Path) -> dict[str, dict[str, Any]]:
    """The highest crest that passed each gauge."""
    found = {}
    for gauge in scene.gauges:
        time, level = read_record(folder / "gauges" / f"{gauge.name}.csv").values()
        if len(time):
            amplitude, at = find_crest(time, level)
            found[gauge.name] = {
                "x [m]": gauge.x,
                "still level [m]": float(level[0]),
                "crest amplitude [m]": amplitude,
                "crest time [s]": at,
                **({"still rising": True} if is_rising(time, level) else {}),
            }
    return found
