"""Lattices under pressure: what a kernel makes of particles in order, by sums over a lattice alone."""

import itertools
import math

import numpy as np
import pytest
from scipy.linalg import expm

from warpsph.kernels.smoothing import SMOOTHING
from warpsph.scene.schemes import KERNEL_IN_SPACE, RATIO

# Of the pressure: an elastic modulus below the first and a stiffness above the second are as good as none.
SOFT, BUCKLED = 0.012, -1.0e-3

DEFAULTS = [("wendland_c2", 2), (KERNEL_IN_SPACE, 3)]


def lattice(name: str, ratio: float, dimensions: int):
    """Neighbours x_ij [dx], and dW/dr / r of each as a function of the distances; V = 1."""
    kernel = SMOOTHING[name]
    reach = math.ceil(kernel.support * ratio)
    x = np.array([site for site in itertools.product(range(-reach, reach + 1), repeat=dimensions) if any(site)], float)
    norm = kernel.normalisation[dimensions] / ratio ** (dimensions + 2)

    def slope(r):
        return norm * np.array([float(kernel.slope(float(q))) for q in r / ratio])

    return x, slope


def moduli(name: str, ratio: float, dimensions: int) -> tuple[float, float]:
    """Shear stress over p and strain: of rows that slide, and of a square that is drawn out to a rectangle.

    Under a pressure p pairs push with -2 p V^2 grad W, as if each had the energy 2 p V^2 W: p sum_j V W_ij a volume.
    """
    x, slope = lattice(name, ratio, dimensions)
    strain = 1.0e-3

    def stress(way, strain):
        F = expm(strain * way)
        y, dy = x @ F.T, x @ (way @ F).T
        return float(np.sum(slope(np.linalg.norm(y, axis=1)) * np.sum(y * dy, axis=1)))

    slide, draw = np.zeros((dimensions, dimensions)), np.zeros((dimensions, dimensions))
    slide[0, -1] = 1.0
    draw[0, 0], draw[-1, -1] = 0.5, -0.5
    return tuple((stress(way, strain) - stress(way, -strain)) / (2 * strain) for way in (slide, draw))


def least_stiffness(name: str, ratio: float, dimensions: int) -> float:
    """Of all waves of particles that leave density alone, the least force over p and displacement."""
    x, slope = lattice(name, ratio, dimensions)
    r, step = np.linalg.norm(x, axis=1), 0.01
    s = slope(r)
    curved = (slope(r + step) - slope(r - step)) / (2 * step * r)
    H = s[:, None, None] * np.eye(dimensions) + curved[:, None, None] * x[:, :, None] * x[:, None, :]
    least = math.inf
    for wave in itertools.combinations_with_replacement(np.linspace(1.0, 0.0, 6), dimensions):
        if not any(wave):
            continue
        phase = x @ (math.pi * np.array(wave))
        D = np.sum((1.0 - np.cos(phase))[:, None, None] * H, axis=0)
        G = np.sum((np.sin(phase) * s)[:, None] * x, axis=0)  # the divergence that continuity sees is along this
        if np.linalg.norm(G) > 1e-6:
            across = np.linalg.svd(G[None, :])[2][1:]
            D = across @ D @ across.T
        least = min(least, float(np.linalg.eigvalsh(D)[0]))
    return least


@pytest.mark.parametrize(("name", "dimensions"), DEFAULTS)
def test_a_lattice_of_the_defaults_neither_resists_shear_nor_buckles(name, dimensions):
    assert max(np.abs(moduli(name, RATIO[name], dimensions))) < SOFT
    assert least_stiffness(name, RATIO[name], dimensions) > BUCKLED


def test_other_smoothing_lengths_do():
    """Wendland's kernel at 1.4 dx is an elastic body, at 1.6 dx its rows slide."""
    assert max(moduli("wendland_c2", 1.4, 2)) > 0.08
    assert least_stiffness("wendland_c2", 1.6, 2) < -0.01
