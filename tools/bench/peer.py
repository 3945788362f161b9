"""The same dam break in another code: `bench.py --peer pysph`.

What makes the comparison fair:
- The peer starts from our state, on the lattice and in developed flow alike: the same particles with the same
  positions, velocities and densities, so that both do the same work. Only the tank differs: ours pushes with three
  points a spacing, the peer has its own two layers of boundary particles; neither counts them as particles moved.
- Both take some untimed steps first, compile nothing and write nothing while the clock runs, and evaluate the forces
  once a step. Each is given the number of threads.
- The peer's time step is fixed, 0.125 h / c0, as in PySPH's own dam break; what a step costs does not depend on it.
- The runs alternate, ours then theirs, and what is reported is the ratio of each pair: a machine whose speed
  drifts spoils pairs, not the comparison.
The peer never diffuses density; where ours does, it is ours that does the more work. Compare on an idle machine:
threads of OpenMP wait for each other by spinning, so the peer loses far more than ours when other programs run.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from warpsph.scene.scene import Scene
from warpsph.state import Snapshot

PROGRAM = {"pysph": Path(__file__).with_name("peer_pysph.py")}
TANK = (3.0, 1.5)  # width, height [m]
COURANT = 0.125


class PeerError(Exception):
    """The peer did not run; the text is one line for the user."""


def write_case(path: Path, scene: Scene, start: Snapshot, warm_up: int, steps: int) -> None:
    """Write what the peer needs to go on from `start`: SI units, x and z, `warm_up` untimed steps."""
    (material,) = scene.materials.values()
    np.savez(
        path,
        x=start.position[:, 0],
        z=start.position[:, 2],
        u=start.velocity[:, 0].astype(float),
        w=start.velocity[:, 2].astype(float),
        rho=start.density,
        spacing=scene.spacing,
        smoothing_length=scene.smoothing_length,
        density=material.density,
        sound_speed=material.sound_speed,
        alpha=material.alpha,
        gravity=scene.gravity,
        tank=TANK,
        dt=COURANT * scene.smoothing_length / material.sound_speed,
        warm_up=warm_up,
        steps=steps,
    )


def run_peer(name: str, python: str, case: Path, threads: int) -> float:
    """Particle-updates a second of peer `name` in the interpreter `python`.

    Raises:
        PeerError: it is not installed there, or it failed.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
    command = [python or sys.executable, str(PROGRAM[name]), str(case)]
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    except OSError as error:
        raise PeerError(f"{command[0]}: {error.strerror}") from None
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"{name} ended with exit code {done.returncode}"]
        raise PeerError(lines[-1])
    return float(json.loads(done.stdout.splitlines()[-1])["updates per second"])
