"""The dam break of bench.py in PySPH, from a state that it is handed, timed: `bench.py --peer pysph` runs it.

    python tools/bench/peer_pysph.py CASE.npz        prints one line of JSON

It runs in whatever interpreter has PySPH (`bench.py --peer-python`), imports nothing of warpsph, and takes the number
of threads from OMP_NUM_THREADS. What is solved, all of it PySPH's own code except the step's mover: Wendland C2 with
h / dx = 1.5, Tait with exponent 7, continuity, Monaghan's momentum equation with alpha and no beta, no XSPH, no
density diffusion, no tensile correction. PySPH's default predict-evaluate-correct integrator evaluates the forces once
a step. The tank is lined with two layers of boundary particles, as in PySPH's own dam break; their density follows
continuity, with the Hughes-Graham correction that keeps them from holding the fluid back.

Wherever there is a choice the faster one is taken: fixed h, no time step to compute, no output, particles in
the order of PySPH's cells.
"""

import json
import math
import sys
import time
from collections.abc import Mapping

import numpy as np

NOT_INSTALLED = 3  # exit code

try:
    from compyle.config import get_config
    from pysph.base.kernels import WendlandQuintic
    from pysph.base.nnps import LinkedListNNPS
    from pysph.base.utils import get_particle_array_wcsph
    from pysph.solver.solver import Solver
    from pysph.sph.basic_equations import ContinuityEquation
    from pysph.sph.equation import Group
    from pysph.sph.integrator import PECIntegrator
    from pysph.sph.integrator_step import IntegratorStep
    from pysph.sph.wc.basic import MomentumEquation, TaitEOS, TaitEOSHGCorrection
except ImportError as error:
    sys.stderr.write(f"PySPH cannot be imported by {sys.executable} ({error}); pip install pysph, or --peer-python\n")
    sys.exit(NOT_INSTALLED)

LAYERS = 2  # of boundary particles


class WithoutXSPH(IntegratorStep):
    """PySPH's WCSPHStep, but particles move with their own velocity."""

    # PySPH translates these methods to C: arguments are named d_ARRAY, and there are no other names than theirs.
    def initialize(self, d_idx, d_x0, d_y0, d_x, d_y, d_u0, d_v0, d_u, d_v, d_rho0, d_rho):
        d_x0[d_idx] = d_x[d_idx]
        d_y0[d_idx] = d_y[d_idx]
        d_u0[d_idx] = d_u[d_idx]
        d_v0[d_idx] = d_v[d_idx]
        d_rho0[d_idx] = d_rho[d_idx]

    def stage1(self, d_idx, d_x0, d_y0, d_x, d_y, d_u0, d_v0, d_u, d_v, d_rho0, d_rho, d_au, d_av, d_arho, dt):
        d_x[d_idx] = d_x0[d_idx] + 0.5 * dt * d_u0[d_idx]
        d_y[d_idx] = d_y0[d_idx] + 0.5 * dt * d_v0[d_idx]
        d_u[d_idx] = d_u0[d_idx] + 0.5 * dt * d_au[d_idx]
        d_v[d_idx] = d_v0[d_idx] + 0.5 * dt * d_av[d_idx]
        d_rho[d_idx] = d_rho0[d_idx] + 0.5 * dt * d_arho[d_idx]

    def stage2(self, d_idx, d_x0, d_y0, d_x, d_y, d_u0, d_v0, d_u, d_v, d_rho0, d_rho, d_au, d_av, d_arho, dt):
        d_x[d_idx] = d_x0[d_idx] + dt * d_u[d_idx]
        d_y[d_idx] = d_y0[d_idx] + dt * d_v[d_idx]
        d_u[d_idx] = d_u0[d_idx] + dt * d_au[d_idx]
        d_v[d_idx] = d_v0[d_idx] + dt * d_av[d_idx]
        d_rho[d_idx] = d_rho0[d_idx] + dt * d_arho[d_idx]


