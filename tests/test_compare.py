"""Runs laid over each other: how far the gauges of one are off those of another."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from warpsph.cli import INPUT, MACHINE, OK, main
from warpsph.compare import HEADINGS, compare


def make_run(folder: Path, amplitude: float, times: np.ndarray, shift: float = 0.0) -> Path:
    (folder / "gauges").mkdir(parents=True)
    (folder / "scene.yaml").write_text("title: a run\n")
    level = 0.5 + amplitude * np.exp(-(((times - 1.0 - shift) / 0.15) ** 2))
    lines = [f"{t:.6f},{z:.9g}" for t, z in zip(times, level, strict=True)]
    (folder / "gauges/near.csv").write_text("\n".join(["time [s],level [m]", *lines, ""]))
    return folder


@pytest.fixture
def runs(tmp_path) -> list[Path]:
    first = make_run(tmp_path / "first", 0.10, np.linspace(0.0, 2.0, 401))
    return [first, make_run(tmp_path / "second", 0.12, np.linspace(0.0, 1.8, 181))]


def test_differences_are_those_of_the_records(runs):
    found = compare(runs)
    first, second = (dict(zip(HEADINGS, row, strict=True)) for row in found.rows)
    assert first["off the first, rms [m]"] is None
    assert second["crest / first's"] == pytest.approx(1.2, rel=0.01)
    assert second["off the first, most [m]"] == pytest.approx(0.02, rel=0.01)
    # Of a Gaussian of height 0.02 m and width 0.15 s over 1.8 s.
    assert second["off the first, rms [m]"] == pytest.approx(0.02 * np.sqrt(0.15 * np.sqrt(np.pi / 2) / 1.8), rel=0.02)
    assert [caption for caption, _ in found.figures] == ["near: level above rest", "near: difference"]


def test_the_command_prints_and_writes_a_page_and_spares_what_is_not_ours(runs, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert main(["compare", *map(str, runs), "--out", str(page)]) == OK
    assert "second, near: " in capsys.readouterr().out
    assert page.read_text().count("<figure>") == 2
    assert main(["compare", *map(str, runs), "--out", str(page)]) == OK
    page.write_text("my own page")
    assert main(["compare", *map(str, runs), "--out", str(page)]) == INPUT
    assert page.read_text() == "my own page"


def test_mistakes_are_one_line(runs, tmp_path, capsys):
    empty = tmp_path / "empty"
    empty.mkdir()
    for words, complaint in (
        ([runs[0]], "two run folders"),
        ([runs[0], empty], "not a run folder"),
        ([*runs, "--out", tmp_path / "none" / "page.html"], "folder that is there"),
    ):
        assert main(["compare", *map(str, words)]) == INPUT
        assert complaint in capsys.readouterr().err


def test_a_file_of_the_user_among_the_gauges_is_left_out(runs):
    (runs[0] / "gauges/measured.csv").write_text("t;h\n0;1\n")
    assert len(compare(runs).rows) == 2


def test_a_full_disk_is_a_line_and_leaves_the_page_before(runs, tmp_path, monkeypatch, capsys):
    page = tmp_path / "page.html"
    assert main(["compare", *map(str, runs), "--out", str(page)]) == OK
    before, write = page.read_bytes(), Path.write_text

    def fill(path: Path, text: str, **options: str) -> None:
        write(path, text[:100], **options)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", fill)
    capsys.readouterr()
    assert main(["compare", *map(str, runs), "--out", str(page)]) == MACHINE
    assert capsys.readouterr().err == f"{page}: No space left on device\n"
    assert page.read_bytes() == before
    assert not list(tmp_path.glob(".*"))
