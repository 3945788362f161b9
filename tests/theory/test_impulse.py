"""The hand formulae of VAW-Mitteilungen 254 against the examples that the manual works out."""

import math

import pytest

from warpsph.theory.impulse import Slide, far_basin, far_channel, in_words, near_basin, near_channel

# Lake Askja 2014 (4.2.1); a mass of 2e10 kg. The manual goes on with P = 0.49.
ASKJA = Slide(speed=30.1, thickness=35.5, volume=1e7, density=2000.0, slope=10.4, width=550.0, depth=138.0)
FIRST = Slide(speed=58.0, thickness=12.0, volume=2.2e5, density=1700.0, slope=40.0, width=100.0, depth=80.0)
SECOND = Slide(speed=32.0, thickness=40.0, volume=6e5, density=500.0, slope=35.0, width=120.0, depth=100.0)


def test_a_channel():
    assert (ASKJA.froude, ASKJA.relative_thickness, ASKJA.relative_mass) == pytest.approx((0.82, 0.26, 1.91), abs=0.005)
    assert ASKJA.product == pytest.approx(0.49, abs=0.006)
    place, wave = near_channel(ASKJA)
    assert place == pytest.approx(531.0, rel=0.01) and wave.height == pytest.approx(43.3, rel=0.01)
    assert wave.amplitude == pytest.approx(0.8 * wave.height) and wave.length == pytest.approx(
        wave.celerity * wave.period
    )


@pytest.mark.parametrize(
    ("slide", "product", "waves"), [(FIRST, 0.64, (14.4, 22.7, 10.1)), (SECOND, 0.43, (14.4, 23.3, 11.4))]
)
def test_a_basin(slide, product, waves):
    assert slide.product == pytest.approx(product, abs=0.006)
    reach, found = near_basin(slide)
    assert tuple(found.values()) == pytest.approx(waves, abs=0.06)
    assert far_basin(slide, reach) == pytest.approx(found)
    far = far_basin(slide, 8.0 * slide.depth)
    assert all(far[name] < found[name] for name in found)
    assert far_basin(slide, 8.0 * slide.depth, 60.0)["first crest"] < far["first crest"]
    assert near_basin(slide, 90.0)[0] == pytest.approx(
        0.5 * slide.width + 1.5 * (slide.product * slide.cosine) ** 0.25 * slide.depth
    )


@pytest.mark.parametrize(("product", "ratio"), [(0.13, 1.125), (0.43, 0.959), (1.00, 0.857), (2.08, 0.777)])
def test_the_two_zones_of_a_channel_do_not_join(product, ratio):
    slide = Slide(speed=1.0, thickness=0.1, volume=0.01, density=1000.0, slope=45.0, width=1.0, depth=0.1)
    slide = Slide(product / slide.product, 0.1, 0.01, 1000.0, 45.0, 1.0, 0.1)
    place, wave = near_channel(slide)
    assert far_channel(slide, place).height / wave.height == pytest.approx(ratio, abs=1.5e-3)


def test_decay_and_period_with_distance():
    a, b = (far_channel(ASKJA, x) for x in (1000.0, 8000.0))
    assert b.height / a.height == pytest.approx(8.0 ** (-0.8 / 3.0)) and b.period / a.period == pytest.approx(
        8.0**0.3125
    )


def test_limits_are_told():
    assert [word.split(" ")[0] for word in ASKJA.outside(600.0)] == ["F", "B", "slope"]
    assert not FIRST.outside(640.0, basin=True)[1:] and math.isfinite(FIRST.product)
    assert any(line.startswith("outside of the experiments: F = 0.818") for line in in_words(ASKJA))
    assert "no formula" in in_words(ASKJA, 100.0)[2]
