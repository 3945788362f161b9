"""The six studies of Braga (2018), by his scheme and by ours: counts, verdicts, levels, momentum."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.validation.dam_break import front_error
from warpsph.validation.result import Result, against, at_most

SOURCE = "Braga (2018)"
GRAVITY = 9.8
# Energy may come back from compression: this share of the energy at the start, on top of it, is no divergence.
SLACK = 0.01


@dataclass(frozen=True)
class HisRun:
    """One of his runs.

    Attributes:
        spacing: [m].
        count: Its particles.
        diverges: When it does [s]; None where it does not.
    """

    spacing: float
    count: int
    diverges: float | None = None


@dataclass(frozen=True)
class Study:
    """One of the studies.

    Attributes:
        title: What happens.
        section: Of the thesis.
        top: Height of the highest water at the start [m].
        level: At which the water comes to rest, or about which it swings [m].
        runs: The scene as it ships, and then his coarser runs.
        moments: Times of which the thesis says how much still moves [s].
        lattices: Corner of the lattice of each fluid [m], with walls that keep fluid half a spacing off.
    """

    title: str
    section: str
    top: float
    level: float
    runs: tuple[HisRun, ...]
    moments: tuple[float, ...] = ()
    lattices: tuple[tuple[float, float], ...] = field(default=((0.0, 0.0),))

    def settings(self) -> tuple[tuple[str, ...], ...]:
        """The settings of a series: the scene as it ships, and his coarser runs until well after they diverge."""
        return ((), *((*self.at(run), f"run.end_time={1.25 * run.diverges}") for run in self.runs[1:]))

    def at(self, run: HisRun) -> tuple[str, ...]:
        """What makes the scene that run: particles stand on the walls, from the lower left corner on."""
        corner = f"[{-0.5 * run.spacing}, {-0.5 * run.spacing}]"
        origins = (f"fluids[{i}].lattice.origin={corner}" for i, _ in enumerate(self.lattices))
        return f"spacing={run.spacing}", *origins

    def ours(self) -> tuple[str, ...]:
        """What makes it a scene of our own scheme, as coarse as his coarsest; all else as it is by default."""
        speed = 10.0 * math.sqrt(2.0 * GRAVITY * self.top)
        own = [f"fluids[{i}].lattice.origin=[{x}, {z}]" for i, (x, z) in enumerate(self.lattices)]
        own += [f"fluids[{i}].clearance=0.5" for i, _ in enumerate(self.lattices)]
        coarsest = max(run.spacing for run in self.runs)
        scheme = ("scheme=weakly_compressible", "run.time_step=null", f"materials.water.sound_speed={speed:.4g}")
        return *scheme, f"spacing={coarsest}", *own


STUDIES: Mapping[str, Study] = {
    "tank": Study("water in a tank finds its rest", "4.9", 0.3, 0.3, (HisRun(0.0099999925, 1581),), (0.8,)),
    "box": Study("a square of water collapses", "4.2", 0.5, 0.25, (HisRun(0.0169230769, 900),), (3.0, 5.5)),
    "column": Study(
        "a column of water collapses", "4.2.1", 0.7, 0.28, (HisRun(0.0076923077, 4732), HisRun(0.0176923077, 920, 2.0))
    ),
    "drop": Study("a drop falls on the ground", "4.3", 0.55, 0.196, (HisRun(0.0176923077, 628),), (2.0, 4.0)),
    "pool": Study(
        "a drop falls into a pool",
        "4.4",
        1.0,
        0.363,
        (HisRun(0.0076923077, 12254), HisRun(0.0176923077, 2339, 2.0)),
        (1.9,),
        ((0.0, 0.0), (0.0, 0.0)),
    ),
    "collision": Study(
        "two columns collapse and collide",
        "4.5",
        0.9,
        0.36,
        (
            HisRun(0.0084615385, 10165),
            HisRun(0.0146153846, 3410, 1.5),
            HisRun(0.0130769231, 4209, 1.8),
            HisRun(0.0099999925, 7371, 4.3),
        ),
        (),
        ((0.0, 0.0), (2.0, 0.0)),
    ),
}


def measure(name: str) -> Callable[[Sequence[Run], Path], list[Result]]:
    """What measures the runs of a study by his scheme."""
    return partial(_measure_study, STUDIES[name])


def measure_ours(name: str) -> Callable[[Sequence[Run], Path], list[Result]]:
    """What measures the run of a study by our own scheme."""
    return partial(_measure_ours, name)


def _measure_study(study: Study, runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: N exact; stable or not as printed, when within 20 %; density 4 %; level 2 dx; momentum 1e-6.

    The mechanical energy of water in a box can but fall. A run diverges from when its mechanical energy is least, if it
    has risen again by its end.
    """
    results = []
    for his, run in zip(study.runs, runs, strict=True):
        n, source = f"N = {his.count}", f"{SOURCE}, {study.section}"
        simulation = run.simulation
        results.append(against(f"particles, {n}", "", simulation.model.particle_count, his.count, 0.0, source))
        time, energy, kinetic = _energies(run)
        rise = float(energy[-1] - energy.min()) / energy[0]
        if his.diverges is None:
            results.append(at_most(f"mechanical energy above its least at the end, {n}", "", rise, SLACK, source))
            results += _rest(study, his, run)
            for moment in study.moments:
                moves = float(np.interp(moment, time, kinetic)) / energy[0]
                results.append(
                    Result(f"kinetic energy over all at the start, {moment} s", "", moves, None, source=source)
                )
        else:
            what = f"mechanical energy has risen again, {n}"
            results.append(
                Result(what, "", rise, None, None, None, SLACK, bool(rise > SLACK), f"{source}: it diverges")
            )
            since = float(time[energy.argmin()])
            results.append(against(f"it is least at, {n}", "s", since, his.diverges, 0.2, source))
        results.append(at_most(f"momentum less impulses, over that of gravity, {n}", "", _unbalanced(run), 1e-6, ""))
    if study.section == "4.3":
        results.append(at_most("fall of the centre of mass against g t^2 / 2", "", _fall(runs[0]), 1e-4, "Galilei"))
    return results


