"""Viscous and viscoplastic flow held against exact solutions (Vasco 2014, chapter 6 and appendix B)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import warp as wp

from warpsph.kernels.corrections import density_filter_kernel
from warpsph.output.plots import LINE_PALETTE, new_plots
from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.theory import analytic
from warpsph.theory.long_wave import long_wave_fronts
from warpsph.validation.result import Result, against, at_most

# Particles along the channels, which are periodic there.
COLUMNS = 20
JITTER = "fluids[0].jitter=0.1"
# An error may grow by this much where particles start off their lattice.
JITTER_BAR = 1.5


def layer(rows: int, height: float, along: int) -> tuple[str, ...]:
    """Settings for a layer `height` [m] high of so many rows of particles; `along` counts its periodic image."""
    dx = height / rows
    length = COLUMNS * dx
    return (
        f"spacing={dx:.15g}",
        f"images[{along}].periodic.end=[{length:.15g}, 0.0]",
        f"fluids[0].shape.box.max=[{length:.15g}, {height:g}]",
    )


@dataclass(frozen=True)
class Profile:
    """Velocity along the flow in a finished run.

    Attributes:
        z: Height of each particle [m], shape [n].
        u: Its velocity along the flow [m/s], shape [n].
        exact: That of the exact solution there and then [m/s], shape [n].
    """

    z: np.ndarray
    u: np.ndarray
    exact: np.ndarray

    @property
    def error(self) -> float:
        """Root mean square of the error over the root mean square of the exact velocity."""
        return float(np.sqrt(np.mean((self.u - self.exact) ** 2) / np.mean(self.exact**2)))

    @property
    def peak(self) -> float:
        """Relative error of the greatest velocity; the exact one is taken at the particles."""
        return float(self.u.max() / self.exact.max() - 1.0)


def profile_of(run: Run, exact: Callable[..., np.ndarray]) -> Profile:
    """The profile at the end of a run beside `exact(z, t)` [m/s]."""
    snapshot = run.simulation.state.snapshot()
    z = snapshot.position[:, 2]
    return Profile(z, snapshot.velocity[:, 0].astype(float), exact(z, snapshot.time))


def draw_profiles(
    profiles: Mapping[str, Profile],
    out: Path,
    across: str = "velocity along the flow [m/s]; lines: theory",
    up: str = "z [m]",
) -> None:
    """Draw particles over the lines of theory, against height, to the PNG `out`."""
    figure, (axes,) = new_plots(1)
    for i, (label, profile) in enumerate(profiles.items()):
        color, order = LINE_PALETTE[i % len(LINE_PALETTE)], np.argsort(profile.z)
        axes.plot(profile.exact[order], profile.z[order], color=color, linewidth=1.2)
        axes.plot(profile.u, profile.z, ".", color=color, markersize=3.0, label=label)
    axes.set(xlabel=across, ylabel=up)
    axes.legend(frameon=False)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out, format="png")


def _viscosity_of(run: Run) -> float:
    """Kinematic viscosity of the first material [m2/s]."""
    material = next(iter(run.scene.materials.values()))
    return material.dynamic_viscosity / material.density


def _jittered(quantity: str, ordered: float, jittered: float) -> Result:
    """How much more the error is where particles start off their lattice."""
    return at_most(f"{quantity}, jittered over ordered", "", jittered / ordered, JITTER_BAR, "own measure")


# ------------------------------------------------------------------------------------------------------ periodic shear


SHEAR: tuple[tuple[str, ...], ...] = (
    (),
    (JITTER,),
    ("materials.water.dynamic_viscosity=0.0", "shifting.velocity=own"),
)


def measure_periodic_shear(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: largest error of u 2 % of U, viscosity 1 %; without viscosity 1 % of the kinetic energy."""
    wave, source = runs[0].scene.fluids[0].shear_wave, "exact decay"
    about = {"speed": wave.speed, "wavelength": wave.wavelength, "viscosity": _viscosity_of(runs[0])}
    names = ("ordered", "jittered")
    profiles = {
        name: profile_of(run, partial(analytic.periodic_shear, **about)) for name, run in zip(names, runs, strict=False)
    }
    draw_profiles(profiles, folder / "profiles.png")
    k, results, largest = 2.0 * np.pi / wave.wavelength, [], []
    for name, profile in profiles.items():
        amplitude = 2.0 * np.mean(profile.u * np.sin(k * profile.z))
        viscosity = -np.log(amplitude / wave.speed) / (k**2 * runs[0].scene.run.end_time)
        largest.append(float(np.abs(profile.u - profile.exact).max() / wave.speed))
        results += [
            at_most(f"largest error of u over U, {name}", "", largest[-1], 0.02, source),
            against(f"viscosity measured, {name}", "m2/s", viscosity, about["viscosity"], 0.01, source),
        ]
    record = read_record(runs[2].folder / "energy.csv")
    kinetic = next(record[name] for name in record if name.startswith("kinetic"))
    lost = 1.0 - kinetic[-1] / kinetic[0]
    return [
        *results,
        _jittered("largest error of u", *largest),
        at_most("kinetic energy lost without viscosity", "", lost, 0.01, "inviscid"),
    ]


