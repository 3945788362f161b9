"""How fast the rows of a lattice begin to slide under pressure: `python tools/bench/lattices.py`.

Particles of a lattice with volumes V under an even pressure p are displaced by xi cos(k . x). Pairs push by
2 p V^2 grad W, and sound holds compression back, so that to first order

    m xi'' = -(2 p V^2 sum_j Hess W(x_j) (1 - cos k . x_j) + m c^2 g g^T) xi,    g = V sum_j grad W(x_j) sin k . x_j

Where the matrix has an eigenvalue below 0 for any k, rows slide along each other at a rate that grows as
sqrt(-eigenvalue). Printed is that rate over sqrt(p / rho) / dx, the fastest of all k; 0 where the lattice stands.
"""

import argparse
import itertools
import math
import sys
from collections.abc import Sequence

import numpy as np

from warpsph.kernels.smoothing import SMOOTHING

STEP = 5e-3  # of the difference that stands for the second derivative of W, in spacings
STIFFNESS = 400.0  # c^2 over p / rho
LATTICES = {
    "square": np.eye(2),
    "hexagonal": math.sqrt(2.0 / math.sqrt(3.0)) * np.array([[1.0, 0.0], [0.5, 0.5 * math.sqrt(3.0)]]),
    "cubic": np.eye(3),
}


def fastest_rate(kernel: str, ratio: float, basis: np.ndarray) -> float:
    """The greatest rate over sqrt(p / rho) / dx, for h = `ratio` dx."""
    smoothing, dimensions = SMOOTHING[kernel], len(basis)
    norm, reach = smoothing.normalisation[dimensions] / ratio**dimensions, smoothing.support * ratio
    slope = np.vectorize(lambda r: norm / ratio**2 * r * float(smoothing.slope(float(r) / ratio)))
    most = 2 * math.ceil(reach) + 1
    points = np.array(list(itertools.product(range(-most, most + 1), repeat=dimensions))) @ basis
    r = np.linalg.norm(points, axis=1)
    points, r = points[(r > 0.0) & (r < reach)], r[(r > 0.0) & (r < reach)]
    first, second = slope(r), (slope(r + STEP) - slope(r - STEP)) / (2.0 * STEP)
    way = points / r[:, None]
    along = way[:, :, None] * way[:, None, :]
    hessian = (second - first / r)[:, None, None] * along + (first / r)[:, None, None] * np.eye(dimensions)
    waves = 2.0 * np.pi * np.linalg.inv(basis).T
    pieces = 24 if dimensions == 2 else 12
    least = 0.0
    for share in itertools.product(np.arange(-pieces // 2, pieces // 2 + 1) / pieces, repeat=dimensions):
        phase = points @ (np.array(share) @ waves)
        pushed = 2.0 * np.tensordot(1.0 - np.cos(phase), hessian, (0, 0))
        g = np.sin(phase) @ (first[:, None] * way)
        least = min(least, float(np.linalg.eigvalsh(pushed + STIFFNESS * np.outer(g, g))[0]))
    return math.sqrt(abs(min(least, 0.0)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kernel", choices=SMOOTHING, default="wendland_c2")
    parser.add_argument(
        "--ratios", type=float, nargs="+", default=[1.2, 1.3, 1.35, 1.38, 1.4, 1.42, 1.5, 1.6, 1.8, 2.0]
    )
    options = parser.parse_args(arguments)
    print("| h/dx | " + " | ".join(LATTICES) + " |\n|---|" + "---|" * len(LATTICES))
    for ratio in options.ratios:
        rates = (fastest_rate(options.kernel, ratio, basis) for basis in LATTICES.values())
        print(f"| {ratio:g} | " + " | ".join(f"{rate:.2f}" for rate in rates) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
