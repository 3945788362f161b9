"""Rigid bodies in water: momentum, Archimedes and the heave."""

import math

import numpy as np

from warpsph.geometry import behind_walls
from warpsph.records import read_record
from warpsph.run import Run
from warpsph.simulation import Simulation
from warpsph.validation.analytic import floating_draft, heave_added_mass, heave_added_mass_in_tank
from warpsph.validation.result import Result, against, at_most


def measure_sinking_disc(run: Run) -> list[Result]:
    """Bar: momentum of fluid and body changes by gravity and walls alone, to 1e-5 of the impulse exchanged.

    The scene is run again, and stopped after each step to take down what walls do to the fluid (their push and that of
    the body less its reaction) and to the body (contact).
    """
    simulation = Simulation(run.scene, str(run.simulation.launcher.device), run.simulation.launcher.threads)
    simulation.reach(0.0)
    state, bodies = simulation.state, simulation.bodies.set
    fluid_mass = simulation.model.parameters.mass.numpy().astype(float)
    body_mass = np.array([body.mass.mass for body in bodies.bodies])

    def momentum() -> tuple[np.ndarray, float]:
        mass = fluid_mass[state.fluid.numpy()]
        return mass @ state.velocity.numpy() + body_mass @ bodies.velocity.numpy()[1:], mass.sum() + body_mass.sum()

    (before, mass), outside, exchanged, worst = momentum(), np.zeros(3), 0.0, 0.0
    gravity = np.array([0.0, 0.0, -run.scene.gravity]) * mass
    end = min(run.simulation.time, run.scene.run.end_time)
    simulation.step.aim_at(end)
    while simulation.time < end:
        began = simulation.time
        simulation.step.run(1)
        dt = simulation.time - began
        push = fluid_mass[state.fluid.numpy()] @ state.wall_acceleration.numpy().astype(float)
        on_points = bodies.point_force.numpy().astype(float).sum(axis=0)
        outside += dt * (push + on_points + gravity) + bodies.received.numpy()[1:].sum(axis=0)
        exchanged += dt * float(np.linalg.norm(on_points))
        worst = max(worst, float(np.abs(momentum()[0] - before - outside).max()) / max(exchanged, 1e-3))
    position = run.simulation.state.snapshot().position
    inside = int(run.simulation.bodies.holds(position).sum())
    return [
        at_most("error of the momentum over the impulse exchanged", "", worst, 1e-5, "Vasco (2014) eq 113-114"),
        at_most("particles in the disc", "", inside, 0, "no leak"),
        at_most(
            "particles behind a wall", "", int(behind_walls(run.simulation.placement, position).sum()), 0, "no leak"
        ),
    ]


def measure_floating_box(run: Run) -> list[Result]:
    """Bars: draft by Archimedes within dx / 2 at rest, period of the heave within 5 %, upright within a degree."""
    scene, body = run.scene, run.simulation.bodies.set.bodies[0]
    density = scene.materials[scene.fluids[0].material].density
    low, high = body.outline.polygon().min(axis=0), body.outline.polygon().max(axis=0)
    beam = float(high[0] - low[0])
    bottom = float(body.mass.centre[2] - low[1])  # below the centre
    draft = floating_draft(mass=body.mass.mass, waterplane=beam, density=density)
    record = read_record(run.folder / "bodies" / f"{body.name}.csv")
    time, z = record["time [s]"], record["z [m]"]
    late = time > time[-1] - 2.0
    levels = [read_record(run.folder / "gauges" / f"{gauge.name}.csv")["level [m]"][late] for gauge in scene.gauges]
    measured = float(np.mean(levels)) - (float(z[late].mean()) - bottom)
    added = heave_added_mass(beam=beam, draft=draft, density=density)
    period = 2.0 * math.pi * math.sqrt((body.mass.mass + added) / (density * scene.gravity * beam))
    # From the first crossing of the place of rest to the second: half a period.
    off = z - z[late].mean()
    k = np.flatnonzero(np.diff(np.sign(off)))[:2]
    first, second = time[k] - off[k] * (time[k + 1] - time[k]) / (off[k + 1] - off[k])
    tilt = float(np.abs(record["angle [deg]"][late]).max())
    position = run.simulation.state.snapshot().position
    return [
        at_most("error of the draft over dx", "", abs(measured - draft) / scene.spacing, 0.5, "Archimedes"),
        against("draft", "m", measured, draft, 0.05, "Archimedes"),
        against("period of the heave", "s", 2.0 * (second - first), period, 0.05, "added mass at high frequency"),
        at_most("tilt at the end", "deg", tilt, 1.0, "stable: metacentre above the centre"),
        at_most("particles in the box", "", int(run.simulation.bodies.holds(position).sum()), 0, "no leak"),
    ]


def measure_floating_box_3d(run: Run) -> list[Result]:
    """Bars as of `measure_floating_box`; at rest is the mean of the last period."""
    scene, body = run.scene, run.simulation.bodies.set.bodies[0]
    density, tank = scene.materials[scene.fluids[0].material].density, scene.walls[0].box
    low, high = body.mesh.vertices.min(axis=0), body.mesh.vertices.max(axis=0)
    beam, bottom = float(high[0] - low[0]), float(body.mass.centre[2] - low[2])
    draft = floating_draft(mass=body.mass.mass, waterplane=beam**2, density=density)
    sizes = {"width": tank.max[0] - tank.min[0], "depth": scene.fluids[0].fill.level - tank.min[2], "beam": beam}
    added = heave_added_mass_in_tank(**sizes, draft=draft, density=density)
    period = 2.0 * math.pi * math.sqrt((body.mass.mass + added) / (density * scene.gravity * beam**2))
    record = read_record(run.folder / "bodies" / f"{body.name}.csv")
    time, z = record["time [s]"], record["z [m]"]
    late = time > time[-1] - period
    levels = [read_record(run.folder / "gauges" / f"{gauge.name}.csv")["level [m]"][late] for gauge in scene.gauges]
    measured = float(np.mean(levels)) - (float(z[late].mean()) - bottom)
    off = z - z[late].mean()
    k = np.flatnonzero(np.diff(np.sign(off)))[:2]
    first, second = time[k] - off[k] * (time[k + 1] - time[k]) / (off[k + 1] - off[k])
    upright = 1.0 - 2.0 * (record["qx"] ** 2 + record["qy"] ** 2)  # of the box's own z along z
    tilt = math.degrees(math.acos(min(float(upright[late].min()), 1.0)))
    position = run.simulation.state.snapshot().position
    return [
        at_most("error of the draft over dx", "", abs(measured - draft) / scene.spacing, 0.5, "Archimedes"),
        Result("draft", "m", measured, draft, abs(measured - draft) / draft, source="Archimedes"),
        against("period of the heave", "s", 2.0 * (second - first), period, 0.05, "added mass at high frequency"),
        at_most("tilt at the end", "deg", tilt, 1.0, "stable: metacentre above the centre"),
        at_most("particles in the box", "", int(run.simulation.bodies.holds(position).sum()), 0, "no leak"),
    ]
