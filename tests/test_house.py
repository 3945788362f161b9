"""The house: imports go down the staircase, in no circle, and the lists that tell of it name what is there."""

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def test_imports_go_down_the_staircase(monkeypatch, capsys):
    cli = pytest.importorskip("importlinter.cli")
    monkeypatch.chdir(ROOT)
    status = cli.lint_imports(no_cache=True)
    told = capsys.readouterr().out
    assert status == cli.EXIT_STATUS_SUCCESS, told
    assert "4 kept, 0 broken" in told
