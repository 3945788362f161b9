"""The tutorial's scenes and commands do what it says, for a shorter time."""

import re
import shlex
from pathlib import Path

import pytest

import warpsph
from warpsph.cli import OK, main

PAGE = (Path(__file__).parents[1] / "scenes" / "TUTORIAL.md").read_text(encoding="utf-8")
SCENES = re.findall(r"```yaml\n# (\w+\.yaml)\n(.*?)```", PAGE, re.DOTALL)
COMMANDS = [line for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) for line in block.splitlines() if line]
SHORT = ["--until", "0.5"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tutorial")
    for name, text in SCENES:
        (folder / name).write_text(text)
    return folder


def test_the_tutorial_has_both_scenes():
    assert [name for name, _ in SCENES] == ["dam.yaml", "dam3.yaml"]
    assert len(COMMANDS) >= 5


@pytest.mark.slow
def test_every_command_of_the_tutorial_runs(folder, monkeypatch):
    monkeypatch.chdir(folder)
    for command in COMMANDS:
        python, option, program, *words = shlex.split(command)
        assert (python, option, program) == ("python", "-m", "warpsph")
        if words[0] in ("scene", "check", "sweep"):
            words += SHORT
        assert main(words) == OK, command
    records = warpsph.read_run("runs/dam")
    assert "force x" in records["forces/dam"] and "volume" in records["overtopping/crest"]
