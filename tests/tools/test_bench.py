"""The benchmark prints every figure that it promises."""

import json
import sys

import bench


def test_small_dam_break(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(bench, "LATTICE_STEPS", 5)
    figures = tmp_path / "bench.json"
    arguments = ["--particles", "400", "--threads", "1", "--lattice-only", "--json", str(figures)]
    monkeypatch.setattr(sys, "argv", ["bench.py", *arguments])
    assert bench.main() == 0
    printed = capsys.readouterr().out
    assert "M particle-updates/s" in printed and "pair loop: forces" in printed and "bytes a particle" in printed
    (result,) = json.loads(figures.read_text())
    assert result["particles"] == 400
    assert result["on the lattice"]["updates per second"] > 0.0
    assert result["milliseconds a step"]["pair loop: forces"] > 0.0