# ---------------------------------------------------------------------------------------------------- layers, channels

ROWS, RULES = (25, 35, 50), ("takeda", "no_slip_wall")
FREE_SURFACE: tuple[tuple[str, ...], ...] = (
    *(layer(rows, 0.6, 1) for rows in ROWS),
    (*layer(ROWS[0], 0.6, 1), JITTER),
    *((*layer(ROWS[0], 0.6, 1), f"images[0].mirror.velocity_rule={rule}") for rule in RULES),
)


def measure_free_surface(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: greatest velocity 2 % with 25 rows and 1.5 % with 50; order 1.8; the rules of velocity are compared."""
    about = {"depth": 0.6, "acceleration": runs[0].scene.body_force[0], "viscosity": _viscosity_of(runs[0])}
    profiles = [profile_of(run, partial(analytic.poiseuille_free_surface, **about)) for run in runs]
    ordered = dict(zip(ROWS, profiles, strict=False))
    draw_profiles({f"{rows} rows": profile for rows, profile in ordered.items()}, folder / "profiles.png")
    theory, thesis = "Vasco (2014) eq 101", {25: 0.02, 50: 0.015}
    bars = {25: 0.02, 35: 0.02, 50: 0.015}
    peaks = {rows: profile.u.max() for rows, profile in ordered.items()}
    exact = {rows: profile.exact.max() for rows, profile in ordered.items()}
    return [
        *(
            against(
                f"greatest velocity, {rows} rows", "m/s", peaks[rows], exact[rows], bars[rows], theory, thesis.get(rows)
            )
            for rows in ROWS
        ),
        *(at_most(f"L2 error of the profile, {rows} rows", "", ordered[rows].error, 0.02, theory) for rows in ROWS),
        _order(ROWS, [ordered[rows].peak for rows in ROWS]),
        _jittered("L2 error", profiles[0].error, profiles[3].error),
        *(
            Result(f"L2 error, 25 rows, {rule}", "", profile.error, None, source="compared")
            for rule, profile in zip(RULES, profiles[4:], strict=True)
        ),
    ]


def _order(rows: Sequence[int], errors: Sequence[float]) -> Result:
    """Order of convergence by three resolutions: what does not depend on them, compression for one, drops out."""
    wanted = (errors[0] - errors[1]) / (errors[1] - errors[2])
    orders = np.linspace(0.2, 5.0, 4801)
    powers = [np.array(float(n)) ** -orders for n in rows]
    order = float(orders[np.abs((powers[0] - powers[1]) / (powers[1] - powers[2]) - wanted).argmin()])
    return Result("order of convergence", "", order, None, bar=1.8, passed=order >= 1.8, source="at least 1.8")


PLANE_TIMES, COUETTE_TIMES = (0.01, 0.02, 0.05, 0.1, 0.15), (0.01, 0.02, 0.03, 0.04)


def until(times: Sequence[float]) -> tuple[tuple[str, ...], ...]:
    """Settings of a run to each of `times` [s], and one more to the last, jittered."""
    ends = [(f"run.end_time={time:g}",) for time in times]
    return (*ends, (*ends[-1], JITTER))


def measure_plane_poiseuille(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bar: L2 error 2 % at every time."""
    about = {"height": 0.6, "acceleration": runs[0].scene.body_force[0], "viscosity": _viscosity_of(runs[0])}
    return _transient(
        runs, folder, PLANE_TIMES, partial(analytic.poiseuille, **about), "Vasco (2014) eq 102, corrected"
    )


def measure_couette(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bar: L2 error 2 % at every time."""
    speed = next(image.mirror.velocity[0] for image in runs[0].scene.images if image.mirror and image.mirror.velocity)
    about = {"height": 0.6, "speed": speed, "viscosity": _viscosity_of(runs[0])}
    return _transient(runs, folder, COUETTE_TIMES, partial(analytic.couette, **about), "Vasco (2014) eq 103")


def _transient(
    runs: Sequence[Run], folder: Path, times: Sequence[float], exact: Callable[..., np.ndarray], theory: str
) -> list[Result]:
    profiles = [profile_of(run, exact) for run in runs]
    draw_profiles(
        {f"t = {time:g} s": each for time, each in zip(times, profiles, strict=False)}, folder / "profiles.png"
    )
    return [
        *(
            at_most(f"L2 error of the profile, t = {time:g} s", "", profile.error, 0.02, theory)
            for time, profile in zip(times, profiles, strict=False)
        ),
        _jittered("L2 error", profiles[-2].error, profiles[-1].error),
    ]


# --------------------------------------------------------------------------------------------------------- viscoplastic

# Yield stress [Pa], consistency [Pa s^N], exponent, viscosity_max over consistency.
MUDS = (
    *((0.0, 1000.0, 1.0, 1.0), (500.0, 1000.0, 1.0, 100.0), (500.0, 1000.0, 0.5, 100.0)),
    *((0.0, 1000.0, 0.5, 100.0), (0.0, 1000.0, 1.5, 100.0)),
)
STIFFER = ((500.0, 1000.0, 1.0, 1000.0), (500.0, 1000.0, 1.0, 10000.0))


def _mud(yield_stress: float, consistency: float, exponent: float, stiffness: float) -> str:
    law = "herschel_bulkley" if yield_stress else "newtonian" if exponent == 1.0 else "power_law"
    numbers = {"law": law, "consistency": consistency}
    if law != "newtonian":
        numbers |= {"exponent": exponent, "viscosity_max": stiffness * consistency}
    if yield_stress:
        numbers |= {"yield_stress": yield_stress}
    return f"materials.mud.rheology={{{', '.join(f'{name}: {value}' for name, value in numbers.items())}}}"


HERSCHEL_BULKLEY: tuple[tuple[str, ...], ...] = (
    *((_mud(*mud),) for mud in MUDS),
    (_mud(*MUDS[1]), JITTER),
    *((_mud(*mud),) for mud in STIFFER),
)


def measure_herschel_bulkley(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: L2 error of the steady profile 3 %, edge of the plug within dx, flow rate steady over 3 viscous times."""
    scene = runs[0].scene
    about = {"depth": 0.6, "acceleration": scene.body_force[0], "density": scene.materials["mud"].density}
    source, profiles, results = "Coussot (1994)", {}, []
    kept = 3.0 * about["depth"] ** 2 * about["density"] / MUDS[0][1]
    for (tau, K, N, stiffness), run in zip((*MUDS, MUDS[1], *STIFFER), runs, strict=True):
        numbers = {"consistency": K, "exponent": N, "yield_stress": tau}
        profile = profile_of(run, lambda z, t, n=numbers: analytic.herschel_bulkley_free_surface(z, **about, **n))
        words = f"tau_y {tau:g}, N {N:g}, mu_max {stiffness:g} K"
        words += ", jittered" if scene.fluids[0].jitter < run.scene.fluids[0].jitter else ""
        profiles[words] = profile
        results.append(at_most(f"L2 error of the profile, {words}", "", profile.error, 0.03, source))
        record = read_record(run.folder / "fluids" / "mud.csv")
        late = record["u [m/s]"][record["time [s]"] > run.scene.run.end_time - kept]
        results.append(at_most(f"change of the flow rate, {words}", "", np.ptp(late) / late.mean(), 0.01, "steady"))
        if tau:
            expected = about["depth"] - analytic.plug_thickness(
                depth=0.6, acceleration=about["acceleration"], density=about["density"], yield_stress=tau
            )
            off = abs(_plug_edge(run) - expected) / scene.spacing
            results.append(at_most(f"edge of the plug off by, {words}", "dx", off, 1.0, source))
    draw_profiles(dict(list(profiles.items())[: len(MUDS)]), folder / "profiles.png")
    bingham = [profiles[f"tau_y 500, N 1, mu_max {stiffness:g} K"].error for stiffness in (100, 1000, 10000)]
    _draw_stiffness((100, 1000, 10000), bingham, folder / "viscosity_max.png")
    results.append(
        _jittered(
            "L2 error",
            profiles["tau_y 500, N 1, mu_max 100 K"].error,
            profiles["tau_y 500, N 1, mu_max 100 K, jittered"].error,
        )
    )
    return results


def _plug_edge(run: Run) -> float:
    """Height between the highest row that yields and the lowest one above it that does not [m]."""
    state = run.simulation.state
    z, yielded = state.position.numpy()[:, 2], state.yielded.numpy() > 0
    if not yielded.any():
        return 0.0
    top = z[yielded].max()
    above = z[~yielded & (z > top)]
    return float(0.5 * (top + above.min())) if len(above) else float(top)


def _draw_stiffness(ratios: Sequence[float], errors: Sequence[float], out: Path) -> None:
    figure, (axes,) = new_plots(1)
    axes.loglog(ratios, errors, "o-", color=LINE_PALETTE[0], linewidth=1.4)
    axes.set(xlabel="viscosity_max over consistency", ylabel="L2 error of the profile")
    figure.savefig(out, format="png")


def measure_bingham_plane(run: Run) -> list[Result]:
    """Bars: L2 error of the steady profile 3 %, edges of the plug within dx."""
    material = run.scene.materials["mud"]
    numbers = {
        "height": 0.6,
        "acceleration": run.scene.body_force[0],
        "density": material.density,
        "viscosity": material.rheology.consistency,
        "yield_stress": material.rheology.yield_stress,
    }
    profile = profile_of(run, lambda z, t: analytic.bingham_poiseuille(z, **numbers))
    draw_profiles({"Bingham": profile}, run.folder / "profiles.png")
    state = run.simulation.state
    z, plug = state.position.numpy()[:, 2], state.yielded.numpy() == 0
    half = numbers["yield_stress"] / (numbers["density"] * numbers["acceleration"])
    edges = np.array([z[plug].min(), z[plug].max()]) + run.scene.spacing * np.array([-0.5, 0.5])
    off = np.abs(edges - (0.3 + half * np.array([-1.0, 1.0]))).max() / run.scene.spacing
    source = "Bird, Dai & Yarusso (1983)"
    return [
        at_most("L2 error of the profile", "", profile.error, 0.03, source),
        at_most("edges of the plug off by", "dx", off, 1.0, source),
    ]


# ----------------------------------------------------------------------------------------------------------- dam breaks

# Name, density [kg/m3], viscosity [Pa s], depth [m].
SYRUPS = (
    *(("glucose", 1285.0, 0.205, 0.07), ("glucose", 1285.0, 0.205, 0.10)),
    *(("glycerol", 1262.0, 0.86, 0.08), ("glycerol", 1262.0, 0.86, 0.10), ("glycerol", 1262.0, 0.86, 0.12)),
)
DAM_ROWS = 35


def _dam(density: float, viscosity: float, depth: float, rows: int) -> tuple[str, ...]:
    c = 20.0 * np.sqrt(9.81 * depth)
    return (
        f"spacing={depth / rows:.15g}",
        f"fluids[0].shape.box.max=[0.5, {depth:g}]",
        f"materials.syrup.density={density}",
        f"materials.syrup.dynamic_viscosity={viscosity}",
        f"materials.syrup.sound_speed={c:.4g}",
    )


DAM_BREAKS: tuple[tuple[str, ...], ...] = (
    *(_dam(*syrup[1:], DAM_ROWS) for syrup in SYRUPS),
    (*_dam(*SYRUPS[0][1:], 2 * DAM_ROWS), "run.end_time=1.0"),  # eight times the work
    (*_dam(*SYRUPS[0][1:], DAM_ROWS), JITTER),
)


def measure_dam_breaks(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: front below Ritter's at all times, 2 % from 35 to 70 rows, 5 % off long-wave theory from 0.5 s on.

    Huppert's law, which has no inertia, is told beside: at these times the fronts of long waves are still not its own.
    """
    results, fronts, offs = [], [], []
    figure, (axes,) = new_plots(1)
    syrups = (*SYRUPS, SYRUPS[0], SYRUPS[0])
    for i, ((name, density, viscosity, depth), run) in enumerate(zip(syrups, runs, strict=True)):
        record = read_record(run.folder / "fluids" / "syrup.csv")
        time, front = record["time [s]"], record["front [m]"] + 0.5 * run.scene.spacing
        fronts.append((time, front))
        words = f"{name}, {depth:g} m, {round(depth / run.scene.spacing)} rows"
        words += ", jittered" if run.scene.fluids[0].jitter else ""
        ritter = analytic.ritter_front(time, height=depth, length=0.5)
        advance = (front[1:] - front[0]) / (ritter[1:] - 0.5)
        source = "Ritter (1892)"
        results.append(at_most(f"advance of the front over Ritter's, {words}", "", float(advance.max()), 1.0, source))
        ticks = np.linspace(0.5, time[-1], 10)
        theory = long_wave_fronts(ticks, height=depth, length=0.5, viscosity=viscosity / density)
        off = float(np.abs(np.interp(ticks, time, front) / theory - 1.0).max())
        offs.append(off)
        results.append(at_most(f"front off long-wave theory, {words}", "", off, 0.05, "Shkadov (1967), with inertia"))
        late = analytic.huppert_front(time, area=0.5 * depth, viscosity=viscosity / density)
        valid = late < 0.8 * ritter
        results.append(
            Result(
                f"front over Huppert's at t = {time[-1]:g} s, {words}",
                "",
                float(front[-1] / late[-1]),
                1.0,
                float(abs(front[-1] / late[-1] - 1.0)),
                source="Huppert (1982)",
            )
        )
        color = LINE_PALETTE[i % len(LINE_PALETTE)]
        axes.plot(time, front, color=color, linewidth=1.4, label=words)
        axes.plot(ticks, theory, "o", color=color, markersize=3.0)
        axes.plot(time[valid], late[valid], "--", color=color, linewidth=1.0)
    axes.set(xlabel="t [s]", ylabel="front [m]; dots: long waves, dashed: Huppert")
    axes.legend(frameon=False, fontsize=7)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "fronts.png", format="png")
    (time, coarse), (_, fine) = fronts[0], fronts[len(SYRUPS)]
    coarse = coarse[: len(fine)]
    change = float(np.abs(fine / coarse - 1.0)[time[: len(fine)] > 0.1].max())
    return [
        *results,
        at_most("change of the front from 35 to 70 rows", "", change, 0.02, "own measure"),
        _jittered("front off long-wave theory", offs[0], offs[-1]),
    ]


def measure_arrest(run: Run) -> list[Result]:
    """Bars: toe within 5 % of the arrested profile, and the mud at rest; one particle may slip at the toe."""
    box, material = run.scene.fluids[0].shape.box, run.scene.materials["mud"]
    toe = analytic.arrested_toe(
        height=box.max[1], length=box.max[0], density=material.density, yield_stress=material.rheology.yield_stress
    )
    record = read_record(run.folder / "fluids" / "mud.csv")
    late = record["time [s]"] > 0.75 * record["time [s]"][-1]
    front, centre = record["front [m]"][late] + 0.5 * run.scene.spacing, record["x [m]"][late]
    farthest = front[np.abs(front - toe).argmax()]
    _draw_arrest(run, box.max[1], box.max[0])
    return [
        against(
            "toe in the last quarter, where it is farthest off",
            "m",
            farthest,
            toe,
            0.05,
            "Nye (1951), Liu & Mei (1989)",
        ),
        at_most("advance of the centre in the last quarter, over the toe", "", np.ptp(centre) / toe, 0.002, "arrested"),
    ]


def _draw_arrest(run: Run, height: float, length: float) -> None:
    """Draw the mud that has stopped under the line of theory, to profile.png of the run."""
    material, place = run.scene.materials["mud"], run.simulation.state.snapshot().position
    x = np.linspace(0.0, 1.1 * place[:, 0].max(), 400)
    numbers = {"density": material.density, "yield_stress": material.rheology.yield_stress}
    figure, (axes,) = new_plots(1)
    axes.plot(place[:, 0], place[:, 2], ".", color=LINE_PALETTE[0], markersize=3.0)
    axes.plot(x, analytic.arrested_depth(x, height=height, length=length, **numbers), color=LINE_PALETTE[1])
    axes.set(xlabel="x [m]; line: arrested profile", ylabel="z [m]")
    figure.savefig(run.folder / "profile.png", format="png")


# ------------------------------------------------------------------------------------------------------ interpolation

PATCH: tuple[tuple[str, ...], ...] = ((), ("fluids[0].jitter=0.25",))
# The cubic spline as Vasco (2014) eq 32 has it, whose constant makes its integral 2/3.
EQ_32 = 2.0 / 3.0


def measure_interpolation(runs: Sequence[Run], folder: Path) -> list[Result]:
    """Bars: f = x + z by moving least squares to 1e-6; the error of plain sums in the corner, 0.561 and 0.707."""
    ordered, jittered = runs
    source = "Vasco (2014) appendix B"
    corner, thesis_corner = _interpolation_error(ordered, "plain"), _interpolation_error(ordered, "plain", EQ_32)
    words = {"plain": "plain", "shepard": "Shepard", "mls": "moving least squares"}
    values = {word: _interpolated(jittered, name) for name, word in words.items()}
    drawn = {word: Profile(exact, found, exact) for word, (found, exact) in values.items()}
    draw_profiles(drawn, folder / "profiles.png", "f interpolated, jittered; line: exact", "f = x + z")
    return [
        at_most("error by moving least squares, ordered", "", _interpolation_error(ordered, "mls"), 1e-6, source),
        at_most("error by moving least squares, jittered", "", _interpolation_error(jittered, "mls"), 1e-6, source),
        against("error of plain sums in the corner", "", corner, 0.561, 0.002 / 0.561, source),
        against("the same with the constant of eq 32", "", thesis_corner, 0.707, 0.003 / 0.707, source, 0.0),
    ]


def _interpolated(run: Run, correction: str, constant: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """f = x + z interpolated by one of CORRECTION with the kernel times `constant`, and f itself, shape [n]."""
    model, state, lists = run.simulation.model, run.simulation.state, run.simulation.step.neighbours
    place = state.position_volume.numpy()[: model.particle_count].astype(float)
    exact = place[:, 0] + place[:, 2]
    device, norm = model.launcher.device, model.parameters.kernel_norm
    f = wp.array(exact, dtype=wp.float64, device=device)
    found, in_every_step = wp.zeros_like(f), {"every": 1, "step": wp.zeros(1, dtype=int, device=device)}
    model.parameters.kernel_norm = norm * constant
    kernel = density_filter_kernel(model.formulas.smoothing, correction, by_volume=False, layout=model.layout)
    fields = {"density": f, "filtered_density": found}
    model.launcher.run(kernel, model.particle_count, model, state, lists, **in_every_step, **fields)
    model.parameters.kernel_norm = norm
    return found.numpy(), exact


def _interpolation_error(run: Run, correction: str, constant: float = 1.0) -> float:
    """The largest relative error of what `_interpolated` gives."""
    found, exact = _interpolated(run, correction, constant)
    return float(np.abs(found / exact - 1.0).max())
