"""Still water: the measures on water that has just been set out, whose pressure is known; the cases take longer."""

import math

import pytest

from warpsph.cli import SCENES
from warpsph.run import Run
from warpsph.scene.loading import load_scene
from warpsph.validation.still_water import measure_still_water

AT_ONCE = ["run.end_time=5e-4", "output.pictures=false", "output.usd=false"]


@pytest.mark.parametrize("name", ["still_water", "still_water_3d"])
def test_measures_of_water_on_its_lattice(name, tmp_path):
    """It starts with the pressure of rest, and within half a millisecond no wall is heard inside."""
    scene = load_scene(SCENES / f"{name}.yaml", AT_ONCE)
    run = Run(scene, tmp_path / "run")
    run.execute()
    results = {result.quantity: result for result in measure_still_water(run)}
    for quantity in ("pressure at the bottom", "pressure gradient"):
        assert results[quantity].error < 0.05, quantity
    mean = results["acceleration by pressure, mean"]
    assert math.isfinite(mean.measured) and mean.error < 0.05
    assert results["particles behind a wall"].measured == 0