class WallStep(IntegratorStep):
    """Boundary particles stay where they are; their density follows continuity."""

    def initialize(self, d_idx, d_rho0, d_rho):
        d_rho0[d_idx] = d_rho[d_idx]

    def stage1(self, d_idx, d_rho0, d_rho, d_arho, dt):
        d_rho[d_idx] = d_rho0[d_idx] + 0.5 * dt * d_arho[d_idx]

    def stage2(self, d_idx, d_rho0, d_rho, d_arho, dt):
        d_rho[d_idx] = d_rho0[d_idx] + dt * d_arho[d_idx]


def tank(width: float, height: float, dx: float) -> tuple[np.ndarray, np.ndarray]:
    """Boundary particles of an open tank, the first layer half a spacing behind the wall: x, z [m]."""
    across, up = round(width / dx), round(height / dx)
    i, j = np.meshgrid(np.arange(-LAYERS, across + LAYERS), np.arange(-LAYERS, up), indexing="ij")
    wall = (i < 0) | (i >= across) | (j < 0)
    return (i[wall] + 0.5) * dx, (j[wall] + 0.5) * dx


def set_up(case: Mapping[str, np.ndarray]) -> Solver:
    """A solver that is ready to step."""
    dx, density, sound = (float(case[name]) for name in ("spacing", "density", "sound_speed"))
    h = float(case["smoothing_length"])
    wall_x, wall_z = tank(*case["tank"], dx)
    common = {"m": density * dx**2, "h": h}
    fluid = get_particle_array_wcsph(
        name="fluid",
        **{to: np.array(case[of]) for of, to in zip("xzuw", "xyuv", strict=True)},
        rho=case["rho"],
        **common,
    )
    wall = get_particle_array_wcsph(name="wall", x=wall_x, y=wall_z, rho=density, **common)

    tait = {"sources": None, "rho0": density, "c0": sound, "gamma": 7.0}
    momentum = {"c0": sound, "alpha": float(case["alpha"]), "beta": 0.0, "gy": -float(case["gravity"])}
    everything = ["fluid", "wall"]
    equations = [
        Group([TaitEOS(dest="fluid", **tait), TaitEOSHGCorrection(dest="wall", **tait)], real=False),
        Group(
            [
                ContinuityEquation(dest="wall", sources=["fluid"]),
                ContinuityEquation(dest="fluid", sources=everything),
                MomentumEquation(dest="fluid", sources=everything, **momentum),
            ]
        ),
    ]
    get_config().use_openmp = True
    kernel = WendlandQuintic(dim=2)
    particles = [fluid, wall]
    nnps = LinkedListNNPS(dim=2, particles=particles, radius_scale=kernel.radius_scale, fixed_h=True)
    integrator = PECIntegrator(fluid=WithoutXSPH(), wall=WallStep())
    solver = Solver(kernel=kernel, dim=2, integrator=integrator, dt=float(case["dt"]), tf=1.0)
    solver.set_parallel_manager(None)
    solver.setup(particles, equations, nnps, fixed_h=True)
    solver.reorder_particles()
    integrator.initial_acceleration(0.0, solver.dt)
    return solver


def run(solver: Solver, steps: int) -> float:
    """Take `steps` steps as the solver does, without its output; wall seconds."""
    began = time.perf_counter()
    for _ in range(steps):
        solver.integrator.step(solver.t, solver.dt)
        solver.t += solver.dt
    return time.perf_counter() - began


def main(path: str) -> None:
    """Run the case at `path` and print its figures."""
    with np.load(path) as file:
        case = dict(file)
    solver = set_up(case)
    run(solver, int(case["warm_up"]))
    seconds = run(solver, int(case["steps"]))
    fluid = solver.particles[0]
    figures = {
        "updates per second": int(case["steps"]) * len(case["x"]) / seconds,
        "greatest speed": float(np.hypot(fluid.u, fluid.v).max()),  # [m/s]
        "compression": float(np.abs(fluid.rho / case["density"] - 1.0).max()),
    }
    if not all(map(math.isfinite, figures.values())):
        sys.exit(f"PySPH's particles went astray: {figures}")
    print(json.dumps(figures))


if __name__ == "__main__":
    main(sys.argv[1])
