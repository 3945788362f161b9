"""Long waves of a viscous layer between their two limits: no viscosity, and nothing but viscosity."""

import numpy as np
import pytest

from warpsph.theory.analytic import huppert_front, ritter_front
from warpsph.theory.long_wave import long_wave_fronts

# Of a scheme of first order on a front that is thin where it is farthest.
TOLERANCE = 0.05


def test_without_viscosity_it_is_ritters():
    """Where the depth is 1 % of the column, which is at 1.9 of the 2 sqrt(g H) t that the front has gone."""
    times = np.array([0.1, 0.2, 0.3])
    fronts = long_wave_fronts(times, height=0.1, length=0.5, viscosity=0.0, profile=1.0, cells=4000)
    ritter = ritter_front(times, height=0.1, length=0.5)
    thick = 0.5 + (ritter - 0.5) * (1.0 - 1.5 * np.sqrt(0.01))
    np.testing.assert_allclose(fronts - 0.5, thick - 0.5, rtol=TOLERANCE)


def test_with_much_viscosity_it_is_hupperts():
    """A column that is soon much longer than it was, many viscous times later."""
    times = np.array([2.0, 3.0])
    fronts = long_wave_fronts(times, height=0.1, length=0.05, viscosity=0.005, cells=1000)
    np.testing.assert_allclose(fronts, huppert_front(times, area=0.005, viscosity=0.005), rtol=TOLERANCE)


def test_inertia_carries_a_thin_fluid_beyond_hupperts_law():
    """Late, and before that it lags behind."""
    fronts = long_wave_fronts([0.5, 2.0], height=0.07, length=0.5, viscosity=0.205 / 1285.0)
    early, late = fronts / huppert_front(np.array([0.5, 2.0]), area=0.035, viscosity=0.205 / 1285.0)
    assert early < 0.9 and late > 1.0
    assert fronts[1] == pytest.approx(1.63, rel=0.02)  # and as on 2600 cells
