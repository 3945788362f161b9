"""A series of blocks: the bars that it is held to, and the curve that it leaves behind."""

import math
from types import SimpleNamespace

import pytest
from PIL import Image

from warpsph.validation import CASES, Series, blocks
from warpsph.validation.blocks import BlockImpact, measure_maciel_series, measure_mki_series


def run_of(
    froude: float, amplitude: float, share: float = 0.1, inside: int = 0, by_law: float = math.nan
) -> SimpleNamespace:
    """What stands for a finished run: its scene, and the slide that is read off it."""
    shares = (share, 0.09, 0.07, 0.05, by_law, 0.1)
    slide = BlockImpact(SimpleNamespace(froude=froude), (), amplitude, 0.5 * amplitude, 1.5, 1.5, *shares, inside, 0.05)
    fill = SimpleNamespace(fill=SimpleNamespace(level=0.2))
    return SimpleNamespace(scene=SimpleNamespace(fluids=[fill]), slide=slide)


@pytest.fixture(autouse=True)
def _slides(monkeypatch):
    monkeypatch.setattr(blocks, "slide_of", lambda run: run.slide)


@pytest.mark.parametrize("measure", [measure_maciel_series, measure_mki_series])
def test_amplitudes_that_grow_pass_and_are_drawn(measure, tmp_path):
    results = measure([run_of(1.5, 0.05), run_of(0.5, 0.02), run_of(1.0, 0.03)], tmp_path)
    assert all(result.passed for result in results)
    assert [r.quantity[-4:] for r in results[:3]] == ["0.50", "1.00", "1.50"]
    with Image.open(tmp_path / "amplitude.png") as picture:
        assert picture.width > 1000


@pytest.mark.parametrize(
    ("run", "words"),
    [
        (run_of(1.5, 0.025), "least growth"),
        (run_of(1.5, 0.05, share=0.2), "energy of the wave"),
        (run_of(1.5, 0.05, inside=1), "particles in a block"),
        (run_of(1.5, 0.05, by_law=0.035), "crest amplitude, Froude number 1.50"),
    ],
    ids=["falls", "takes too much", "leaks", "is too high"],
)
def test_what_fails_is_told(run, words, tmp_path):
    results = measure_maciel_series([run_of(0.5, 0.02), run_of(1.0, 0.03), run], tmp_path)
    (failed,) = [result for result in results if not result.passed]
    assert failed.quantity.startswith(words)


def test_each_series_has_five_speeds():
    series = [case for name, case in CASES.items() if isinstance(case, Series) and name.startswith("block")]
    assert [len(set(one.settings)) for one in series] == [5, 5]
