"""What is known to be missed is told apart from what has broken."""

from warpsph.validation import CASES
from warpsph.validation.misses import EXPECTED, as_expected
from warpsph.validation.result import against, at_most


def test_only_a_bar_that_is_known_to_be_missed_is_an_expected_miss():
    known = as_expected("submarine_slide", against("trough at g1", "m", -5.3e-3, -3.9e-3, 0.1, "Zhou & Teng"))
    broken = as_expected("submarine_slide", against("trough at g2", "m", -5.3e-3, -11.2e-3, 0.1, "Zhou & Teng"))
    elsewhere = as_expected("still_water", at_most("trough at g1", "", 1.0, 0.05, ""))
    met = as_expected("submarine_slide", against("trough at g1", "m", -3.9e-3, -3.9e-3, 0.1, "Zhou & Teng"))
    assert [one.verdict for one in (known, broken, elsewhere, met)] == ["expected miss", "FAIL", "FAIL", "pass"]
    assert known.why in known.cells()[-1] and not elsewhere.why


def test_each_is_of_a_case_that_there_is():
    assert set(EXPECTED) <= set(CASES)
