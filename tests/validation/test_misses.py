"""What is known to be missed is told apart from what has broken."""

from warpsph.validation import CASES
from warpsph.validation.misses import EXPECTED, as_expected
from warpsph.validation.result import against, at_most


def test_only_a_bar_that_is_known_to_be_missed_is_an_expected_miss():
    known = as_expected("wave_maker", against("H / S, kd = 1.5", "", 1.30, 1.39, 0.05, "Dean"))
    broken = as_expected("wave_maker", against("H / S, kd = 0.3", "", 0.20, 0.30, 0.05, "Dean"))
    elsewhere = as_expected("still_water", at_most("H / S, kd = 1.5", "", 1.0, 0.05, ""))
    met = as_expected("wave_maker", against("H / S, kd = 1.5", "", 1.39, 1.39, 0.05, "Dean"))
    assert [one.verdict for one in (known, broken, elsewhere, met)] == ["expected miss", "FAIL", "FAIL", "pass"]
    assert known.why in known.cells()[-1] and not elsewhere.why


def test_each_is_of_a_case_that_there_is():
    assert set(EXPECTED) <= set(CASES)
