"""What a lattice under pressure makes of the water: `python tools/bench/lattices.py [--kernel quintic_spline]`.

Particles of a lattice with volumes V under an even pressure p are displaced by xi cos(k . x). Pairs push by
2 p V^2 grad W, and sound holds compression back, so that to first order

    m xi'' = -(2 p V^2 sum_j Hess W(x_j) (1 - cos k . x_j) + m c^2 g g^T) xi,    g = V sum_j grad W(x_j) sin k . x_j

Where the matrix has an eigenvalue below 0 for any k, rows slide along each other at a rate that grows as
sqrt(-eigenvalue). Printed is that rate over sqrt(p / rho) / dx, the fastest of all k; 0 where the lattice stands.

A lattice that stands resists: pairs push as if a volume had the energy p sum_j V W_ij, which goes with the square of a
strain. Printed are two moduli over p, of rows that are slid along each other and of a square that is drawn out to a
rectangle, as waves draw it: water has none.
"""

import argparse
import itertools
import math
import sys
from collections.abc import Sequence

import numpy as np

from warpsph.kernels.smoothing import SMOOTHING

STEP = 5e-3  # of the difference that stands for the second derivative of W, in spacings
STRAIN = 1e-3
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


def moduli(kernel: str, ratio: float, basis: np.ndarray) -> tuple[float, float]:
    """Elastic moduli over p for h = `ratio` dx: of sliding rows, and of a square that is drawn out."""
    smoothing, dimensions = SMOOTHING[kernel], len(basis)
    most = 2 * math.ceil(smoothing.support * ratio) + 1
    points = np.array([k for k in itertools.product(range(-most, most + 1), repeat=dimensions) if any(k)]) @ basis
    slope = np.vectorize(lambda r: float(smoothing.slope(float(r) / ratio)))
    norm = smoothing.normalisation[dimensions] / ratio ** (dimensions + 2)

    def stress(way: np.ndarray, strain: float) -> float:
        along = np.diag(way)  # the exponential of either way, so that volume stays
        F = np.diag(np.exp(strain * along)) + strain * (way - np.diag(along))
        x = points @ F.T
        return norm * float(np.sum(slope(np.linalg.norm(x, axis=1)) * np.sum(x * (points @ (way @ F).T), axis=1)))

    slid, drawn = np.zeros((dimensions, dimensions)), np.zeros((dimensions, dimensions))
    slid[0, -1], drawn[0, 0], drawn[-1, -1] = 1.0, 0.5, -0.5
    found = ((stress(way, STRAIN) - stress(way, -STRAIN)) / (2.0 * STRAIN) for way in (slid, drawn))
    return tuple(found)


def main(arguments: Sequence[str] | None = None) -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kernel", choices=SMOOTHING, default="wendland_c2")
    parser.add_argument("--ratios", type=float, nargs="+", default=[1.2, 1.3, 1.4, 1.42, 1.5, 1.6, 1.8, 1.9, 2.0])
    options = parser.parse_args(arguments)
    print("| h/dx | " + " | ".join(LATTICES) + " |\n|---|" + "---|" * len(LATTICES))
    for ratio in options.ratios:
        told = []
        for basis in LATTICES.values():
            slid, drawn = moduli(options.kernel, ratio, basis)
            told.append(f"{fastest_rate(options.kernel, ratio, basis):.2f}; {slid:+.3f}, {drawn:+.3f}")
        print(f"| {ratio:g} | " + " | ".join(told) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
