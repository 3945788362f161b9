"""The measures of viscous flow: on runs short and coarse enough for every test run, and on made-up profiles."""

import numpy as np
import pytest

from warpsph.cli import SCENES
from warpsph.run import Run
from warpsph.scene.loading import load_scene
from warpsph.validation import CASES, Series
from warpsph.validation.viscous import (
    PATCH,
    Profile,
    _order,
    layer,
    measure_couette,
    measure_interpolation,
)

# For sums over a few numbers.
TOLERANCE = 1e-9
BARE = ("output.pictures=false", "output.usd=false")


def runs_of(scene: str, settings, folder) -> list[Run]:
    runs = [
        Run(load_scene(SCENES / f"{scene}.yaml", (*setting, *BARE)), folder / str(i), threads=1)
        for i, setting in enumerate(settings)
    ]
    for run in runs:
        run.execute()
    return runs


def test_error_of_a_profile():
    """Root of the mean square, over that of the exact velocity; the peak by its own."""
    profile = Profile(np.arange(4.0), np.array([1.0, 2.0, 3.0, 4.4]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert profile.error == pytest.approx(0.4 / np.sqrt(30.0), rel=TOLERANCE)
    assert profile.peak == pytest.approx(0.1, rel=TOLERANCE)


@pytest.mark.parametrize(("order", "passed"), [(1.0, False), (2.0, True)])
def test_order_leaves_out_what_does_not_converge(order, passed):
    rows = (25, 35, 50)
    result = _order(rows, [0.003 + 2.0 * n**-order for n in rows])
    assert result.measured == pytest.approx(order, abs=0.01)
    assert result.passed == passed


def test_couette_on_ten_rows(tmp_path):
    """Within 6 % of the exact solution at every time, which is drawn; a start at once is hard on ten rows."""
    ends = [(f"run.end_time={time:g}",) for time in (0.01, 0.02, 0.03, 0.04)]
    settings = [(*layer(10, 0.6, 2), *end) for end in (*ends, ends[-1])]
    results = measure_couette(runs_of("couette", settings, tmp_path), tmp_path)
    assert max(result.measured for result in results[:-1]) < 0.06
    assert results[-1].measured == pytest.approx(1.0, rel=TOLERANCE)  # the last two runs are the same
    assert (tmp_path / "profiles.png").stat().st_size > 10_000


def test_interpolation(tmp_path):
    assert all(result.passed for result in measure_interpolation(runs_of("interpolation", PATCH, tmp_path), tmp_path))


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if isinstance(case, Series)])
def test_settings_of_a_series_are_scenes(name):
    case = CASES[name]
    for setting in case.settings:
        load_scene(SCENES / f"{case.scene}.yaml", setting)
