"""The hand formulae beside a landslide: its slide as it is drawn, with the speed at which its centre sinks in."""

import numpy as np
import pytest

from warpsph.cli import SCENES
from warpsph.scene.loading import load_scene
from warpsph.theory.impulse import Slide, far_channel
from warpsph.validation.landslide import by_hand


def test_by_hand():
    scene = load_scene(SCENES / "landslide.yaml")
    speed = np.array([0.0, 1.0, 2.0, 2.5])
    record = {"z [m]": np.array([0.3, 0.2, 0.14, 0.1]), "u [m/s]": 0.8 * speed, "w [m/s]": -0.6 * speed}
    slide = Slide(speed=2.0, thickness=0.1, volume=0.02, density=2530.0, slope=30.0, width=1.0, depth=0.15)
    product, amplitude, height, period = (one.measured for one in by_hand(scene, record, scene.gauges[-1].x))
    wave = far_channel(slide, 1.7)
    assert product == pytest.approx(slide.product, rel=1e-4)
    assert (amplitude, height, period) == pytest.approx((wave.amplitude, wave.height, wave.period), rel=1e-4)
    assert by_hand(scene, {**record, "z [m]": record["z [m]"] + 1.0}, 1.0) == []