def _energies(run: Run) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], mechanical and kinetic energy [J/m] of a run."""
    record = read_record(run.folder / "energy.csv")
    kinetic = record["kinetic [J/m]"]
    return record["time [s]"], kinetic + record["potential [J/m]"], kinetic


def _rest(study: Study, his: HisRun, run: Run) -> list[Result]:
    """Density and level at the end of a run that does not diverge."""
    source = f"{SOURCE}, {study.section}"
    density = run.simulation.state.density.numpy() / 1000.0
    time, level = read_record(run.folder / "gauges" / "middle.csv").values()
    late = float(level[time > time[-1] - 0.5].mean())
    off = abs(late - study.level) / his.spacing
    return [
        at_most(
            f"density, farthest off at the end, N = {his.count}", "", float(np.abs(density - 1.0).max()), 0.04, source
        ),
        at_most(f"level {late:.4f} m off {study.level:g} m, over dx, N = {his.count}", "", off, 2.0, "mass"),
    ]


def _unbalanced(run: Run) -> float:
    """Momentum at the end less what walls and gravity gave, over what gravity gave."""
    simulation, step = run.simulation, run.scene.run.time_step
    mass = simulation.model.parameters.mass.numpy()[0]
    state: Any = simulation.state  # its scheme has given it more arrays
    momentum = float(mass) * state.half_velocity.numpy().astype(float).sum(axis=0)
    weight = float(mass) * simulation.model.particle_count * run.scene.gravity
    given = state.wall_impulse.numpy().sum(axis=0) - [0.0, 0.0, weight * (simulation.time - 0.5 * step)]
    return float(np.abs(momentum - given).max()) / (weight * simulation.time)


def _fall(run: Run) -> float:
    """How far the centre of mass is off a free fall, over the fall, until walls have done any work."""
    record = read_record(run.folder / "fluids" / "drop.csv")
    time, z = record["time [s]"], record["z [m]"]
    flies = (read_record(run.folder / "energy.csv")["wall work [J/m]"] == 0.0) & (time > 0.0)
    fallen = 0.5 * run.scene.gravity * time[flies] ** 2
    return float(np.abs((z[0] - z[flies]) / fallen - 1.0).max())


def _measure_ours(name: str, runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: mechanical energy does not rise again; density 1 % at the end; front of the square of water 5 %."""
    (run,) = runs
    _, energy, _ = _energies(run)
    rise = float(energy[-1] - energy.min()) / energy[0]
    density = run.simulation.state.density.numpy() / 1000.0
    time, level = read_record(run.folder / "gauges" / "middle.csv").values()
    results = [
        at_most("mechanical energy above its least at the end", "", rise, SLACK, ""),
        at_most("density, farthest off at the end", "", float(np.abs(density - 1.0).max()), 0.01, ""),
        Result("level, mean of the last second", "m", float(level[time > time[-1] - 1.0].mean()), STUDIES[name].level),
    ]
    if name == "box":
        water = read_record(run.folder / "fluids" / "water.csv")
        T, Z = water["time [s]"] * math.sqrt(run.scene.gravity / 0.5), water["front [m]"] / 0.5
        until = int(np.argmax(Z > 1.9)) or len(Z)  # the wall stands at 2
        shift, error, raw = front_error(T[:until], Z[:until], "n2eq1", "A", float(Z[until - 1]))
        results.append(at_most(f"front, rms of Z, T shifted by {shift:+.2f}", "", error, 0.05, "Martin & Moyce (1952)"))
        results.append(Result("the same without a shift", "", raw, None, source="Martin & Moyce (1952)"))
    return results
