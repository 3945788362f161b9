"""Rigid bodies in water: momentum, Archimedes and the heave."""

import math
from collections.abc import Mapping

import numpy as np
import warp as wp

from warpsph.device.launch import Launch
from warpsph.kernels.dummies import load_dummies_kernel
from warpsph.measure.leaks import behind_walls
from warpsph.output.records import read_record
from warpsph.run import Run
from warpsph.simulation import Simulation
from warpsph.step.act import Act, Together
from warpsph.theory.analytic import floating_draft, heave_in_tank, highest
from warpsph.validation.result import Result, against, at_most


def measure_sinking_disc(run: Run) -> list[Result]:
    """Bar: momentum of fluid and body changes by gravity and walls alone, to 1e-5 of the impulse exchanged.

    The scene is run again, and stopped after each step to take down what walls do to the fluid, summed from their side
    of each pair, and to the body (contact).
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
    on_walls = wp.zeros(len(simulation.model.wall_position), dtype=wp.vec3, device=simulation.launcher.device)
    simulation.step.insert(_loads_on_walls(simulation, on_walls), after="loads on bodies")
    simulation.step.aim_at(end)
    while simulation.time < end:
        began = simulation.time
        simulation.step.run(1)
        dt = simulation.time - began
        on_points = bodies.point_force.numpy().astype(float).sum(axis=0)
        outside += dt * (gravity - on_walls.numpy().astype(float).sum(axis=0)) + bodies.received.numpy()[1:].sum(axis=0)
        exchanged += dt * float(np.linalg.norm(on_points))
        worst = max(worst, float(np.abs(momentum()[0] - before - outside).max()) / max(exchanged, 1e-3))
    position = run.simulation.state.snapshot().position
    inside = int(run.simulation.bodies.holds(position).sum())
    return [
        at_most("error of the momentum over the impulse exchanged", "", worst, 1e-5, "Vasco (2014) eq 113-114"),
        at_most("particles in the disc", "", inside, 0, "no leak"),
        at_most("particles behind a wall", "", int(behind_walls(run.simulation.model, position).sum()), 0, "no leak"),
    ]


def _loads_on_walls(simulation: Simulation, force_out: wp.array) -> Act:
    """The act that finds the force of the fluid on every dummy of a wall [N], in 2-D [N/m]."""
    model, state, dummies = simulation.model, simulation.state, simulation.step.neighbours.dummies
    kernel = load_dummies_kernel(model.scene.smoothing.kernel, model.formulas.artificial_viscosity)

    def sums() -> list[Launch]:
        lists = {"fluid_first": dummies.first, "fluid_list": dummies.list, "fluid": state.fluid_and_ghosts}
        return [model.launcher.record(kernel, len(force_out), model, state, before=0, force=force_out, **lists)]

    return Together(model.launcher, "loads on walls", sums)


def measure_floating_box(run: Run) -> list[Result]:
    """Bars: draft by Archimedes within dx / 2 at rest, period of the heave within 5 %, upright within a degree.

    In 2-D and in 3-D, in the middle of the tank that is the first wall. The period is the time from one highest place
    to the next, for which it does not matter where it comes to rest; at rest is the mean of as many whole periods as
    fill the second half of the run, or of one.
    """
    scene, body, is_flat = run.scene, run.simulation.bodies.set.bodies[0], run.scene.dimensions == 2
    density, level = scene.materials[scene.fluids[0].material].density, scene.fluids[0].fill.level
    tank = np.array(scene.walls[0].path if is_flat else [scene.walls[0].box.min, scene.walls[0].box.max])
    corners = body.outline.polygon() if is_flat else body.mesh.vertices
    low, high = corners.min(axis=0), corners.max(axis=0)
    beam, bottom = float(high[0] - low[0]), float(body.mass.centre[2] - low[-1])  # below the centre
    draft = floating_draft(mass=body.mass.mass, waterplane=beam ** (scene.dimensions - 1), density=density)
    theory = heave_in_tank(
        width=float(np.ptp(tank[:, 0])),
        depth=level - float(tank[:, -1].min()),
        beam=beam,
        draft=draft,
        density=density,
        gravity=scene.gravity,
        dimensions=scene.dimensions,
    )
    record = read_record(run.folder / "bodies" / f"{body.name}.csv")
    time, z = record["time [s]"], record["z [m]"]
    late = time > time[-1] - max(1, int(0.5 * time[-1] / theory.period)) * theory.period
    levels = [read_record(run.folder / "gauges" / f"{gauge.name}.csv")["level [m]"][late] for gauge in scene.gauges]
    measured = float(np.mean(levels)) - (float(z[late].mean()) - bottom)
    first, again = highest(time, z, theory.period)[:2]
    tilt = float(np.abs(record["angle [deg]"][late]).max()) if is_flat else _tilt(record, late)
    position = run.simulation.state.snapshot().position
    source = "potential flow in the tank, with its waves"
    return [
        at_most("error of the draft over dx", "", abs(measured - draft) / scene.spacing, 0.5, "Archimedes"),
        Result("draft", "m", measured, draft, abs(measured - draft) / draft, source="Archimedes"),
        against("period of the heave", "s", again - first, theory.period, 0.05, source),
        # No bar: particles leave their lattice at first, which takes energy and delays the first swing.
        Result(
            "first time that it is highest", "s", first, theory.first, abs(first / theory.first - 1.0), source=source
        ),
        at_most("tilt at the end", "deg", tilt, 1.0, "stable: metacentre above the centre"),
        at_most("particles in the box", "", int(run.simulation.bodies.holds(position).sum()), 0, "no leak"),
    ]


def _tilt(record: Mapping[str, np.ndarray], rows: np.ndarray) -> float:
    """Greatest angle between a body's own z and z [degrees] in `rows` of its record in 3-D."""
    upright = 1.0 - 2.0 * (record["qx"] ** 2 + record["qy"] ** 2)
    return math.degrees(math.acos(min(float(upright[rows].min()), 1.0)))
